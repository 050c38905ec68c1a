# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a recording does not know about the drift that it shows."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from imu_allan.noise import chi_square
from imu_allan.noise.drift_level import about_mean, degrees_of_freedom, drift_of_means
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.stationarity import SEGMENT_PARTS
from imu_allan.noise.uncertainty import most_below
from imu_allan.result import AxisResult, Coast, Interval
from imu_allan.tuning.arguments import drift_model_of
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import polygamma

Array = NDArray[np.float64]

_USUAL = {'angular_velocity': 0.17, 'linear_acceleration': 0.36}
"""
Spread of the logarithm of the drift (a standard deviation) between two halves of real recordings,
where a result does not have its own: half of that of the variance of the mean over 60 s.
"""


def unsteadiness(axis: AxisResult) -> float:
    """
    Return the spread of the logarithm of the drift's standard deviation between parts.

    That of the recording's own segments beyond what the shortness of each makes, or what is usual
    for the sensor where it has none.
    """
    usual = _USUAL[axis.quantity]
    if axis.stationarity is None:
        return usual
    drift = [(segment.drift_sigma, segment.duration_s) for segment in axis.stationarity.segments
             if segment.drift_sigma is not None and segment.drift_sigma > 0]
    # Of two the spread is off by any factor, and the usual one is nearer.
    if len(drift) < 3:
        return usual
    sigma = np.array([level for level, _ in drift])
    # Of the drift in the middle one of the segments. Where one shows less the noise covers its
    # drift, and the logarithm of what is left by chance has no end: one of five that showed next
    # to none passed for great unsteadiness. One that shows none at all, as many short ones do,
    # says nothing of its size and is left out: with a fifth in its place short recordings would
    # ask for many times the tuned K.
    shown = np.maximum(sigma, 0.2 * np.median(sigma))
    seen = float(np.var(np.log(shown), ddof=1))
    chance = float(np.mean([_spread_by_chance(axis, duration) for _, duration in drift]))
    return float(np.sqrt(max(seen - chance, 0.0)))


def _spread_by_chance(axis: AxisResult, duration_s: float) -> float:
    """
    Return the variance of the logarithm of the drift that a steady segment shows.

    That drift is the spread of the means of its parts, less what white noise adds.
    """
    model = drift_model_of(axis)
    part = duration_s / SEGMENT_PARTS
    drift = drift_of_means(model, part, SEGMENT_PARTS)
    whole = about_mean(drift + np.eye(SEGMENT_PARTS) * model.noise_density**2 / part)
    of_drift = float(np.trace(about_mean(drift)))
    if of_drift <= 0:
        return np.inf
    total = float(np.trace(whole))
    dof = float(degrees_of_freedom(total, float(np.sum(whole * whole))))
    # Half the logarithm of a chi-square, whose variance the trigamma function is.
    return float(polygamma(1, dof / 2)) / 4 * (total / of_drift)**2


def hidden_variance(axis: AxisResult, horizons: Array) -> Array:
    """
    Return what a random walk may add to the mean over horizons beyond the recording.

    It is a random walk that just reaches the level of the model at the longest horizon known, and
    so could have stayed hidden.
    """
    model = drift_model_of(axis)
    level = float(drift_avar(model, axis.all_tones, model.to_s))
    return np.asarray(level * np.maximum(horizons / model.to_s - 1, 0))


def known_less_than(axes: Mapping[str, AxisResult], time_s: float) -> float | None:
    """Return how long the axes know their drift, where `time_s` is beyond that, else None."""
    known = min((axis.drift_model.to_s for axis in axes.values() if axis.drift_model is not None),
                default=time_s)
    return known if time_s > known * (1 + 1e-6) else None


def _degrees_of_freedom(axis: AxisResult, horizons: Array) -> Array:
    """Equivalent degrees of freedom of the variance between means, from the curve."""
    curve = axis.curve
    # A result file that was tampered with may hold a curve that none measured.
    known = [(tau, edf) for tau, edf in zip(curve.tau_s, curve.edf, strict=False)
             if tau > 0 and edf > 0]
    if not known:
        return np.ones(len(horizons))
    tau, edf = np.array(known).T
    inside = np.exp(np.interp(np.log(horizons), np.log(tau), np.log(edf)))
    # Beyond the curve there are fewer and fewer segments of such a length.
    return np.asarray(inside * np.minimum(tau[-1] / horizons, 1))


