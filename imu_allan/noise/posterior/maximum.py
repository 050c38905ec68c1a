# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Maximum likelihood of the noise terms for a given spectrum.

The DCT-II diagonalises white noise and random walk exactly and flicker nearly. So its squared
coefficients P are independent and chi-square distributed about their expectations lambda. These
are sum theta_i S_i, with the squared coefficients theta of the terms. The negative log likelihood
is (1/2) sum n (ln lambda + P / lambda) with n degrees of freedom. Fisher scoring then is
iteratively reweighted non-negative least squares of a few columns.

A ramp, like any other trend of the mean, is deterministic. Before each scoring step it is removed
from the power under the current noise estimate, and its uncertainty is added back. This is a step
of expectation-maximisation for the restricted likelihood.

References
----------
P. Whittle, "Estimation and information in stationary time series", Ark. Mat. 2 (1953).
C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, ch. 23.

"""

from collections.abc import Sequence
from typing import NamedTuple

from imu_allan.arrays import Array
from imu_allan.noise.posterior.regression import about_mean
from imu_allan.noise.record.groups import Groups
import numpy as np


class Solution(NamedTuple):
    """Squared coefficients, shape (columns,), and negative log likelihood up to a constant."""

    theta: Array
    loss: float


def maximise(groups: Groups, start: Array | None = None, *, fixed: dict[int, float] | None = None,
             detrend: bool = False, tolerance: float = 1e-7) -> Solution:
    """
    Maximise the likelihood of the squared coefficients, (6) or (7) of docs/statistics.md.

    Parameters
    ----------
    groups : Groups
        The spectrum of one axis.
    start : ndarray, shape (columns,), optional
        Starting values.
    fixed : dict, optional
        Squared coefficients to hold fixed, by column.
    detrend : bool, optional
        Remove the regressors of the groups, including the ramp, from the power.
    tolerance : float, optional
        Stop when the loss decreases by less than this.

    Returns
    -------
    Solution
        With `detrend`, the loss is that of the residual power.

    References
    ----------
    P. Whittle, Ark. Mat. 2 (1953): the likelihood of a spectrum. H. D. Patterson and R. Thompson,
    Biometrika 58 (1971): the restricted one.

    Examples
    --------
    White noise alone, in 24 bands of 100 coefficients each:

    >>> from imu_allan.noise.record.groups import WHITE
    >>> nu = np.geomspace(0.001, 0.5, 24)
    >>> design = np.stack([4 * np.sin(np.pi * nu) ** 2, np.ones(24), 1 / nu, 1 / nu**2], axis=1)
    >>> one, none = np.ones(24), np.zeros((24, 1, 1, 1))
    >>> groups = Groups(nu, 100 * one, 9 * one, design, one, one, none[..., 0, 0], none[..., 0],
    ...                 none)
    >>> float(maximise(groups).theta[WHITE].round(6))
    9.0

    """
    held = fixed or {}
    free = [i for i in range(groups.design.shape[1]) if i not in held]
    # One contiguous row per column, for speed.
    design = np.ascontiguousarray(groups.design.T[free])
    offset = groups.design[:, list(held)] @ np.array(list(held.values()))
    tiny = 1e-12 * float(groups.power.max(initial=0.0)) + 1e-300
    about = about_mean(groups) if detrend else None
    power, theta, loss = groups.power, np.zeros(len(free)), np.inf
    # Without starting values, expect the observed power.
    expected = np.maximum(power, tiny)

    def at(theta: Array) -> tuple[Array, float]:
        """Return the expected power and the loss."""
        expected = offset + theta @ design
        expected = np.where(expected > 0, expected, tiny)
        return expected, 0.5 * float(groups.dof @ (np.log(expected) + power / expected))

    if start is not None:
        theta = start[free]
        expected, loss = at(theta)
    # Limit the number of iterations, should the search not converge.
    for _ in range(60):
        if about is not None:
            power = about(expected).noise
            loss = at(theta)[1] if np.isfinite(loss) else loss
        weighted = design * (groups.dof / expected**2)
        # The set of nonzero coefficients seldom changes between steps, so pass it as a guess.
        target = trial = non_negative(weighted @ design.T, weighted @ (power - offset),
                                      np.flatnonzero(theta).tolist())
        trial_expected, trial_loss = at(trial)
        step = 1.0
        # Halve the step while the loss grows.
        while trial_loss > loss + 1e-12 * abs(loss) and step > 1e-3:
            step /= 2
            trial = theta + step * (target - theta)
            trial_expected, trial_loss = at(trial)
        if trial_loss > loss:
            break
        converged = loss - trial_loss < tolerance
        theta, expected, loss = trial, trial_expected, trial_loss
        if converged:
            break
    solution = np.zeros(groups.design.shape[1])
    solution[free], solution[list(held)] = theta, list(held.values())
    return Solution(solution, loss)


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive` guesses the nonzero entries."""
    root = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    # Unit columns, with a ridge between those that cannot be distinguished.
    gram, target = gram / (root[:, None] * root), target / root
    identity = np.eye(len(root))
    gram += 1e-13 * identity
    active, x = np.ones(len(root), dtype=bool), target
    if positive:
        active[:] = False
        active[positive] = True
    # Limit the iterations, because near-collinear columns can make `gram` indefinite by rounding.
    for _ in range(4 * len(root) + 4):
        among_active = np.where(active[:, None] & active, gram, identity)
        x = np.asarray(np.linalg.solve(among_active, target * active), np.float64)
        downhill = np.where(active, 0.0, target - gram @ x)
        if x.min(initial=0.0) < 0:
            active[x.argmin()] = False
        elif downhill.max(initial=0.0) > 1e-10:
            active[downhill.argmax()] = True
        else:
            break
    return np.asarray(np.maximum(x, 0.0) / root)
