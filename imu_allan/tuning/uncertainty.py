# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of the drift that a recording shows."""

from collections.abc import Mapping, Sequence

from imu_allan.argument_checks import drift_model_of
from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean
from imu_allan.noise.stationarity import SEGMENT_PARTS
from imu_allan.noise.uncertainty import most_below
from imu_allan.result import AxisResult, Coast, DriftModel, GaussMarkov, Interval
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import polygamma

_USUAL = {'angular_velocity': 0.17, 'linear_acceleration': 0.36}
"""
Standard deviation of the logarithm of the drift between two halves of real recordings, for results
without their own. It is half of that of the variance of the mean over 60 s.
"""


def unsteadiness(axis: AxisResult) -> float:
    """
    Return the spread between parts of the logarithm of the drift's standard deviation.

    It is that of the recording's own segments, beyond what the shortness of each explains. Without
    enough segments, it is what is usual for the sensor.
    """
    usual = _USUAL[axis.quantity]
    if axis.stationarity is None:
        return usual
    drift = [(segment.drift_sigma, segment.duration_s) for segment in axis.stationarity.segments
             if segment.drift_sigma is not None and segment.drift_sigma > 0]
    # From two segments the spread is wrong by any factor, and the usual one is closer.
    if len(drift) < 3:
        return usual
    sigma = np.array([level for level, _ in drift])
    # Relative to the drift of the median segment. If a segment shows less, the noise covers its
    # drift, and the logarithm of the remainder has no lower end. One of five with next to no drift
    # was mistaken for great unsteadiness. A segment without any, as many short ones are, says
    # nothing of its size and is left out. With a fifth of the median in its place, short
    # recordings would ask for many times the tuned K.
    shown = np.maximum(sigma, 0.2 * np.median(sigma))
    seen = float(np.var(np.log(shown), ddof=1))
    chance = float(np.mean([_spread_by_chance(axis, duration) for _, duration in drift]))
    return float(np.sqrt(max(seen - chance, 0.0)))


def _spread_by_chance(axis: AxisResult, duration_s: float) -> float:
    """
    Return the variance of the logarithm of the drift that a steady segment shows.

    That drift is the spread of the means of its parts, minus what white noise adds.
    """
    model = drift_model_of(axis)
    part = duration_s / SEGMENT_PARTS
    drift = drift_of_means(model, part, SEGMENT_PARTS)
    whole = _about_mean(drift + np.eye(SEGMENT_PARTS) * model.noise_density**2 / part)
    of_drift = float(np.trace(_about_mean(drift)))
    if of_drift <= 0:
        return np.inf
    total = float(np.trace(whole))
    dof = total**2 / float(np.sum(whole * whole))
    # Half the logarithm of a chi-square variable, the variance of which is a trigamma function.
    return float(polygamma(1, dof / 2)) / 4 * (total / of_drift)**2


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


def _about_mean(covariance: Array) -> Array:
    """Return the covariance after the mean of all parts is removed, of the same shape."""
    centre = np.eye(len(covariance)) - 1 / len(covariance)
    return np.asarray(centre @ covariance @ centre)


def hidden_variance(axis: AxisResult, horizons: Array) -> Array:
    """
    Return what a random walk may add to the variance of the mean beyond the recording.

    This random walk just reaches the level of the model at the longest known horizon, and so could
    have stayed hidden.
    """
    model = drift_model_of(axis)
    level = float(drift_avar(model, axis.tones, model.to_s))
    return np.asarray(level * np.maximum(horizons / model.to_s - 1, 0))


def known_less_than(axes: Mapping[str, AxisResult], time_s: float) -> float | None:
    """Return for how long the axes know their drift if `time_s` exceeds that, else None."""
    known = min((axis.drift_model.to_s for axis in axes.values() if axis.drift_model is not None),
                default=time_s)
    return known if time_s > known * (1 + 1e-6) else None


def _degrees_of_freedom(axis: AxisResult, horizons: Array) -> Array:
    """Return the equivalent degrees of freedom of the variance between means, from the curve."""
    tau, edf = np.array(axis.curve.tau_s), np.array(axis.curve.edf)
    inside = np.exp(np.interp(np.log(horizons), np.log(tau), np.log(edf)))
    # Beyond the curve there are fewer and fewer segments of that length.
    return np.asarray(inside * np.minimum(tau[-1] / horizons, 1))


def spread_of_shortness(axis: AxisResult, horizons: Array) -> Array:
    """Return the spread of a deviation's logarithm in a finite, steady record, shape (n,)."""
    # The limit, for a horizon of thousands of records, keeps its band finite.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 1e-4)
    return np.asarray(np.sqrt(1 / (2 * dof)))


def spread_of_forecast(axis: AxisResult, horizons: Array) -> Array:
    """Return the spread of the logarithm of a predicted standard deviation, shape (n,)."""
    # A recording that is steady in itself says little about another day.
    return np.asarray(np.hypot(spread_of_shortness(axis, horizons),
                               max(unsteadiness(axis), _USUAL[axis.quantity])))


def coast_bands(axis: AxisResult, coasts: Sequence[Coast], outages: ArrayLike
                ) -> tuple[Interval, ...]:
    """Return where 95 % of the deviations observed without correction should lie."""
    horizons = np.array([coast.horizon_s for coast in coasts])
    # The spread of a root mean square of n is sqrt(1 / 2n).
    spread = np.hypot(spread_of_forecast(axis, horizons), np.sqrt(0.5 / np.asarray(outages)))
    return tuple((coast.predicted_sigma / by, coast.predicted_sigma * by) for coast, by in
                 zip(coasts, np.exp(chi_square.NORMAL95 * spread).tolist(), strict=True))


def upper_factors(axis: AxisResult, horizons: Array) -> tuple[Array, Array]:
    """
    Return the factors from an expected variance to its upper 95 % end, by horizon.

    The first is for white noise, which only the finite record makes uncertain, the second for
    drift. Both causes rarely reach their ends at once, so their logarithms add in square.
    """
    # At least half a degree of freedom, as for a horizon as long as the record, keeps intervals
    # finite.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 0.5)
    sampling = np.log(dof / chi_square.lower(0.05, dof))
    # 95 % of a normal distribution lie below 1.645 standard errors.
    drift = np.hypot(sampling, 2 * 1.645 * unsteadiness(axis))
    # White noise is known from the whole band, whatever the horizon.
    best = float(np.max(axis.curve.edf))
    noise = best / float(chi_square.lower(0.05, np.array([best]))[0])
    return np.full(len(horizons), noise), np.asarray(np.exp(drift))


def upper_bound(axis: AxisResult, key: str) -> float | None:
    """
    Return the upper bound of a noise term that is not observable; None if there is none.

    A trend that is removed by the fit and curved like a random walk can take all information about
    the random walk with it. Its bound is then arbitrary. The measured curve, however, contains the
    term as well as the trends.
    """
    bound = axis.coefficients[key].upper95
    highest = np.array(axis.curve.ci95).reshape(-1, 2)[:, 1]
    most = most_below(np.array(axis.curve.tau_s), highest, key, axis.band_limit_s)
    return min(bound, most) or None if bound and most is not None else None
