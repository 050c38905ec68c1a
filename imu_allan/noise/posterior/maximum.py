# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Likelihood of the noise terms given a spectrum.

The DCT-II diagonalises white noise and random walk exactly and flicker nearly, so the squared
coefficients P are independent, each chi-square about its expectation lambda. With the squared
coefficients theta of the terms, lambda = sum theta_i S_i, and minus the log-likelihood is
(1/2) sum n (ln lambda + P / lambda), n being the degrees of freedom. Fisher scoring on it is an
iteratively re-weighted non-negative least squares of a few columns.

A ramp, and any other trend of the mean, is deterministic: before every step of the scoring it is
taken out of the power as the noise so far has it, its uncertainty given back, which is a step of
expectation and maximisation for the restricted likelihood.

References
----------
P. Whittle, "Estimation and information in stationary time series", Ark. Mat. 2 (1953).

"""

from typing import NamedTuple

from imu_allan.noise.posterior.non_negative import non_negative
from imu_allan.noise.posterior.regression import about_mean
from imu_allan.noise.record.groups import Groups
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Solution(NamedTuple):
    """Squared coefficients, shape (columns,), and minus the log-likelihood up to a constant."""

    theta: Array
    loss: float


def maximise(groups: Groups, start: Array | None = None, *,
             fixed: dict[int, float] | None = None, moving_mean: bool = False,
             tolerance: float = 1e-7) -> Solution:
    """
    Find the most likely squared coefficients: equation (6) of docs/statistics.md, or (7).

    Parameters
    ----------
    groups : Groups
        The spectrum of one axis.
    start : ndarray, shape (columns,), optional
        Where to begin.
    fixed : dict, optional
        Squared coefficient by column that is held at a value.
    moving_mean : bool, optional
        Take the regressors of the groups out of the power, the ramp among them.
    tolerance : float, optional
        Change of the loss at which to stop.

    Returns
    -------
    Solution
        About a mean that moves the loss is that of what is left of the power.

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
    >>> zero, one = np.zeros(24), np.ones(24)
    >>> groups = Groups(nu, 100 * one, 9 * one, design, zero, one, one, zero)
    >>> float(maximise(groups).theta[WHITE].round(6))
    9.0

    """
    held = fixed or {}
    free = [i for i in range(groups.design.shape[1]) if i not in held]
    # One row to a column: what is done to all groups of a column then runs through memory.
    design = np.ascontiguousarray(groups.design.T[free])
    offset = groups.design[:, list(held)] @ np.array(list(held.values()))
    tiny = 1e-12 * float(groups.power.max(initial=0.0)) + 1e-300
    about = about_mean(groups) if moving_mean else None
    power, part, value = groups.power, np.zeros(len(free)), np.inf
    # Where nothing is known, the data is what is expected.
    expected = np.maximum(power, tiny)

    def at(part: Array) -> tuple[Array, float]:
        total = offset + part @ design
        total = np.where(total > 0, total, tiny)
        return total, 0.5 * float(groups.dof @ (np.log(total) + power / total))

    if start is not None:
        part = start[free]
        expected, value = at(part)
    # An end for a search that does not settle.
    for _ in range(60):
        if about is not None:
            power = about(expected).noise
            value = at(part)[1] if np.isfinite(value) else value
        weighted = design * (groups.dof / expected**2)
        # Which coefficients are above zero seldom changes from one step to the next.
        goal = non_negative(weighted @ design.T, weighted @ (power - offset),
                            np.flatnonzero(part).tolist())
        there, share = goal, 1.0
        reached, loss = at(there)
        # Halving the step on gains nothing.
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