def spread_of_shortness(axis: AxisResult, horizons: Array) -> Array:
    """Return the spread of the logarithm of a deviation that a steady record has, shape (n,)."""
    # Degrees of freedom of a horizon of thousands of records: its band stays a number.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 1e-4)
    return np.asarray(np.sqrt(1 / (2 * dof)))


def widened(factor: float, ends: Interval, axis: AxisResult, coast_s: float) -> Interval:
    """
    Add to the interval of a scaled drift what the shape of the model leaves open.

    The first recording knows that no better than it knows the drift over the longest time without
    correction: the deviation of means over that, about which the noise says nothing. The interval
    may be open on either side.
    """
    model = drift_model_of(axis)
    drift = float(drift_avar(replace(model, noise_density=0.0), (), coast_s)
                  / drift_avar(model, axis.all_tones, coast_s))
    # Of the variance of a mean: one that is less was hidden, and the other recording says more.
    spread = float(spread_of_shortness(axis, np.array([coast_s]))[0]) / max(drift, 0.5)
    by = chi_square.NORMAL95 * spread
    low, high = ends
    if not low > 0:
        # The distance from a factor near zero to its bound is no spread that swallows another.
        return low, high * float(np.exp(by))
    low = factor * float(np.exp(-np.hypot(np.log(factor / low), by)))
    return low, factor * float(np.exp(np.hypot(np.log(high / factor), by)))


def spread_of_forecast(axis: AxisResult, horizons: Array) -> Array:
    """
    Return the spread of the logarithm of a predicted standard deviation, shape (n,).

    A recording that is steady in itself says little of another day: what is usual is the least.
    """
    return np.asarray(np.hypot(spread_of_shortness(axis, horizons),
                               max(unsteadiness(axis), _USUAL[axis.quantity])))


def coast_bands(axis: AxisResult, coasts: Sequence[Coast], outages: ArrayLike
                ) -> tuple[Interval, ...]:
    """
    Return where 95 % of the deviations observed without correction should lie.

    The sensor's own unsteadiness and the number of outages leave that open.
    """
    horizons = np.array([coast.horizon_s for coast in coasts])
    # The spread of a root mean square of n is sqrt(1 / 2n).
    spread = np.hypot(spread_of_forecast(axis, horizons), np.sqrt(0.5 / np.asarray(outages)))
    return tuple((coast.predicted_sigma / by, coast.predicted_sigma * by) for coast, by in
                 zip(coasts, np.exp(chi_square.NORMAL95 * spread).tolist(), strict=True))


def upper_factors(axis: AxisResult, horizons: Array) -> tuple[Array, Array]:
    """
    Return the factors from an expected variance to its upper 95 % end, by horizon.

    For what is white, which only the shortness of the record makes uncertain, and for what drifts.
    Both causes at their ends at once are far rarer: their logarithms add in square.
    """
    # A horizon as long as the record: half a degree of freedom, so that an interval stays finite.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 0.5)
    sampling = np.log(dof / chi_square.lower(0.05, dof))
    drift = np.hypot(sampling, 2 * chi_square.NORMAL90 * unsteadiness(axis))
    # White noise is known from the whole band, whatever the horizon.
    best = float(np.max(axis.curve.edf))
    noise = best / float(chi_square.lower(0.05, np.array([best]))[0])
    return np.full(len(horizons), noise), np.asarray(np.exp(drift))


def upper_bound(axis: AxisResult, key: str) -> float | None:
    """
    Return the upper bound of a noise term that the data does not show; None where there is none.

    A trend that bends as a random walk does, and is taken out of the fit, can take with it all
    that the data says of the random walk; its bound then is any number. But the measured curve
    holds the term, and the trends besides.
    """
    bound = axis.coefficients[key].upper95
    # A result file that was tampered with may hold a curve of which a part is missing.
    curve = [(tau, ends[1]) for tau, ends in zip(axis.curve.tau_s, axis.curve.ci95, strict=False)]
    tau, highest = np.array(curve).reshape(-1, 2).T
    most = most_below(tau, highest, key, axis.band_limit_s)
    return min(bound, most) or None if bound and most is not None else None
