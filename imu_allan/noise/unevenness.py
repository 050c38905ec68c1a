# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk wanders evenly over the record, and how much less is known where it does not.

The likelihood takes a walk for the sum of countless small steps. Real sensors also jump a few
times, or settle over the first hour; the spectrum is the same, its error is not. What the
likelihood learns of the walk is the power of a series: the record, filtered by the root of what
the walk gives to each frequency over what all the noise gives. That power is looked at over time.

References
----------
P. J. Huber, Proc. Fifth Berkeley Symp. 1 (1967): the variance of an estimate whose model does not
hold is that of its score.

"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.noise.chi_square import equal_variances, NORMAL95
from imu_allan.noise.correlated import process_column
from imu_allan.noise.groups import WALK
from imu_allan.noise.trends import JointSpectrum, RecordSpectrum, regressors
from imu_allan.noise.trial import Trial
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct
from scipy.special import stdtrit

Array = NDArray[np.float64]

_BATCHES = (8, 16, 32)
"""Into how many the time is cut: jumps show in short batches, a sensor that settles in long."""
_FEWEST_DOF = 3.0
"""Of a batch, on average: the logarithm of fewer varies more than Bartlett's correction knows."""
_CHANCE = 0.05
"""Of even walks, at most so many are called uneven over all numbers of batches."""
_LEAST_SHARE = 1e-6
"""Of the power of a mean batch: one that is empty has no logarithm."""


def uneven_by(trial: Trial, spectrum: RecordSpectrum | JointSpectrum,
              correlation_time_s: float | None = None) -> float:
    """
    Tell by how much the likelihood ratios of the random walk are too large.

    Parameters
    ----------
    trial : Trial
        A fit with a walk.
    spectrum : RecordSpectrum or JointSpectrum
        That it was fitted to.
    correlation_time_s : float, optional
        Of the Gauss-Markov process that is the last column of the fit.

    Returns
    -------
    float
        1 where batches of time vary in power as they should, over all records, else how much more
        the sum of them varies, and more again for knowing that from a few batches.

    Examples
    --------
    A walk that goes on evenly, and one that makes all its way in two steps:

    >>> from imu_allan.noise.estimator import Estimator
    >>> from imu_allan.noise.bins import bins_of
    >>> from imu_allan.noise.trial import fit_band
    >>> def widening(steps):
    ...     estimator = Estimator()
    ...     noise = np.random.default_rng(1).standard_normal(8192)
    ...     estimator.update(noise + np.cumsum(steps))
    ...     pieces = estimator.finished().periodogram.pieces()
    ...     record = RecordSpectrum(pieces, bins_of(pieces, 1.0), 0, 1.0)
    ...     return uneven_by(fit_band(record.groups(), None), record)
    >>> widening(np.random.default_rng(2).normal(0.0, 0.1, 8192))
    1.0
    >>> jumps = np.zeros(8192)
    >>> jumps[[2000, 5000]] = 6.0, -6.0
    >>> widening(jumps) > 3
    True

    """
    if trial.solution.trend is None or trial.solution.theta[WALK] <= 0:
        return 1.0
    series = [part for record, trend in zip(
        spectrum.records, np.atleast_2d(trial.solution.trend), strict=True)
        for part in _series(record, *_matched(trial, record, trend, correlation_time_s))]
    most = 1.0
    for count in _BATCHES if series else ():
        power, expected, variance = _batches(series, count)
        if len(power) < 3:
            continue
        dof = 2 * expected**2 / variance
        ratio = power / expected
        if dof.mean() < _FEWEST_DOF or equal_variances(
                ratio[:, None], dof[:, None], _LEAST_SHARE) >= _CHANCE / len(_BATCHES):
            continue
        most = max(most, _widening(ratio, dof))
    return most


@dataclass(frozen=True)
class _Series:
    """Sums of the squares of a series up to each point, expected ones, and its covariance."""

    duration: int
    power: Array
    expected: Array
    covariance: Array


