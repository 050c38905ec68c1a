# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How much the mean drifts within a segment, with its interval.

The spread of the means of a few parts is a quadratic form of correlated Gaussian values. Slow
drift is all but a slope in so short a time, and its square a chi-square of hardly more than one
degree of freedom; white noise has as many as there are parts, less one.

References
----------
F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics
Bulletin 2 (1946).

"""

from imu_allan.noise import chi_square
from imu_allan.noise.process_means import mean_variance, on_mean
from imu_allan.result import DriftModel, GaussMarkov, Interval
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TRIED = np.concatenate(([0.0], np.geomspace(1e-4, 1e5, 361)))
"""Levels in units of the variance seen: 6 % apart, so that an end is known to 3 %."""
_OUTSIDE = 0.025
"""On either side of an interval of 95 %."""


def drift_of_means(model: DriftModel, part_s: float, parts: int) -> Array:
    """
    Return the covariance of the means of neighbouring parts, without white noise.

    `part_s`: length of a part in seconds. Returns shape (parts, parts): right for what is left
    after the mean of all is taken off: a random walk has no other covariance.
    """
    lag = np.abs(np.subtract.outer(np.arange(parts), np.arange(parts)))
    # A process whose correlation time is a hundred records is a random walk within one.
    slowest = 100.0 * parts * part_s
    walk = GaussMarkov(model.rate_random_walk * float(np.sqrt(slowest / 2)), slowest)
    covariance = np.zeros(lag.shape)
    for process in (*model.processes, walk):
        time = process.correlation_time_s
        covariance += process.sigma**2 * np.where(
            lag == 0, mean_variance(time, part_s),
            on_mean(time, part_s)**2 * np.exp(-np.maximum(lag - 1, 0) * part_s / time))
    return covariance


def about_mean(covariance: Array) -> Array:
    """Return the covariance of what is left when the mean of all is taken off, same shape."""
    centre = np.eye(len(covariance)) - 1 / len(covariance)
    return np.asarray(centre @ covariance @ centre)


def degrees_of_freedom(trace: Array | float, trace_of_square: Array | float) -> Array:
    """
    Return the degrees of freedom of a sum of squares of correlated Gaussian values.

    `trace`, `trace_of_square`, shape (n,): of the covariance of the values, and of its matrix
    product with itself. Returns shape (n,): those of the chi-square of the same mean and variance,
    by Satterthwaite.
    """
    return np.asarray(np.square(trace) / trace_of_square)


def drift_levels(seen: Array, white: float, shape: Array) -> list[tuple[float, Interval]]:
    """
    Estimate the level of the drift from the spread of the means of the parts of a segment.

    `seen`, shape (segments,): mean square of the means about the mean of the segment. `white`:
    variance that white noise gives each mean. `shape`, shape (parts, parts): covariance of the
    drift, to any scale; a random walk's where it is zero. Returns: standard deviation of the
    drift, and its 95 % interval: all levels that make neither so small nor so large a spread less
    likely than 1 in 40.
    """
    parts = len(shape)
    drift = about_mean(shape)
    if not np.trace(drift) > 0:
        drift = about_mean(np.minimum.outer(np.arange(parts), np.arange(parts)))
    drift = drift * (parts / np.trace(drift))
    square, noise = float(np.sum(drift * drift)), white * (parts - 1) / parts
    found: list[tuple[float, Interval]] = []
    for variance in seen.tolist():
        if not variance > 0:
            found.append((0.0, (0.0, 0.0)))
            continue
        # Without noise of its own a mean has no level of zero.
        tried = variance * (_TRIED if white > 0 else _TRIED[1:])
        mean = tried + noise
        dof = degrees_of_freedom(parts * mean, tried**2 * square + 2 * tried * white * parts
                                 + white**2 * (parts - 1))
        above = chi_square.survival(dof * variance / mean, dof)
        likely = tried[(above >= _OUTSIDE) & (above <= 1 - _OUTSIDE)]
        level = max(variance - noise, 0.0)
        # Less spread than white noise alone makes says nothing of a drift below its scatter.
        low, high = (float(likely[0]), float(likely[-1])) if len(likely) else (
            0.0, chi_square.NORMAL95 * noise * (2 / (parts - 1))**0.5)
        found.append((level**0.5, (min(low, level)**0.5, max(high, level)**0.5)))
    return found
