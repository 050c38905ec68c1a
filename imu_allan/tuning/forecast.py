# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Forecast of unaided drift: heading, velocity and position after a time without correction.

The bias was averaged over some time before and subtracted. The drift model then gives the exact
variance of what remains: of the mean over the outage about the mean before it, and for a position
of the double integral. The intervals cover what the recording does not know: how well a few
independent segments of that length give a variance, and how much the drift changes between parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.argument_checks import drift_model_of, positive_time
from imu_allan.arrays import Array
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean
from imu_allan.noise.terms import line_power, Quantity
from imu_allan.result import AxisResult, DriftModel, Interval
from imu_allan.tuning.uncertainty import hidden_variance, spread_of_forecast
import numpy as np

FORECAST_S = (1.0, 10.0, 60.0, 600.0, 3600.0)
"""From the interval of satellite fixes to an hour without any, as many as fit into 80 columns."""
VAGUE = 10.0
"""If a bound of a forecast differs from the value by more than this factor, it is not given."""


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


def predicted_drift(axis: AxisResult, horizons_s: Sequence[float] = (1.0, 10.0, 60.0, 600.0),
                    calibration_s: float = 60.0) -> DriftForecast:
    """
    Predict the error of integrating an axis without correction: (9) of docs/statistics.md.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result, with a drift model.
    horizons_s : sequence of float, optional
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
    h = np.array([positive_time('horizons_s', one) for one in horizons_s])
    c = positive_time('calibration_s', calibration_s)
    wide = np.exp(NORMAL95 * spread_of_forecast(axis, np.maximum(h, c)))
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
