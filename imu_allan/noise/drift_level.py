# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Level of the drift of the mean within a segment, with its interval.

The spread of the means of a few parts is a quadratic form of correlated Gaussian values. In so
short a time slow drift is almost a slope, whose square is chi-square with little more than one
degree of freedom. White noise has one degree of freedom less than there are parts.

References
----------
F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics
Bulletin 2 (1946).

"""

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.process_means import mean_variance, on_mean
from imu_allan.result import DriftModel, GaussMarkov, Interval
import numpy as np

_TRIED = np.concatenate(([0.0], np.geomspace(1e-4, 1e5, 361)))
"""Variances relative to the observed one, 6 % apart, so that interval ends are exact to 3 %."""


def drift_of_means(model: DriftModel, part_s: float, parts: int) -> Array:
    """
    Return the covariance of the means of consecutive parts, without white noise.

    `part_s`: length of a part in seconds. Returns shape (parts, parts): valid after the mean of
    all parts is removed, since a random walk has no stationary covariance.
    """
    lag = np.abs(np.subtract.outer(np.arange(parts), np.arange(parts)))
    # Within a record, a process with a correlation time of 100 records is a random walk.
    slowest = 100.0 * parts * part_s
    slow = GaussMarkov(model.rate_random_walk * float(np.sqrt(slowest / 2)), slowest)
    covariance = np.zeros(lag.shape)
    for process in (*model.processes, slow):
        time = process.correlation_time_s
        covariance += process.sigma**2 * np.where(
            lag == 0, mean_variance(time, part_s),
            on_mean(time, part_s)**2 * np.exp(-np.maximum(lag - 1, 0) * part_s / time))
    return covariance


def about_mean(covariance: Array) -> Array:
    """Return the covariance after the mean of all parts is removed, of the same shape."""
    centre = np.eye(len(covariance)) - 1 / len(covariance)
    return np.asarray(centre @ covariance @ centre)


def degrees_of_freedom(trace: Array | float, trace_of_square: Array | float) -> Array:
    """
    Return the degrees of freedom of a sum of squares of correlated Gaussian values.

    `trace`, `trace_of_square`, shape (n,): traces of the covariance matrix of the values, and of
    its square. Returns shape (n,): degrees of freedom of the chi-square of equal mean and
    variance (Satterthwaite).
    """
    return np.asarray(np.square(trace) / trace_of_square)


def drift_levels(seen: Array, white: float, shape: Array) -> list[tuple[float, Interval]]:
    """
    Estimate the level of the drift from the spread of the means of the parts of a segment.

    `seen`, shape (segments,): mean square of the means about the mean of the segment. `white`:
    variance of each mean due to white noise. `shape`, shape (parts, parts): covariance of the
    drift up to a factor; if it is zero, that of a random walk is used. Returns: standard deviation
    of the drift, and its 95 % interval. The interval contains all levels under which neither such
    a large nor such a small spread has a probability below 2.5 %.
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
        # Without white noise, a drift of zero is impossible.
        tried = variance * (_TRIED if white > 0 else _TRIED[1:])
        mean = tried + noise
        dof = degrees_of_freedom(parts * mean, tried**2 * square + 2 * tried * white * parts
                                 + white**2 * (parts - 1))
        above = chi_square.survival(dof * variance / mean, dof)
        likely = tried[(above >= 0.025) & (above <= 0.975)]
        level = max(variance - noise, 0.0)
        # If the spread is smaller than white noise alone explains, drift below its scatter is
        # possible.
        low, high = (float(likely[0]), float(likely[-1])) if len(likely) else (
            0.0, chi_square.NORMAL95 * noise * (2 / (parts - 1))**0.5)
        found.append((level**0.5, (min(low, level)**0.5, max(high, level)**0.5)))
    return found
