# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Kalman filters run over data that their numbers are not from.

Backtest: each half of a record is fitted as if it were the whole one, and a filter of that model
runs over the other half. Everything comes from the whole-record series, at most 8192 means in
equal cells, which the estimator keeps in any case. That takes constant memory, and no second pass
over the file. Horizons are therefore multiples of a cell, some two seconds for a recording of
three hours.

Field test: filters with the numbers of one recording run over another, of another day or with the
motors on. They see means of about a second of the data at rest, and restart after every
interruption. A robot that has moved in between has another attitude to gravity and the earth's
rotation, which is not drift.

All axes and both directions of a test run in one loop. A step costs a dozen operations on small
arrays, whether one filter runs or twenty.
"""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import chain
from math import log2, sqrt

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.drift_model import fit_drift_model
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.cells import Cells, coarser
from imu_allan.noise.record.gaps import filled
from imu_allan.noise.record.groups import grouped
from imu_allan.noise.record.periodogram import Periodogram, SHORTEST, whole_section
from imu_allan.result import (
    AxisResult,
    Backtest,
    Coast,
    DriftModel,
    GaussMarkov,
    Innovations,
    Interval,
    Tone,
)
from imu_allan.tuning.forecast import coast_bands
from imu_allan.tuning.state_space import drift_model_of, space_of, StateSpace
from imu_allan.tuning.tune import Bias, FilterTuning, tune
import numpy as np
from numpy.typing import ArrayLike

INTERVALS_S = (1.0, 10.0, 60.0)    # time between corrections
COASTS_S = (10.0, 60.0, 300.0)
"""Times without correction, from some missed satellite fixes to a tunnel. Chosen by judgment, as
are the intervals."""
MOST_STEPS = 4096       # in one half, as every filter step costs time


@dataclass(frozen=True, eq=False)
class Filtered:
    """Innovations and states of filters, step by step."""

    innovation: Array    # (filters, steps): mean minus prediction
    variance: Array    # (filters, steps): predicted variance of the innovation
    # By step: state before it, (filters, states), and its covariance, (filters, states, states)
    before: dict[int, tuple[Array, Array]]


def run_filters(spaces: Sequence[StateSpace], means: ArrayLike, kept: Set[int] = frozenset()
                ) -> Filtered:
    """
    Run the Kalman filter of each state space over its consecutive means.

    A space with fewer states than others has zeros after its last one. Let x, P be before a step,
    and y its mean. Then ``S = H P H' + R``, ``G = (A P H' + C)/S``, ``x = A x + G (y - H x)`` and
    ``P = A P A' + Q - G S G'``. x and P are kept for the steps in `kept`.
    """
    series = np.asarray(means, dtype=np.float64)
    lanes, steps = series.shape
    n = max(len(space.transition) for space in spaces)
    decay, h, cross = np.zeros((lanes, n)), np.zeros((lanes, n)), np.zeros((lanes, n))
    process, p = np.zeros((lanes, n, n)), np.zeros((lanes, n, n))
    for lane, space in enumerate(spaces):
        k = len(space.transition)
        decay[lane, :k] = np.diag(space.transition)
        h[lane, :k], cross[lane, :k] = space.observation[0], space.cross[:, 0]
        process[lane, :k, :k], p[lane, :k, :k] = space.process, space.initial
    r = np.array([float(space.measurement[0, 0]) for space in spaces])
    both = decay[:, :, None] * decay[:, None, :]
    x = np.zeros((lanes, n))
    found = Filtered(np.empty((lanes, steps)), np.empty((lanes, steps)), {})
    for k in range(steps):
        if k in kept:
            found.before[k] = x, p
        ph = (p * h[:, None, :]).sum(axis=2)
        predicted = (h * ph).sum(axis=1) + r
        innovation = series[:, k] - (h * x).sum(axis=1)
        gain = (decay * ph + cross) / predicted[:, None]
        found.innovation[:, k], found.variance[:, k] = innovation, predicted
        x = decay * x + gain * innovation[:, None]
        p = both * p + process - predicted[:, None, None] * gain[:, :, None] * gain[:, None, :]
    return found


@dataclass(frozen=True)
class Met:
    """Performance of several filters on data that they were not fitted to."""

    # By interval: sum of normalised innovations squared, shape (filters,), and number of steps
    innovations: dict[float, tuple[Array, int]]
    # By horizon: sums of the predicted and the actual squared error of the mean, shape (filters,),
    # and number of outages
    coasts: dict[float, tuple[Array, Array, int]]

    def of(self, lane: int, lanes: int = 1) -> tuple[tuple[Innovations, ...], tuple[Coast, ...]]:
        """Combine some of the filters, for intervals and horizons with enough data."""
        filters = slice(lane, lane + lanes)
        # At least ten steps of a filter in one half.
        scores = tuple(Innovations(step_s, float(z[filters].sum()) / (lanes * steps),
                                   lanes * steps)
                       for step_s, (z, steps) in self.innovations.items()
                       if steps >= 10 - 1)
        # In each half: with fewer, the observed deviation says little about the predicted one.
        coasts = tuple(Coast(horizon_s, *(float(np.sqrt(sums[filters].sum() / (lanes * outages)))
                                          for sums in (predicted, squared)))
                       for horizon_s, (predicted, squared, outages) in self.coasts.items()
                       if outages >= 3)
        return scores, coasts


def backtest(series: Cells, cell: int, dt: float) -> list[Backtest | None]:
    """Fit each half of a record of means and filter the other; None if short or noiseless."""
    axes = series.sums.shape[0]
    rows = max(segments(series, cell), key=lambda rows: rows.shape[1], default=np.zeros((axes, 0)))
    cell_s = cell * dt
    coarsen = max(1, int(np.ceil(rows.shape[1] / 2 / MOST_STEPS)), round(INTERVALS_S[0] / cell_s))
    rows, cell_s = _averaged(rows, coarsen), cell_s * coarsen
    half = rows.shape[1] // 2
    found: list[Backtest | None] = [None] * axes
    # The record must hold enough unaided spans in each half.
    if 2 * half * cell_s < 600.0:
        return found
    parts = rows[:, :half], rows[:, half:2 * half]
    models = [[_fitted(row, cell_s) for row in part] for part in parts]
    good = [axis for axis in range(axes) if models[0][axis] and models[1][axis]]
    if not good:
        return found
    # Filters of the first half run over the second, those of the second over the first.
    lanes = [(model, part[axis]) for axis in good for model, part in
             ((models[0][axis], parts[1]), (models[1][axis], parts[0])) if model is not None]
    met = filtered([(model, ()) for model, _ in lanes], [np.stack([row for _, row in lanes])],
                   cell_s)
    for i, axis in enumerate(good):
        innovations, coasts = met.of(2 * i, 2)
        if innovations:
            found[axis] = Backtest(half * cell_s, half * cell_s, innovations, coasts)
    return found


def bands_of(axis: AxisResult) -> tuple[Interval, ...]:
    """Return where 95 % of the deviations in the backtest of an axis should lie, by horizon."""
    found = axis.backtest
    if found is None:
        return ()
    # Outages follow each other in both halves, except for the first segment, in which the filter
    # learns. The quotient of two multiples of a cell may be rounded down.
    outages = [2 * max(int(found.tested_s / coast.horizon_s + 1e-9) - 1, 1)
               for coast in found.coast]
    return coast_bands(axis, found.coast, outages)


def filtered(fed: Sequence[tuple[DriftModel, tuple[Tone, ...]]], parts: Iterable[Array],
             cell_s: float) -> Met:
    """Run filters of drift models with tones over means, shape (filters, n), part by part."""
    sizes = dict.fromkeys(max(1, round(interval / cell_s)) for interval in INTERVALS_S)
    spaces = {size: [space_of(*one, size * cell_s) for one in fed] for size in sizes}
    nothing = np.zeros(len(fed))
    met = Met({size * cell_s: (nothing, 0) for size in sizes}, {})
    for part in parts:
        for size in sizes:
            means = _averaged(part, size)
            if means.shape[1] < 2:
                continue
            means -= means[:, :1]
            finest = size == next(iter(sizes))
            outages = _outages(means.shape[1], size * cell_s) if finest else {}
            filters = run_filters(spaces[size], means, {*chain(*outages.values())})
            # The first step only learns the bias.
            z = filters.innovation[:, 1:] ** 2 / filters.variance[:, 1:]
            total, steps = met.innovations[size * cell_s]
            met.innovations[size * cell_s] = total + z.sum(axis=1), steps + z.shape[1]
            if finest:
                _coast(met, fed, filters, means, outages, size * cell_s)
    return met


def _outages(steps: int, step_s: float) -> dict[int, range]:
    """Return the first steps of consecutive outages, by their number of steps."""
    # Means may be longer than a horizon: the sensor has one sample in several seconds.
    return {size: range(size, steps - size + 1, size)
            for horizon in COASTS_S if 0 < (size := round(horizon / step_s)) <= steps // 2}


def _coast(met: Met, fed: Sequence[tuple[DriftModel, tuple[Tone, ...]]], filters: Filtered,
           means: Array, outages: Mapping[int, range], step_s: float) -> None:
    """Add predicted and observed deviations of the mean over horizons without correction."""
    total = np.concatenate((np.zeros((len(fed), 1)), np.cumsum(means, axis=1)), axis=1)
    for size, starts in outages.items():
        predicted, squared, before = met.coasts.get(size * step_s, (0.0, 0.0, 0))
        more = np.zeros((2, len(fed)))
        state, covariance = (np.stack(parts, axis=1) for parts in zip(
            *(filters.before[start] for start in starts), strict=True))
        actual = (total[:, size:][:, starts] - total[:, starts]) / size
        for lane, (model, tones) in enumerate(fed):
            over = space_of(model, tones, size * step_s)
            weight, rest = over.observation[0], over.measurement[0, 0]
            n = len(weight)
            error = actual[lane] - state[lane, :, :n] @ weight
            variance = np.einsum('i,kij,j->k', weight, covariance[lane, :, :n, :n], weight) + rest
            more[:, lane] = variance.sum(), np.square(error).sum()
        met.coasts[size * step_s] = predicted + more[0], squared + more[1], before + len(starts)


def segments(series: Cells, cell: int) -> list[Array]:
    """Split a series of means where the record is interrupted, and fill a few missing ones."""
    whole = series.take(series.counts >= cell / 2)
    if not len(whole):
        return []
    # A step of more than four means is an interruption. Keys of another run are also far away.
    return [filled(part) for part in whole.split(4)]


def _averaged(rows: Array, size: int) -> Array:
    """Return means of `size` neighbours, without the incomplete last one."""
    count = rows.shape[1] // size
    return np.asarray(rows[:, :count * size].reshape(len(rows), count, size).mean(axis=2))


def _fitted(row: Array, step_s: float) -> DriftModel | None:
    if not np.ptp(row) > 0:
        return None
    # Relative to its mean, so that a large one costs no digits.
    section = whole_section((row - row.mean())[None])
    return fit_drift_model(grouped(bins_of([section], step_s), 0), step_s)


@dataclass(frozen=True)
class Outcome:
    """Performance of one filter."""

    # Over means of 1, 10 and 60 s, if the stops are long enough
    innovations: tuple[Innovations, ...]
    coasts: tuple[Coast, ...]    # over 10, 60 and 300 s
    # Where 95 % of the observed deviations should lie, given how much a sensor's drift usually
    # changes, and the number of outages
    bands: tuple[Interval, ...]


@dataclass(frozen=True)
class FieldTest:
    """Numbers of one axis, tested in another recording."""

    tested_s: float    # duration at rest there
    stops: int    # number of parts at rest
    # Of the tuned pair, and of the whole drift model
    tuned: Outcome
    full: Outcome

    @property
    def noise_factor(self) -> tuple[float, Interval]:
        """Return the factor that makes N right over the shortest interval, with its interval."""
        shortest = self.tuned.innovations[0]
        low, high = (sqrt(shortest.nis * shortest.steps / float(of(0.025, shortest.steps)))
                     for of in (chi_square.upper, chi_square.lower))
        return sqrt(shortest.nis), (low, high)

    @property
    def drift_factor(self) -> tuple[float, Interval] | None:
        """Return observed over predicted drift after the longest outage, with its interval."""
        if not self.tuned.coasts:
            return None
        longest, (low, high) = self.tuned.coasts[-1], self.tuned.bands[-1]
        observed = longest.observed_rms
        return observed / longest.predicted_sigma, (observed / high, observed / low)


def field_test(axes: Mapping[str, AxisResult], names: Sequence[str], spectrum: Periodogram,
               dt: float, aiding_interval_s: float = 0.1, coast_s: float = 60.0,
               bias: Bias = 'random_walk') -> dict[str, FieldTest]:
    """
    Run filters with the numbers of axes, which have drift models, over another recording.

    `names`, `spectrum`, `dt`: axes of the other recording, its finished spectrum and sample
    interval. Returns: none if nothing is at rest for 16 means in a row.
    """
    times = 2**max(0, round(log2(INTERVALS_S[0] / (spectrum.cell * dt))))
    cell, series = spectrum.cell * times, coarser(spectrum.series, times)
    whole = segments(series, cell)
    # A constant axis has no noise to compare.
    rows = [i for i, name in enumerate(names)
            if name in axes and any(np.ptp(part[i]) > 0 for part in whole)]
    kept = {names[i]: axes[names[i]] for i in rows}
    parts = [part[rows] for part in whole if part.shape[1] >= SHORTEST]
    if not kept or not parts:
        return {}
    fed = [(model, tones) for axis in kept.values() for model, tones in (
        (_as_model(tune(axis, aiding_interval_s, coast_s, bias)), ()),
        (drift_model_of(axis), axis.tones))]
    # Long parts are split, too, as filters keep much for every step.
    met = filtered(fed, (np.repeat(part[:, at:at + MOST_STEPS], 2, axis=0) for part in parts
                         for at in range(0, part.shape[1], MOST_STEPS)), cell * dt)
    return {name: FieldTest(sum(part.shape[1] for part in parts) * cell * dt, len(parts),
                            _outcome(met, 2 * i, axis), _outcome(met, 2 * i + 1, axis))
            for i, (name, axis) in enumerate(kept.items())}


def _as_model(tuning: FilterTuning) -> DriftModel:
    """Return the drift model that a filter with these numbers assumes."""
    process = () if tuning.sigma is None or tuning.correlation_time_s is None else (
        GaussMarkov(tuning.sigma, tuning.correlation_time_s),)
    return DriftModel(tuning.noise_density, tuning.random_walk or 0.0, process, 0.0, 0.0)


def _outcome(met: Met, lane: int, axis: AxisResult) -> Outcome:
    innovations, coasts = met.of(lane)
    outages = [met.coasts[coast.horizon_s][2] for coast in coasts]
    return Outcome(innovations, coasts, coast_bands(axis, coasts, outages))
