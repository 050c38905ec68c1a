# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The accuracy of means, and uncertainty of coefficients that the posterior does not include.

The measured curve limits the noise at the slow end. A sensor that was rotated shows spurious slow
terms, and undetected sample loss changes the noise density. Recordings of one axis may scatter
more than their intervals allow.
"""

from dataclasses import replace
from math import log, sqrt

from imu_allan.arrays import Array
from imu_allan.block import NEIGHBOURS
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.fitted_model import with_model_curve
from imu_allan.noise.terms import allan_variance, LASTING_TERMS, SLOW_TERMS, TERMS
from imu_allan.result import AxisResult, Coefficient
import numpy as np

CERTAIN = 0.9998
"""Level of the interval that limits the terms: 1 point in 5000 lies outside by chance."""


def bounded(axis: AxisResult) -> AxisResult:
    """Return an axis with its slow terms as upper bounds, as they may have another cause."""
    coefficients = dict(axis.coefficients)
    for key in SLOW_TERMS:
        if (found := coefficients[key]).observable and found.ci95 is not None:
            coefficients[key] = replace(
                found, observable=False, value=None, ci95=None, upper95=found.ci95[1],
                observable_in_s=None, ci_halves_in_s=None)
    return with_model_curve(replace(axis, coefficients=coefficients))


def widened(axis: AxisResult, too_low: float, too_high: float) -> AxisResult:
    """Widen the interval of the noise density of an axis for relative errors besides chance."""
    if not (too_low or too_high):
        return axis
    found = axis.coefficients['noise_density']
    # With a larger error, the upper end would be meaningless. Chosen by judgment.
    most = 1 / (1 - min(too_low, 0.9))
    if found.ci95 is not None:
        low, high = found.ci95
        found = replace(found, ci95=(low / (1 + too_high), high * most))
    if found.upper95 is not None:
        found = replace(found, upper95=found.upper95 * most)
    return replace(axis, coefficients=dict(axis.coefficients) | {'noise_density': found})


def leaked_share(axis: AxisResult, interpolated: float, dt: float) -> float:
    """
    Return by what share lines beside interpolated samples may make the noise density too high.

    `interpolated`: share of the samples. The mean of its neighbours replaces a missing sample;
    what it lacks of a line is noise at random places.
    """
    found, lines = axis.coefficients['noise_density'], axis.tones
    if not interpolated or not lines or found.value is None:
        return 0.0
    turn = 2 * np.pi * (dt * np.array([line.frequency_hz for line in lines]))
    taken = 1 - np.cos(turn[:, None] * np.arange(1, NEIGHBOURS + 1)).mean(axis=1)
    seen = np.maximum(1 - interpolated * taken, 0.1)
    power = float(np.sum((np.array([line.amplitude for line in lines]) * taken / seen)**2)) / 2
    # A quarter more: where many are missing, neighbours are fewer.
    left = 1 - 1.25 * interpolated * power * dt / found.value**2
    # Ten times too high says nothing any more.
    share = max(left, 0.01)**-0.5 - 1
    return float(share) if share > 0.005 else 0.0


def most_below(tau: Array, highest: Array, key: str, window_s: float | None) -> float | None:
    """
    Return the largest coefficient with which a term nowhere exceeds the measured curve.

    The measured Allan variance contains all terms, so none exceeds the upper end of its interval,
    `highest`, of the shape of `tau`. A low-pass of width W removes the share W/(2 tau), 2 % of the
    deviation at 16 W; shorter averaging times are not used. None if the curve is too short.
    """
    known = tau >= 16.0 * (window_s or 0.0)
    if not known.any():
        return None
    return float(np.min(highest[known] / TERMS[key].adev(1.0, tau[known])))


def log_with_error(found: Coefficient) -> tuple[float, float] | None:
    """Return the logarithm of a coefficient, and its standard error; None if it has no value."""
    if found.value is None or found.ci95 is None or found.value <= 0:
        return None
    low, high = found.ci95
    # Of an interval down to zero, only the upper half exists on this scale.
    half = log(high / low) / 2 if low > 0 else log(high / found.value)
    return log(found.value), half / NORMAL95


def widened_interval(found: Coefficient, factor: float) -> Coefficient:
    """Widen an interval by a factor on a log scale; a lower end at 0 stays at 0."""
    assert found.value is not None
    assert found.ci95 is not None
    low, high = ((bound / found.value)**factor * found.value for bound in found.ci95)
    return replace(found, ci95=(low, high))


def value_or_bound(axis: AxisResult, key: str) -> float | None:
    """Return a coefficient or, if it is not observable, its upper bound; None without either."""
    found = axis.coefficients[key]
    return found.value if found.observable else found.upper95


def mean_is_known(axis: AxisResult) -> bool:
    """Return whether the error of the mean is known: not after a high-pass, and not without N."""
    return axis.high_passed_hz is None and axis.coefficients['noise_density'].value is not None


def error_of_mean(axis: AxisResult, duration_s: float, *, at_most: bool = False) -> float:
    """
    Return the standard error of the mean of one axis over a record.

    `axis`: a fitted axis for which `mean_is_known`. Returns: the Allan deviation of the drift
    model at the length of the record. It says how well the mean of one such record predicts that
    of the next. Zero without a record. `at_most`: that of the lasting terms instead, with the
    upper bounds of unobservable ones.
    """
    if duration_s <= 0:
        return 0.0
    # A file may state 5e-324 s, over which the error of a mean is infinite.
    with np.errstate(over='ignore'):
        if axis.drift_model is not None and not at_most:
            return sqrt(float(drift_avar(axis.drift_model, axis.tones, duration_s)))
        sizes = {key: value_or_bound(axis, key) or 0.0 for key in LASTING_TERMS}
        return sqrt(float(allan_variance(sizes, duration_s)))
