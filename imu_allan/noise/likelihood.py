# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Likelihood of the noise terms given a spectrum, in one module because it is one computation.

The DCT-II diagonalises white noise and random walk exactly and flicker nearly, so the squared
coefficients P are independent, each chi-square about its expectation lambda. With the squared
coefficients theta of the terms, lambda = sum theta_i S_i, and minus the log-likelihood is
(1/2) sum n (ln lambda + P / lambda), n being the degrees of freedom. Fisher scoring on it is an
iteratively re-weighted non-negative least squares of a few columns.

A ramp, and any other course of the mean, is deterministic: it enters by regressors X on the
whole-record coefficients c. With W = n / lambda on the diagonal, A = X'WX and b = X'Wc, the
restricted likelihood takes b'A^-1 b / 2 off and adds (1/2) ln det A; in a step of the scoring only
the power changes, to (c - X A^-1 b)^2 + x'A^-1 x. What the trend explains then counts neither for
nor against a random walk.

References
----------
P. Whittle, "Estimation and information in stationary time series", Ark. Mat. 2 (1953).
C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, ch. 23.
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from math import log
from typing import Literal, NamedTuple

from imu_allan.noise import spectrum
from imu_allan.noise.periodogram import Piece
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUANTIZATION, WHITE, FLICKER, WALK = range(4)
"""Columns of a design: the four terms that have a spectrum."""
_SINGLE = 48
"""Coefficients of a whole record that stay single: where the slow terms are told apart."""
_PER_OCTAVE = 8
"""Bands to an octave: over one of them the spectrum of the terms changes by a few percent."""
_RIDGE = 1e-10
"""Relative; far above rounding and far below what any two different regressors leave."""
_LEAST_OF_BLOCKS = 1e-3
"""Share of the power of blocks that a ramp leaves: by chance they hold less than it gives."""
_CLEARLY = 0.005
"""
Gain over distance from the limit at which no further steps get there. Of 298 records 0.02 decides
as steps to the end do, 0.1 lets four terms pass for observable.
"""
_SHORTEST_STEP = 1e-3
"""Share of a scoring step below which halving it on gains nothing."""


@dataclass(frozen=True)
class Bins:
    """
    Every frequency of a record, for all axes.

    Attributes
    ----------
    frequency : ndarray, shape (bins,)
        In Hz.
    dof : ndarray, shape (bins,)
        How many squared coefficients were averaged.
    power : ndarray, shape (axes, bins)
        Their mean, in squared sample units.
    design : ndarray, shape (bins, 4)
        Expected power for a coefficient 1 of each term.
    cross : ndarray, shape (axes, bins)
        Coefficient times that of a unit ramp; zero but in the whole-record part.
    coefficient : ndarray, shape (axes, bins)
        The coefficient itself, with its sign; zero but in the whole-record part.
    ramp : ndarray, shape (bins,)
        Squared coefficient of a unit ramp, negative where the sign of the ramp is lost.
    whole : ndarray of bool, shape (bins,)
        Whether a bin is a single coefficient of a whole-record part.
    piece, index : ndarray of int, shape (bins,)
        Which piece a bin is from, and its DCT index there.

    """

    frequency: Array
    dof: Array
    power: Array
    design: Array
    cross: Array
    coefficient: Array
    ramp: Array
    whole: NDArray[np.bool_]
    piece: NDArray[np.int64]
    index: NDArray[np.int64]

    @cached_property
    def band(self) -> NDArray[np.int64]:
        """Return the number of the narrow band of each bin: the same for every axis."""
        single = self.whole & (self.index <= _SINGLE)
        band = np.floor(_PER_OCTAVE * np.log2(self.frequency)).astype(np.int64)
        # The key keeps apart what must not be averaged: single coefficients, and the whole-record
        # part, whose ramp has a sign, from the blocks.
        key = np.where(single, (self.piece + 2) * 10_000_000 + self.index, band * 2 + self.whole)
        return np.unique(key, return_inverse=True)[1].astype(np.int64)


