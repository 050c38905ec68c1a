# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Backtest of the drift model on data not used in its fit: the other half of the same record.

Each half is fitted as if it were the whole recording, and a Kalman filter of that model runs over
the other. Everything comes from the whole-record series, at most 8192 means in equal cells, which
the estimator keeps in any case. That takes constant memory, and no second pass over the file.
Horizons are therefore multiples of a cell, some two seconds for a recording of three hours.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from imu_allan.arrays import Array
from imu_allan.noise.drift_model import fit_drift_model
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.cells import Cells
from imu_allan.noise.record.gaps import filled
from imu_allan.noise.record.groups import grouped
from imu_allan.noise.record.periodogram import whole_section
from imu_allan.result import AxisResult, Backtest, Coast, DriftModel, Innovations, Interval, Tone
from imu_allan.tuning.kalman import Filtered, run_filters
from imu_allan.tuning.state_space import space_of
from imu_allan.tuning.uncertainty import coast_bands
import numpy as np

INTERVALS_S = (1.0, 10.0, 60.0)    # time between corrections
COASTS_S = (10.0, 60.0, 300.0)
"""Times without correction, from some missed satellite fixes to a tunnel. Chosen by judgment, as
are the intervals."""
MOST_STEPS = 4096       # in one half, as every filter step costs time


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
