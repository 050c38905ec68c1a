# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Forecast of unaided drift: heading, velocity and position after a time without correction.

The bias was averaged over some time before and subtracted. The drift model then gives the exact
variance of what remains: of the mean over the outage about the mean before it, and for a position
of the double integral. The intervals cover what the recording does not know: how well a few
independent segments of that length give a variance, and how much the drift changes between parts.
The same uncertainty widens tuned numbers, and the bands of tests on other data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.errors import positive_time
from imu_allan.noise import chi_square
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean
from imu_allan.noise.terms import line_power, Quantity
from imu_allan.result import AxisResult, Coast, DriftModel, Interval
from imu_allan.tuning.state_space import drift_model_of
import numpy as np
from numpy.typing import ArrayLike

FORECAST_S = (1.0, 10.0, 60.0, 600.0, 3600.0)
"""From the interval of satellite fixes to an hour without any, as many as fit into 80 columns."""
VAGUE = 10.0
"""If a bound of a forecast differs from the value by more than this factor, it is not given."""
_UNSTEADINESS = {'angular_velocity': 0.17, 'linear_acceleration': 0.36}
"""Standard deviation of the logarithm of the drift between two halves of real recordings. It is
half of that of the variance of the mean over 60 s."""


@dataclass(frozen=True)
class DriftForecast:
    """
    Standard deviations after times without correction; every tuple has one entry for each.

    Attributes
    ----------
    horizons_s : tuple of float
    calibration_s : float
        Time over which the bias was averaged before.
    integral : tuple of float
        Of the angle (gyroscope, rad) or the velocity (accelerometer, m/s).
    integral_ci95 : tuple of (float, float)
        Where the standard deviation of a segment like those of the recording lies, with 95 %.
    position : tuple of float or None
        Of the position (m); None for a gyroscope.
    position_ci95 : tuple of (float, float) or None
    known_to_s : float
        Longest time, of an outage or of a calibration, that the recording covers. Beyond it the
        values are widened by a random walk that it could not have shown.

    """

    horizons_s: tuple[float, ...]
    calibration_s: float
    integral: tuple[float, ...]
    integral_ci95: tuple[Interval, ...]
    position: tuple[float, ...] | None
    position_ci95: tuple[Interval, ...] | None
    known_to_s: float


def predicted_drift(axis: AxisResult,
                    horizons_s: float | Sequence[float] = (1.0, 10.0, 60.0, 600.0),
                    calibration_s: float = 60.0) -> DriftForecast:
    """
    Predict the error of integrating an axis without correction: (9) of docs/statistics.md.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result, with a drift model.
    horizons_s : float or sequence of float, optional
        Times without correction, in seconds.
    calibration_s : float, optional
        Time over which the bias was averaged at rest just before.

    Returns
    -------
    DriftForecast

    Raises
    ------
    ImuAllanError
        If the axis has no drift model or a time is not positive.

    Examples
    --------
    White noise alone: an angle random walk, and as much again from the calibration.

    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3}, 720_000, 100.0)
    >>> axis = imu_allan.characterize(rates, 100.0)
    >>> forecast = imu_allan.predicted_drift(axis, [10.0], calibration_s=10.0)
    >>> round(forecast.integral[0] / (1e-3 * 20 ** 0.5), 1)
    1.0

    """
    model = drift_model_of(axis)
    h = np.array([positive_time('horizons_s', one)
                  for one in np.atleast_1d(np.asarray(horizons_s, object))])
    c = positive_time('calibration_s', calibration_s)
    wide = np.exp(chi_square.NORMAL95 * spread_of_forecast(axis, np.maximum(h, c)))
    beyond = hidden_variance(axis, h) + hidden_variance(axis, np.array([c]))
    angle = h * np.sqrt(_mean_about_mean(axis, model, h, c) + beyond)
    position, band = None, None
    if Quantity(axis.quantity) is Quantity.LINEAR_ACCELERATION:
        metres = np.sqrt(_position(axis, model, h, c) + beyond * h**4 / 4)
        position, band = tuple(metres.tolist()), _pairs(metres, wide)
    return DriftForecast(tuple(h.tolist()), c, tuple(angle.tolist()), _pairs(angle, wide),
                         position, band, model.to_s)


