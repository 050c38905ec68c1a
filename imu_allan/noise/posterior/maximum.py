# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Likelihood of the noise terms given a spectrum.

The DCT-II diagonalises white noise and random walk exactly and flicker nearly, so the squared
coefficients P are independent, each chi-square about its expectation lambda. With the squared
coefficients theta of the terms, lambda = sum theta_i S_i, and minus the log-likelihood is
(1/2) sum n (ln lambda + P / lambda), n being the degrees of freedom. Fisher scoring on it is an
iteratively re-weighted non-negative least squares of a few columns.

A ramp, and any other trend of the mean, is deterministic: it enters by regressors on the
whole-record coefficients (`imu_allan.noise.posterior.regression`). In a step of the scoring only
the power changes; what the trend explains then counts neither for nor against a random walk.

References
----------
P. Whittle, "Estimation and information in stationary time series", Ark. Mat. 2 (1953).

"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from imu_allan.noise.posterior.non_negative import non_negative
from imu_allan.noise.posterior.regression import (
    about_blocks,
    about_trend,
    Explained,
    explained_by_regressors,
    NOTHING,
    slope_of,
)
from imu_allan.noise.record.groups import Groups
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TrendFit = Literal['restricted', 'likely']

_CLEARLY = 0.005
"""
Gain over distance from the limit at which no further steps get there. Of 298 records 0.02 decides
as steps to the end do, 0.1 lets four terms pass for observable.
"""


@dataclass(frozen=True)
class Solution:
    """
    A maximum of the likelihood.

    Attributes
    ----------
    theta : ndarray, shape (columns,)
        Squared coefficients, none negative.
    slope : float
        The ramp, in sample units per second.
    loss : float
        Minus the log-likelihood, up to a constant.
    trend : ndarray, shape (regressors,) or (records, regressors), optional
        Their coefficients, where they were fitted.

    """

    theta: Array
    slope: float
    loss: float
    trend: Array | None = None


def maximise(groups: Groups, start: Solution | None = None, *,
             fixed: dict[int, float] | None = None, ramp: float | None = 0.0,
             trend: TrendFit | None = None,
             tolerance: float = 1e-7, limit: float = np.inf) -> Solution:
    """
    Find the most likely squared coefficients: equation (6) of docs/statistics.md, or (7).

    Parameters
    ----------
    groups : Groups
        The spectrum of one axis.
    start : Solution, optional
        Where to begin.
    fixed : dict, optional
        Squared coefficient by column that is held at a value.
    ramp : float or None, optional
        Slope of the ramp that is held, or None to fit it.
    trend : {'restricted', 'likely'}, optional
        Instead of the ramp, take all regressors of the groups out: by restricted likelihood, whose
        losses compare under the same regressors only, or as parameters like any other.
    tolerance : float, optional
        Change of the loss at which to stop.
    limit : float, optional
        Loss above which nobody wants to know by how much: the search ends where it is clear that
        it stays there.

    Returns
    -------
    Solution

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
    >>> groups = Groups(nu, 100 * one, 9 * one, design, zero, zero, one, one, zero)
    >>> float(maximise(groups).theta[WHITE].round(6))
    9.0

    """
    search = _Search(groups, fixed or {}, None if groups.along is None else trend, ramp, start)
    if start is not None:
        current = search.at(start.theta[search.free])
        value = search.loss(current)
    else:
        current, value = search.unfitted(), np.inf
    # An end for a search that does not settle.
    for _ in range(60):
        if search.follow(current) and np.isfinite(value):
            value = search.loss(current)
        reached, new = search.step(current, value)
        if new > value:
            break
        gained = value - new
        current, value = reached, new
        if gained < max(tolerance, _CLEARLY * (value - limit)):
            break
    return search.solution(current, value)


class _Point(NamedTuple):
    """What the search knows where it stands: all of it is asked for more than once."""

    part: Array
    expected: Array
    weight: Array
    logarithms: float
    explained: Explained


