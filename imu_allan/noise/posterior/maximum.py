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


def maximise(groups: Groups, start: Array | None = None, *,
             fixed: dict[int, float] | None = None, detrend: bool = False,
             tolerance: float = 1e-7) -> Solution:
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
    power, part, value = groups.power, np.zeros(len(free)), np.inf
    # Without starting values, expect the observed power.
    expected = np.maximum(power, tiny)

    def at(part: Array) -> tuple[Array, float]:
        total = offset + part @ design
        total = np.where(total > 0, total, tiny)
        return total, 0.5 * float(groups.dof @ (np.log(total) + power / total))

    if start is not None:
        part = start[free]
        expected, value = at(part)
    # Limit the number of iterations, should the search not converge.
    for _ in range(60):
        if about is not None:
            power = about(expected).noise
            value = at(part)[1] if np.isfinite(value) else value
        weighted = design * (groups.dof / expected**2)
        # The set of nonzero coefficients seldom changes between steps, so pass it as a guess.
        goal = non_negative(weighted @ design.T, weighted @ (power - offset),
                            np.flatnonzero(part).tolist())
        there, share = goal, 1.0
        reached, loss = at(there)
        # Halve the step while the loss grows.
        while loss > value + 1e-12 * abs(value) and share > 1e-3:
            share /= 2
            there = part + share * (goal - part)
            reached, loss = at(there)
        if loss > value:
            break
        gained = value - loss
        part, expected, value = there, reached, loss
        if gained < tolerance:
            break
    theta = np.zeros(groups.design.shape[1])
    theta[free], theta[list(held)] = part, list(held.values())
    return Solution(theta, value)


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive` guesses the nonzero entries."""
    root = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    # Unit columns, with a ridge between those that cannot be distinguished.
    gram, target = gram / (root[:, None] * root), target / root
    alone = np.eye(len(root))
    gram += 1e-13 * alone
    active, x = np.ones(len(root), dtype=bool), target
    if positive:
        active[:] = False
        active[positive] = True
    # Limit the iterations, because near-collinear columns can make `gram` indefinite by rounding.
    for _ in range(4 * len(root) + 4):
        both = active[:, None] & active
        x = np.asarray(np.linalg.solve(np.where(both, gram, alone), target * active), np.float64)
        rest = np.where(active, 0.0, target - gram @ x)
        if x.min(initial=0.0) < 0:
            active[x.argmin()] = False
        elif rest.max(initial=0.0) > 1e-10:
            active[rest.argmax()] = True
        else:
            break
    return np.asarray(np.maximum(x, 0.0) / root)