def _pairs(sigma: Array, wide: Array) -> tuple[Interval, ...]:
    return tuple(zip((sigma / wide).tolist(), (sigma * wide).tolist(), strict=True))


def _mean_about_mean(axis: AxisResult, model: DriftModel, h: Array, c: float) -> Array:
    """Return the variance of the mean over h about the mean over c just before."""
    total = (model.noise_density**2 * (1 / h + 1 / c) + model.rate_random_walk**2 * (h + c) / 3
             + line_power(axis.tones, h) + line_power(axis.tones, c))
    for process in model.processes:
        time = process.correlation_time_s
        total = total + process.sigma**2 * (
            mean_variance(time, h) + mean_variance(time, c)
            - 2 * on_mean(time, h) * on_mean(time, c))
    return np.asarray(total)


def _position(axis: AxisResult, model: DriftModel, h: Array, c: float) -> Array:
    """Return the variance of the double integral over h about its value from the mean over c."""
    lever = h**2 / 2
    total = (model.noise_density**2 * (h**3 / 3 + lever**2 / c)
             + model.rate_random_walk**2 * (h**5 / 20 + lever**2 * c / 3)
             + lever**2 * line_power(axis.tones, c))
    for process in model.processes:
        time = process.correlation_time_s
        # Weight of the state at the beginning in the double integral.
        start = time * h - time**2 * -np.expm1(-h / time)
        total = total + process.sigma**2 * (
            _double_integral(time, h) + lever**2 * mean_variance(time, c)
            - 2 * lever * start * on_mean(time, c))
    for tone in axis.tones:
        w = 2j * np.pi * tone.frequency_hz
        total = total + tone.amplitude**2 / 2 * np.abs(np.expm1(w * h) / w**2 - h / w) ** 2
    return np.asarray(total)


def _double_integral(time: float, h: Array) -> Array:
    """Return the variance of the double integral over h of a process of unit variance."""
    x = h / time
    exact = 2 * time**4 * (x**3 / 3 - x**2 / 2 - np.expm1(-x) - x * np.exp(-x))
    # At 0.05 the series errs by 1e-8; at a quarter of it, the formula errs by 1e-9 (cancellation).
    return np.where(x < 0.05, h**4 / 4 * (1 - 4 * x / 15 + x**2 / 18 - x**3 / 105), exact)


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


def spread_of_forecast(axis: AxisResult, horizons: Array) -> Array:
    """Return the spread of the logarithm of a predicted standard deviation, shape (n,)."""
    # The limit, for a horizon of thousands of records, keeps its band finite.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 1e-4)
    return np.asarray(np.hypot(np.sqrt(1 / (2 * dof)), _UNSTEADINESS[axis.quantity]))


def coast_bands(axis: AxisResult, coasts: Sequence[Coast], outages: ArrayLike
                ) -> tuple[Interval, ...]:
    """Return where 95 % of the deviations observed without correction should lie."""
    horizons = np.array([coast.horizon_s for coast in coasts])
    # The spread of a root mean square of n is sqrt(1 / 2n).
    spread = np.hypot(spread_of_forecast(axis, horizons), np.sqrt(0.5 / np.asarray(outages)))
    return tuple((coast.predicted_sigma / by, coast.predicted_sigma * by) for coast, by in
                 zip(coasts, np.exp(chi_square.NORMAL95 * spread).tolist(), strict=True))


def upper_of_white(axis: AxisResult) -> float:
    """Return the factor from the variance of white noise to its upper 95 % end."""
    # It is known from the whole band, whatever the horizon.
    best = float(np.max(axis.curve.edf))
    return best / float(chi_square.lower(0.05, best))


def upper_of_drift(axis: AxisResult, horizons: Array) -> Array:
    """Return the factors from an expected variance of drift to its upper 95 % end, by horizon."""
    # The record is finite, and drift changes. Both causes rarely reach their ends at once, so
    # their logarithms add in square.
    # At least half a degree of freedom, as for a horizon as long as the record, keeps intervals
    # finite.
    dof = np.maximum(_degrees_of_freedom(axis, horizons), 0.5)
    sampling = np.log(dof / chi_square.lower(0.05, dof))
    # 95 % of a normal distribution lie below 1.645 standard errors.
    return np.asarray(np.exp(np.hypot(sampling, 2 * 1.645 * _UNSTEADINESS[axis.quantity])))
