# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The drift model held against data that it was not fitted to: the other half of the same record.

Each half is fitted as if it were the whole recording, and a Kalman filter of that model runs over
the other. All of it comes from the whole-record series, at most 8192 means in equal cells, which
the estimator keeps in any case: constant memory, and no second pass over the file. Horizons are
therefore multiples of a cell, which for a recording of three hours is some two seconds long.
"""

from collections.abc import Sequence

from imu_allan.noise.cells import Cells, RUN_SHIFT
from imu_allan.noise.drift_model import fit_drift_model
from imu_allan.noise.gaps import filled
from imu_allan.noise.likelihood import bins_of, grouped
from imu_allan.noise.periodogram import Piece
from imu_allan.result import Backtest, Coast, DriftModel, Innovations
from imu_allan.tuning.coasting import coasting_weights
from imu_allan.tuning.kalman import Filtered, run_filters
from imu_allan.tuning.state_space import space_of
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

INTERVALS_S = (1.0, 10.0, 60.0)
COASTS_S = (10.0, 60.0, 300.0)
_SHORTEST_S = 600.0     # of a record: half of it has to hold some coasts
_FEWEST_STEPS = 10      # of a filter in one half
_FEWEST_COASTS = 3
"""In each half: of fewer the observed deviation says little of the predicted one."""
_MOST_STEPS = 4096      # in one half: a filter step costs time


def backtest(series: Cells, cell: int, dt: float) -> list[Backtest | None]:
    """
    Fit each half of a record and filter the other.

    Parameters
    ----------
    series : Cells
        Means of the record in equal cells.
    cell : int
        Samples in a cell.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    list of Backtest or None
        One for each axis; None where the record is too short or the axis has no noise.

    """
    axes = series.sums.shape[0]
    rows, cell_s = _longest_run(series, cell), cell * dt
    coarsen = max(1, int(np.ceil(rows.shape[1] / 2 / _MOST_STEPS)),
                  round(INTERVALS_S[0] / cell_s))
    rows, cell_s = _averaged(rows, coarsen), cell_s * coarsen
    half = rows.shape[1] // 2
    if 2 * half * cell_s < _SHORTEST_S:
        return [None] * axes
    found: list[Backtest | None] = [None] * axes
    parts = rows[:, :half], rows[:, half:2 * half]
    models = [[_fitted(row, cell_s) for row in part] for part in parts]
    good = [axis for axis in range(axes) if models[0][axis] and models[1][axis]]
    if not good:
        return found
    # Filters of the first half run over the second, those of the second over the first.
    lanes = [(model, part[axis]) for axis in good for model, part in
             ((models[0][axis], parts[1]), (models[1][axis], parts[0])) if model is not None]
    innovations: list[list[Innovations]] = [[] for _ in good]
    coasts: list[list[Coast]] = [[] for _ in good]
    seen: set[int] = set()
    for interval in INTERVALS_S:
        size = max(1, round(interval / cell_s))
        if size in seen or half // size < _FEWEST_STEPS:
            continue
        seen.add(size)
        step_s = size * cell_s
        means = np.stack([_averaged(row[None], size)[0] for _, row in lanes])
        filters = run_filters([space_of(model, (), step_s) for model, _ in lanes], means)
        for i in range(len(good)):
            innovations[i].append(_scored(filters, slice(2 * i, 2 * i + 2), step_s))
        if len(seen) == 1:
            for i in range(len(good)):
                coasts[i] = _coasted(filters, lanes[2 * i:2 * i + 2], 2 * i, means, step_s)
    for i, axis in enumerate(good):
        if innovations[i]:
            found[axis] = Backtest(half * cell_s, half * cell_s, tuple(innovations[i]),
                                   tuple(coasts[i]))
    return found


def _longest_run(series: Cells, cell: int) -> Array:
    """Means of the longest unbroken run, shape (axes, n), few missing cells filled."""
    whole = series.take(series.counts >= cell / 2)
    if not len(whole):
        return np.zeros((series.sums.shape[0], 0))
    runs, lengths = np.unique(whole.keys >> RUN_SHIFT, return_counts=True)
    part = whole.take((whole.keys >> RUN_SHIFT) == runs[int(np.argmax(lengths))])
    # A long gap ends the run, for a line across it is no data.
    cuts = np.flatnonzero(np.diff(part.keys) > 4) + 1
    stretches = np.split(np.arange(len(part)), cuts)
    longest = max(stretches, key=len)
    return np.asarray(filled(part.take(slice(int(longest[0]), int(longest[-1]) + 1))))


def _averaged(rows: Array, size: int) -> Array:
    """Means of `size` neighbours, the incomplete last one left out."""
    count = rows.shape[1] // size
    return np.asarray(rows[:, :count * size].reshape(len(rows), count, size).mean(axis=2))


def _fitted(row: Array, step_s: float) -> DriftModel | None:
    if not np.ptp(row) > 0:
        return None
    # About their mean, so that a large one costs no digits.
    coefficients = dct(row - row.mean(), norm='ortho')[None]
    piece = Piece(1, len(row), 1, 1, len(row), coefficients**2, coefficients)
    return fit_drift_model(grouped(bins_of([piece], step_s), 0), step_s)


def _scored(filters: Filtered, lanes: slice, step_s: float) -> Innovations:
    """Score both directions; the first step only learns the bias."""
    z = filters.innovation[lanes, 1:] ** 2 / filters.variance[lanes, 1:]
    return Innovations(step_s, float(z.mean()), int(z.size))


def _coasted(filters: Filtered, lanes: Sequence[tuple[DriftModel, Array]], first: int,
             means: Array, step_s: float) -> list[Coast]:
    """Predicted and observed deviation of the mean over horizons without correction."""
    found = []
    for horizon in COASTS_S:
        size = round(horizon / step_s)
        if not size:
            # Means over longer than that: a sensor of a sample in some seconds.
            continue
        starts = np.arange(size, means.shape[1] - size + 1, size)
        if size < 1 or len(starts) < _FEWEST_COASTS:
            continue
        error, claimed = [], []
        for lane, (model, _) in enumerate(lanes, start=first):
            weight, rest = coasting_weights(model, (), size * step_s)
            n = len(weight)
            total = np.concatenate(([0.0], np.cumsum(means[lane] - means[lane, 0])))
            actual = (total[starts + size] - total[starts]) / size + means[lane, 0]
            error.append(actual - filters.state[lane, starts, :n] @ weight)
            claimed.append(np.einsum('i,kij,j->k', weight,
                                     filters.covariance[lane, starts, :n, :n], weight) + rest)
        found.append(Coast(size * step_s, float(np.sqrt(np.mean(claimed))),
                           float(np.sqrt(np.mean(np.square(error))))))
    return found