def _matched(trial: Trial, record: RecordSpectrum, trend: Array,
             correlation_time_s: float | None) -> tuple[Array, Array]:
    """Coefficients of the series whose power tells the walk, and their expected squares."""
    bins = record.bins
    here = bins.whole & (bins.index > 0)
    if record.keep is not None:
        here = here & record.keep
    theta = trial.solution.theta[:bins.design.shape[1]].copy()
    if trial.rolling:
        # The roll-off takes the place of the first column, and is nothing at the slow end.
        theta[0] = 0.0
    noise = bins.design @ theta
    if correlation_time_s is not None:
        noise = noise + trial.solution.theta[-1] * process_column(bins, record.dt,
                                                                  correlation_time_s)
    columns = -np.sqrt(np.maximum(bins.ramp, 0))[:, None]
    if record.courses:
        columns = np.column_stack((columns, regressors(record.pieces, record.dt, record.courses)))
    rest = bins.coefficient[record.axis] - columns @ trend
    noise = np.maximum(noise, 1e-300)
    gain = np.where(here, np.sqrt(bins.design[:, WALK]) / noise, 0.0)
    # The mean power is that of the fit; what follows is about how it is spread over time.
    return gain * rest, gain**2 * noise


def _series(record: RecordSpectrum, value: Array, weight: Array) -> list[_Series]:
    """Turn coefficients back into series of time, one for each unbroken part of the record."""
    found = []
    for number, piece in enumerate(record.pieces):
        if piece.coefficients is None:
            continue
        part = record.bins.piece == number
        index = record.bins.index[part]
        signal, squares = np.zeros(piece.length), np.zeros(piece.length + 1)
        signal[index], squares[index] = value[part], weight[part]
        if not squares.any():
            continue
        power, expected = (np.concatenate(([0.0], np.cumsum(of))) for of in (
            idct(signal, norm='ortho')**2, _variance_over_time(squares)))
        # Type I of the squares: the covariance of the series far from its ends.
        found.append(_Series(piece.length * piece.step, power, expected,
                             dct(squares, type=1) / (2 * piece.length)))
    return found


def _batches(series: Sequence[_Series], count: int) -> tuple[Array, Array, Array]:
    """Cut time into about so many batches: their power, its expectation and its variance."""
    whole = sum(part.duration for part in series)
    power, expected, variance = [], [], []
    for part in series:
        cuts = max(round(count * part.duration / whole), 1)
        ends = np.linspace(0, len(part.power) - 1, cuts + 1).round().astype(np.int64)
        size = round((len(part.power) - 1) / cuts)
        lag = np.arange(size)
        pairs = np.where(lag == 0, 1, 2) * (size - lag)
        mean = np.maximum(np.diff(part.expected[ends]), 1e-300)
        alike = 2 * float(pairs @ part.covariance[:size]**2)
        # At the ends the cosines add up: the same correlation of a larger variance.
        larger = mean / max(size * float(part.covariance[0]), 1e-300)
        power.append(np.diff(part.power[ends]))
        expected.append(mean)
        variance.append(np.maximum(larger**2 * alike, 1e-300))
    return np.concatenate(power), np.concatenate(expected), np.concatenate(variance)


def _variance_over_time(squares: Array) -> Array:
    """Variance at every point of a series whose cosine coefficients have the given variances."""
    length = len(squares) - 1
    double = np.zeros(length)
    index = np.arange(1, length)
    # cos(2 x) of a line is the line of twice its index, which folds back at the end.
    low, high = index[2 * index < length], index[2 * index > length]
    double[2 * low] += squares[low]
    double[2 * length - 2 * high] -= squares[high]
    double /= 2
    double[0] = squares[1:].sum()
    return np.asarray(dct(double, type=3) / length)


def _widening(ratio: Array, dof: Array) -> float:
    """How much more the mean of the batches varies than it should, and for knowing it so badly."""
    about = ratio / ratio.mean() - 1
    count = len(ratio)
    more = float(about @ about) / (count - 1) / float(np.mean(2 / dof))
    kurtosis = count * float(np.sum(about**4)) / float(about @ about)**2
    # Degrees of freedom of a variance: as many as batches where they are normal, few where
    # one or two make all of it.
    known = max(2 * count / max(kurtosis - 1, 1e-9), 2.0)
    student = float(stdtrit(min(known, count - 1.0), 0.975)) / NORMAL95
    return max(more, 1.0) * student**2