@dataclass(frozen=True)
class Groups:
    """
    Bins of one axis gathered into narrow bands; fields as in `Bins`, for one axis.

    Attributes
    ----------
    frequency, dof, power, cross, ramp : ndarray, shape (groups,)
    design : ndarray, shape (groups, columns)
    along : ndarray, shape (groups, regressors), optional
        Mean of coefficient times regressor; zero where the sign is lost.
    among : ndarray, shape (groups, regressors, regressors), optional
        Mean products of the regressors.
    record : ndarray of int, shape (groups,), optional
        Which of several records a group is of, each having regressors of its own; None for one.

    """

    frequency: Array
    dof: Array
    power: Array
    design: Array
    cross: Array
    ramp: Array
    along: Array | None = None
    among: Array | None = None
    record: NDArray[np.int64] | None = None

    @property
    def records(self) -> int:
        """How many records the groups are of."""
        return 1 if self.record is None else int(self.record.max()) + 1

    def at_ramp(self, slope: float) -> Array:
        """Power about the mean that a ramp of `slope` per second gives, shape (groups,)."""
        return about_ramp(self.power, self.cross, self.ramp, slope)

    def below(self, frequency_hz: float) -> 'Groups':
        """Return the groups up to a frequency."""
        return self.taken(self.frequency <= frequency_hz)

    def taken(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> 'Groups':
        """Return some of the groups, by mask or in an order."""
        return Groups(self.frequency[which], self.dof[which], self.power[which],
                      self.design[which], self.cross[which], self.ramp[which],
                      None if self.along is None else self.along[which],
                      None if self.among is None else self.among[which],
                      None if self.record is None else self.record[which])

    def with_design(self, design: Array) -> 'Groups':
        """Return the same power under another set of columns."""
        return replace(self, design=design)


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


def about_ramp(power: Array, cross: Array, ramp: Array, slope: float) -> Array:
    """
    Take the mean that a ramp gives the coefficients out of their power.

    Parameters
    ----------
    power, cross, ramp : ndarray, shape (n,)
        As in `Groups`.
    slope : float
        Of the ramp, per second.

    Returns
    -------
    ndarray, shape (n,)

    """
    if slope == 0:
        return power
    # What is left of coefficients whose sign is known is exact. Of blocks only the mean power of
    # the ramp is known, and by chance they can hold less.
    floor = np.where(ramp > 0, 1e-12, _LEAST_OF_BLOCKS)
    return np.maximum(power - 2 * slope * cross + slope**2 * ramp, floor * power)


def _shapes(length: int, first: int, last: int) -> tuple[Array, Array, Array]:
    """Flicker (with its DCT factor), random walk of unit step, and the squared sine, by index."""
    j = np.arange(first, last)
    nu = j / (2.0 * length)
    return (spectrum.flicker(nu, 1.0) * spectrum.flicker_dct_factor(j),
            spectrum.random_walk(nu, 1.0), np.sin(np.pi * nu) ** 2)


_block_shapes = lru_cache(maxsize=64)(_shapes)
"""The same for blocks, whose lengths are few. That of a whole record is another in every fit."""


def bins_of(pieces: Sequence[Piece], dt: float, bridged_share: float = 0.0) -> Bins:
    """
    Join the pieces of a spectrum.

    Parameters
    ----------
    pieces : sequence of Piece
        At least one.
    dt : float
        Sample interval in seconds.
    bridged_share : float, optional
        Share of the samples that stand in for missing ones, as means of those around.

    Returns
    -------
    Bins

    """
    parts = []
    for number, piece in enumerate(pieces):
        step = piece.step * dt
        shapes = _block_shapes if piece.coefficients is None else _shapes
        flicker, walk, s2 = shapes(piece.length, piece.first, piece.last)
        index = np.arange(piece.first, piece.last)
        white = np.full(len(s2), 1 / step)
        if piece.gaps.white is not None:
            white *= piece.gaps.white[piece.first:piece.last]
        if piece.gaps.flicker is not None and piece.gaps.walk is not None:
            flicker = flicker * piece.gaps.flicker[piece.first:piece.last]
            walk = walk * piece.gaps.walk[piece.first:piece.last]
        if bridged_share:
            white *= spectrum.bridged_white(index / (2 * piece.length * piece.step),
                                            bridged_share)
        # The second part of the first column is what both ends of a block leak.
        quantized = 4 * (s2 + (1 - s2) / piece.length) / step**2
        design = np.stack((quantized, white, flicker, step * walk), axis=1)
        part = slice(piece.first, piece.last)
        ramp = spectrum.ramp_dct(piece.length, step)[piece.first - 1:piece.last - 1]
        if piece.coefficients is None:
            signed, squared = np.zeros((len(piece.power), len(index))), -ramp**2
        else:
            signed, squared = piece.coefficients[:, part], ramp**2
        # What stands in for missing samples adds nothing new; means of many hardly hold any.
        known = 1 - max(piece.gaps.filled, bridged_share if piece.step == 1 else 0.0)
        parts.append((index / (2 * piece.length * step), np.full(len(index), known * piece.blocks),
                      piece.power[:, part], design, signed * ramp, signed, squared,
                      np.full(len(index), piece.coefficients is not None),
                      np.full(len(index), number), index))
    frequency, dof, power, design, cross, signed_, squared_, whole, number_, index_ = zip(
        *parts, strict=True)
    return Bins(np.concatenate(frequency), np.concatenate(dof).astype(np.float64),
                np.concatenate(power, axis=1), np.concatenate(design),
                np.concatenate(cross, axis=1), np.concatenate(signed_, axis=1),
                np.concatenate(squared_), np.concatenate(whole),
                np.concatenate(number_), np.concatenate(index_))


def grouped(bins: Bins, axis: int, keep: NDArray[np.bool_] | None = None,
            regressors: Array | None = None) -> Groups:
    """
    Gather the bins of one axis into bands of an eighth of an octave.

    Parameters
    ----------
    bins : Bins
        The spectrum of all axes.
    axis : int
        Column of the axis.
    keep : ndarray of bool, shape (bins,), optional
        False leaves a bin out.
    regressors : ndarray, shape (bins, n), optional
        Coefficients of what may move the mean beside the ramp, which comes first in any case;
        zero outside the whole-record part.

    Returns
    -------
    Groups
        The lowest 48 coefficients of every whole-record part stay single.

    """
    weight = bins.dof if keep is None else bins.dof * keep
    inverse = bins.band
    dof: Array = np.bincount(inverse, weight).astype(np.float64)
    some = dof > 0

    def average(values: Array) -> Array:
        return np.asarray(np.bincount(inverse, weight * values)[some] / dof[some])

    groups = Groups(average(bins.frequency), dof[some], average(bins.power[axis]),
                    np.stack([average(column) for column in bins.design.T], axis=1),
                    average(bins.cross[axis]), average(bins.ramp))
    columns = [-np.sqrt(np.maximum(bins.ramp, 0)), *([] if regressors is None else regressors.T)]
    along = [average(bins.coefficient[axis] * column) for column in columns]
    among = [[average(one * other) for other in columns] for one in columns]
    groups = replace(groups, along=np.stack(along, axis=1),
                     among=np.moveaxis(np.array(among), 2, 0))
    return groups.taken(np.argsort(groups.frequency))


def joined_groups(parts: Sequence[Groups]) -> Groups:
    """
    Put the spectra of several records side by side.

    Parameters
    ----------
    parts : sequence of Groups
        Of each record, with the same number of regressors.

    Returns
    -------
    Groups
        In order of frequency; the coefficients are one, those of the regressors each record's own.

    """
    record = np.repeat(np.arange(len(parts)), [len(part.dof) for part in parts])
    every = Groups(*(np.concatenate([getattr(part, field.name) for part in parts])
                     for field in fields(Groups) if field.name != 'record'))
    return replace(every, record=record).taken(np.argsort(every.frequency, kind='stable'))


def maximise(groups: Groups, start: Solution | None = None, *,
             fixed: dict[int, float] | None = None, ramp: float | None = 0.0,
             trend: Literal['restricted', 'likely'] | None = None,
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

    >>> nu = np.geomspace(0.001, 0.5, 24)
    >>> design = np.stack([4 * np.sin(np.pi * nu) ** 2, np.ones(24), 1 / nu, 1 / nu**2], axis=1)
    >>> zero = np.zeros(24)
    >>> groups = Groups(nu, np.full(24, 100.0), np.full(24, 9.0), design, zero, zero)
    >>> float(maximise(groups).theta[WHITE].round(6))
    9.0

    """
    if groups.along is None:
        trend = None
    restricted = trend == 'restricted'
    columns = groups.design.shape[1]
    fixed = fixed or {}
    free = [i for i in range(columns) if i not in fixed]
    # One row to a column: what is done to all groups of a column then runs through memory.
    design = np.ascontiguousarray(groups.design.T[free])
    dof = groups.dof
    offset: Array | float = 0.0
    theta = np.zeros(columns)
    for i, value in fixed.items():
        theta[i] = value
        offset = offset + value * groups.design[:, i]
    slope: float | Array = (ramp if ramp is not None and trend is None
                            else start.slope if start and groups.record is None else 0.0)
    blocks, least = np.minimum(groups.ramp, 0.0), _LEAST_OF_BLOCKS * groups.power

    def about_blocks() -> Array:
        """Take the ramp out of the blocks, which know no sign, and leave it in the rest."""
        return np.asarray(np.maximum(groups.power + slope**2 * blocks, least))

    power = about_blocks() if trend else groups.at_ramp(float(slope))
    tiny = 1e-12 * float(np.max(power)) if len(power) else 0.0

    def point(part: Array, expected: Array) -> _Point:
        weight = dof / expected
        return _Point(part, expected, weight, float(dof @ np.log(expected)),
                      _explained(groups, weight, restricted) if trend else _NOTHING)

    def at(part: Array) -> _Point:
        expected = offset + part @ design
        if expected.min(initial=np.inf) <= 0:
            expected = np.where(expected <= 0, tiny + 1e-300, expected)
        return point(part, expected)

    def loss(of: _Point) -> float:
        return 0.5 * (of.logarithms + float(of.weight @ power)) - of.explained.gain

    if start is not None:
        current = at(start.theta[free])
        value = loss(current)
    else:
        current, value = point(np.zeros(len(free)), np.maximum(power, tiny)), np.inf
    about = power
    for _ in range(60):
        if trend:
            if groups.record is not None:
                slope = current.explained.trend[groups.record, 0]
                power = about_blocks()
                value = loss(current) if np.isfinite(value) else value
            elif current.explained.trend[0] != slope:
                slope = float(current.explained.trend[0])
                power = about_blocks()
                if np.isfinite(value):
                    value = loss(current)
            about = _about_trend(groups, power, current.explained)
        elif ramp is None:
            weight = current.weight * (groups.ramp > 0)
            norm = float(weight @ groups.ramp)
            if norm > 0:
                slope = float(weight @ groups.cross) / norm
                power = groups.at_ramp(slope)
                if np.isfinite(value):
                    value = loss(current)
            about = power
        weighted = design * (current.weight / current.expected)
        # Which coefficients are above zero seldom changes from one step to the next.
        goal = non_negative(weighted @ design.T, weighted @ (about - offset),
                            np.flatnonzero(current.part).tolist())
        reached, new = _backtracked(at, loss, current, goal, value)
        if new > value:
            break
        gained = value - new
        current, value = reached, new
        if gained < max(tolerance, _CLEARLY * (value - limit)):
            break
    theta[free] = current.part
    return Solution(theta, slope if isinstance(slope, float) else 0.0, value,
                    current.explained.trend if trend else None)


class _Explained(NamedTuple):
    """What the regressors explain: fall of the loss, their coefficients, and the covariance."""

    gain: float
    trend: Array
    covariance: Array


_NOTHING = _Explained(0.0, np.zeros(0), np.zeros((0, 0)))


class _Point(NamedTuple):
    """What the search knows where it stands: all of it is asked for more than once."""

    part: Array
    expected: Array
    weight: Array
    logarithms: float
    explained: _Explained


def _explained(groups: Groups, weight: Array, restricted: bool) -> _Explained:
    """Regress the coefficients on the regressors; `weight` is 1 over the variance of the noise."""
    assert groups.along is not None
    assert groups.among is not None
    if groups.record is not None:
        return _explained_in_each(groups, weight, restricted)
    target = weight @ groups.along
    if len(target) == 1:
        # The ramp alone: nearly every fit, and plain numbers are several times faster.
        single, along = max(float(weight @ groups.among[:, 0, 0]), 1e-300), float(target[0])
        return _Explained(0.5 * (along**2 / single - restricted * log(single)),
                          np.array([along / single]), np.array([[1 / single]]))
    gram = np.tensordot(weight, groups.among, 1)
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    # The ridge is for a regressor that no coefficient sees, or that repeats another.
    lower = np.linalg.cholesky(gram / np.outer(scale, scale) + _RIDGE * np.eye(len(scale)))
    half = np.linalg.inv(lower) / scale
    covariance = half.T @ half
    trend = covariance @ target
    gain = 0.5 * float(target @ trend)
    if restricted:
        gain -= float(np.log(np.diagonal(lower) * scale).sum())
    return _Explained(gain, trend, covariance)


def _explained_in_each(groups: Groups, weight: Array, restricted: bool) -> _Explained:
    """Regress the coefficients of every record on its own regressors, and add up the gains."""
    assert groups.along is not None
    assert groups.among is not None
    assert groups.record is not None
    own = np.where(groups.record == np.arange(groups.records)[:, None], weight, 0.0)
    target = own @ groups.along
    gram = np.tensordot(own, groups.among, 1)
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
    lower = np.linalg.cholesky(gram / (scale[:, :, None] * scale[:, None])
                               + _RIDGE * np.eye(gram.shape[1]))
    half = np.linalg.inv(lower) / scale[:, None]
    covariance = np.swapaxes(half, 1, 2) @ half
    trend = np.einsum('rab,rb->ra', covariance, target)
    gain = 0.5 * float(np.vdot(target, trend))
    if restricted:
        gain -= float(np.log(np.diagonal(lower, axis1=1, axis2=2) * scale).sum())
    return _Explained(gain, trend, covariance)


def _about_blocks(groups: Groups, slope: float | Array) -> Array:
    """Take the ramp out of the blocks, which know no sign, and leave it in the coefficients."""
    return np.asarray(np.maximum(groups.power + slope**2 * np.minimum(groups.ramp, 0.0),
                                 _LEAST_OF_BLOCKS * groups.power))


def _about_trend(groups: Groups, power: Array, explained: _Explained) -> Array:
    """Power about the trend, and what its uncertainty has taken away."""
    assert groups.along is not None
    assert groups.among is not None
    trend = explained.trend
    if groups.record is not None:
        each = trend[groups.record]
        spread = (trend[:, :, None] * trend[:, None] + explained.covariance)[groups.record]
        about = power - 2 * np.einsum('ga,ga->g', groups.along, each) \
            + np.einsum('gab,gab->g', groups.among, spread)
        return np.asarray(np.maximum(about, 1e-12 * power))
    if len(trend) == 1:
        slope, variance = float(trend[0]), float(explained.covariance[0, 0])
        about = power - 2 * slope * groups.along[:, 0] + (slope**2 + variance) \
            * groups.among[:, 0, 0]
        return np.asarray(np.maximum(about, 1e-12 * power))
    moments = np.outer(trend, trend) + explained.covariance
    about = power - 2 * groups.along @ trend + np.tensordot(groups.among, moments, 2)
    return np.asarray(np.maximum(about, 1e-12 * power))


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
    explained = _explained(groups, groups.dof / expected, True)
    slope = float(explained.trend[0]) if groups.record is None \
        else explained.trend[groups.record, 0]
    return _about_trend(groups, _about_blocks(groups, slope), explained)


def _backtracked(at: Callable[[Array], _Point], loss: Callable[[_Point], float], current: _Point,
                 goal: Array, value: float) -> tuple[_Point, float]:
    """Halve the step from `current` to `goal` until the loss is no more than `value`."""
    reached = at(goal)
    new = loss(reached)
    share = 1.0
    while new > value + 1e-12 * abs(value) and share > _SHORTEST_STEP:
        share /= 2
        reached = at(current.part + share * (goal - current.part))
        new = loss(reached)
    return reached, new


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive`: a guess which x are above."""
    # Plain numbers: for four columns they are several times faster than arrays.
    scale = [max(value, 1e-300) ** -0.5 for value in np.diagonal(gram).tolist()]
    n = len(scale)
    g = [[value * scale[i] * scale[j] for j, value in enumerate(row)]
         for i, row in enumerate(gram.tolist())]
    t = [value * scale[i] for i, value in enumerate(target.tolist())]
    active = list(positive) or list(range(n))
    x = [0.0] * n
    # The bound is for columns so alike that rounding makes `gram` indefinite.
    for _ in range(4 * n + 4):
        solved = _solve(g, t, active)
        x = [0.0] * n
        for i, value in zip(active, solved, strict=True):
            x[i] = value
        lowest = min(active, key=lambda i: x[i], default=-1)
        if active and x[lowest] < 0:
            active = [i for i in active if i != lowest]
            continue
        slack = {i: t[i] - sum(a * b for a, b in zip(g[i], x, strict=True)) for i in range(n)
                 if i not in active}
        entering = max(slack, key=lambda i: slack[i], default=-1)
        if not slack or slack[entering] <= 1e-10:
            break
        active = sorted([*active, entering])
    return np.array([max(value, 0.0) * s for value, s in zip(x, scale, strict=True)])


def _solve(gram: list[list[float]], target: list[float], part: list[int]) -> list[float]:
    """Solve the symmetric system of the chosen rows and columns by Cholesky's method."""
    # Loops over plain numbers: sums over generators take twice as long for so few.
    lower: list[list[float]] = []
    y: list[float] = []
    for row, i in enumerate(part):
        line: list[float] = []
        rest, explained = gram[i][i] + 1e-13, target[i]
        for column in range(row):
            other = lower[column]
            value = gram[i][part[column]]
            for k in range(column):
                value -= line[k] * other[k]
            value /= other[column]
            line.append(value)
            rest -= value * value
            explained -= value * y[column]
        line.append(max(rest, 1e-13) ** 0.5)
        y.append(explained / line[row])
        lower.append(line)
    x = [0.0] * len(part)
    for row in range(len(part) - 1, -1, -1):
        value = y[row]
        for k in range(row + 1, len(part)):
            value -= lower[k][row] * x[k]
        x[row] = value / lower[row][row]
    return x
