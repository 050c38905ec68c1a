# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of the drift that a recording shows."""

from collections.abc import Mapping, Sequence

from imu_allan.argument_checks import drift_model_of
from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.uncertainty import most_below
from imu_allan.result import AxisResult, Coast, Interval
import numpy as np
from numpy.typing import ArrayLike

_UNSTEADINESS = {'angular_velocity': 0.17, 'linear_acceleration': 0.36}
"""
Standard deviation of the logarithm of the drift between two halves of real recordings. It is half
of that of the variance of the mean over 60 s.
"""


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