class _Search:
    """The loss as a function of the coefficients that are not held, about a trend that follows."""

    def __init__(self, groups: Groups, fixed: dict[int, float], trend: TrendFit | None,
                 ramp: float | None, start: Solution | None) -> None:
        columns = groups.design.shape[1]
        self.free = [i for i in range(columns) if i not in fixed]
        self._groups = groups
        self._trend = trend
        self._fits_ramp = ramp is None
        # One row to a column: what is done to all groups of a column then runs through memory.
        self._design = np.ascontiguousarray(groups.design.T[self.free])
        self._theta = np.zeros(columns)
        self._offset: Array | float = 0.0
        for i, value in fixed.items():
            self._theta[i] = value
            if value:
                self._offset = self._offset + value * groups.design[:, i]
        self._slope: float | Array = (ramp if ramp is not None and trend is None
                                      else start.slope if start and groups.record is None else 0.0)
        self._power = (about_blocks(groups, self._slope) if trend
                       else groups.at_ramp(float(self._slope)))
        self._about = self._power
        self._tiny = 1e-12 * float(self._power.max(initial=0.0))

    def unfitted(self) -> _Point:
        """Return where nothing is known: the data is what is expected."""
        return self._point(np.zeros(len(self.free)), np.maximum(self._power, self._tiny))

    def at(self, part: Array) -> _Point:
        """Return the point with these free coefficients, shape (free,)."""
        expected = self._offset + part @ self._design
        if expected.min(initial=np.inf) <= 0:
            expected = np.where(expected <= 0, self._tiny + 1e-300, expected)
        return self._point(part, expected)

    def _point(self, part: Array, expected: Array) -> _Point:
        weight = self._groups.dof / expected
        return _Point(part, expected, weight, float(self._groups.dof @ np.log(expected)),
                      explained_by_regressors(self._groups, weight, self._trend == 'restricted')
                      if self._trend else NOTHING)

    def loss(self, of: _Point) -> float:
        """Return minus the log-likelihood, about the trend that was last followed."""
        return 0.5 * (of.logarithms + float(of.weight @ self._power)) - of.explained.gain

    def follow(self, current: _Point) -> bool:
        """Take the trend as it is at a point out of the power; whether losses change by that."""
        groups = self._groups
        if self._trend:
            slope = slope_of(groups, current.explained.trend)
            moved = isinstance(slope, np.ndarray) or slope != self._slope
            if moved:
                self._slope = slope
                self._power = about_blocks(groups, slope)
            self._about = about_trend(groups, self._power, current.explained)
            return moved
        if not self._fits_ramp:
            return False
        weight = current.weight * (groups.ramp > 0)
        norm = float(weight @ groups.ramp)
        if norm > 0:
            self._slope = float(weight @ groups.cross) / norm
            self._power = self._about = groups.at_ramp(self._slope)
        return norm > 0

    def step(self, current: _Point, value: float) -> tuple[_Point, float]:
        """Take one step of the scoring, no farther than the loss allows."""
        weighted = self._design * (current.weight / current.expected)
        # Which coefficients are above zero seldom changes from one step to the next.
        goal = non_negative(weighted @ self._design.T, weighted @ (self._about - self._offset),
                            [i for i, value in enumerate(current.part.tolist()) if value])
        return self._backtracked(current, goal, value)

    def _backtracked(self, current: _Point, goal: Array, value: float) -> tuple[_Point, float]:
        """Go to `goal`, or half as far and half again until the loss is no more than `value`."""
        reached = self.at(goal)
        new = self.loss(reached)
        share = 1.0
        # Halving the step on gains nothing.
        while new > value + 1e-12 * abs(value) and share > 1e-3:
            share /= 2
            reached = self.at(current.part + share * (goal - current.part))
            new = self.loss(reached)
        return reached, new

    def solution(self, current: _Point, value: float) -> Solution:
        """Return a point as a solution, with what was held."""
        theta = self._theta.copy()
        theta[self.free] = current.part
        return Solution(theta, self._slope if isinstance(self._slope, float) else 0.0, value,
                        current.explained.trend if self._trend else None)


def residual_power(groups: Groups, theta: Array) -> Array:
    """
    Power about the trend that the regressors of the groups give.

    Parameters
    ----------
    groups : Groups
        Of one axis.
    theta : ndarray, shape (columns,)
        Squared coefficients of the noise.

    Returns
    -------
    ndarray, shape (groups,)
        As expected under `theta` if noise is all there is beside the trend.

    """
    if groups.along is None:
        return groups.power
    expected = np.maximum(groups.design @ theta, 1e-300)
    explained = explained_by_regressors(groups, groups.dof / expected, True)
    slope = slope_of(groups, explained.trend)
    return about_trend(groups, about_blocks(groups, slope), explained)
