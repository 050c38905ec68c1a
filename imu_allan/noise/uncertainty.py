# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What makes the coefficients of an axis less certain than their posterior says.

The measured curve bounds what the slow end can hold, and shows where a model leaves it. A sensor
that was turned makes slow terms, and samples that are lost unseen change the noise density.
Recordings of one axis may scatter more than their intervals allow, or have slow noise of another
exponent each.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import exp, inf, log, sqrt

from imu_allan.noise import chi_square
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.curve import interval, Octaves
from imu_allan.noise.fitted_model import FittedModel, with_model_curve
from imu_allan.noise.terms import power_law_avar, SLOW_TERMS, SPECTRAL_TERMS, TERMS
from imu_allan.result import AxisResult, Coefficient, Curve, GoodnessOfFit, Interval, PowerLaw
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CERTAIN = 0.9998
"""Level of the interval that the model has to lie in: 1 point in 5000 is outside by chance."""
_SLIGHT = 0.05
"""Relative distance from that interval that a user does not care about."""
_FEW = 64.0
"""Degrees of freedom up to which a point of the curve belongs to the slow end."""
_CHANCE = 1e-3
"""Probability below which exponents differ by more than chance."""


def as_bound(found: Coefficient, upper95: float | None) -> Coefficient:
    """Return a coefficient that is known by its upper bound alone."""
    return replace(found, observable=False, value=None, ci95=None, upper95=upper95,
                   observable_in_s=None, ci_halves_in_s=None)


def bounded(axis: AxisResult) -> AxisResult:
    """Return an axis whose slow terms are upper bounds: something else may have made them."""
    coefficients = dict(axis.coefficients)
    for key in SLOW_TERMS:
        if (found := coefficients[key]).observable and found.ci95 is not None:
            coefficients[key] = as_bound(found, found.ci95[1])
    return with_model_curve(replace(axis, coefficients=coefficients))


def widened(axis: AxisResult, too_low: float, too_high: float) -> AxisResult:
    """Return an axis whose noise density may be off by such shares, too, beside chance."""
    if not (too_low or too_high):
        return axis
    found = axis.coefficients['noise_density']
    # Beyond, the interval has no upper end that says anything. A judgment.
    most = 1 / (1 - min(too_low, 0.9))
    if found.ci95 is not None:
        low, high = found.ci95
        found = replace(found, ci95=(low / (1 + too_high), high * most))
    if found.upper95 is not None:
        found = replace(found, upper95=found.upper95 * most)
    return replace(axis, coefficients=dict(axis.coefficients) | {'noise_density': found})


def below_curve(found: Coefficient, key: str, curve: Curve, highest: Array,
                window_s: float | None) -> Coefficient:
    """Return a bound that the measured curve allows, as `most_below` has it."""
    most = most_below(np.array(curve.tau_s), highest, key, window_s)
    return found if found.upper95 is None or most is None else replace(
        found, upper95=min(found.upper95, most))


def most_below(tau: Array, highest: Array, key: str, window_s: float | None) -> float | None:
    """
    Return the largest coefficient with which a term is nowhere above the measured curve.

    The measured Allan variance holds every term: none is above the upper end of its interval,
    `highest`, shape of `tau`. A low-pass of the width W takes W/(2 tau) of it, 2 % in deviation
    after 16 widths; before, it says nothing. None where the curve is too short.
    """
    known = tau >= 16.0 * (window_s or 0.0)
    if not known.any():
        return None
    return float(np.min(highest[known] / TERMS[key].adev(1.0, tau[known])))


def leaves_at(points: Octaves, axis: int, curve: Curve, models: Sequence[FittedModel], dt: float
              ) -> float | None:
    """
    Averaging time from which the measured curve lies outside the bands of all models, if it does.

    The residuals of the spectrum do not show it: the slow end has only a few of them. The fast
    end is theirs. A drift model knows little of the fast noise in a short record; only where the
    fitted terms, too, lie outside there is no description.
    """
    dof = np.array(curve.edf)
    low, high = interval(points.avar[:, axis], dof, CERTAIN)
    outside = dof < _FEW
    for model in models:
        adev = np.sqrt(model.allan_variance(points.size, dt))
        outside &= (adev < low * (1 - _SLIGHT)) | (adev > high * (1 + _SLIGHT))
    return float(curve.tau_s[int(np.argmax(outside))]) if outside.any() else None


def widened_interval(found: Coefficient, factor: float = 1.0, variance: float = 0.0
                     ) -> Coefficient:
    """Move the ends of an interval away from its value, in logarithms."""
    assert found.value is not None
    assert found.ci95 is not None
    ends = []
    for sign, bound in zip((-1, 1), found.ci95, strict=True):
        # An interval that begins at 0 cannot begin lower.
        far = abs(log(bound / found.value)) if bound > 0 else inf
        far = sqrt(far**2 + NORMAL95**2 * variance) if variance else factor * far
        ends.append(found.value * exp(sign * far))
    return replace(found, ci95=(ends[0], ends[1]))


def exponents_differ(joint: AxisResult, singles: Sequence[AxisResult]) -> bool:
    """
    Whether the slow noise of an axis does not show one exponent in all recordings.

    `joint`: of all recordings at once. `singles`: of each that has a fit. Returns: where some show
    another exponent than flicker's: whether the joint fit shows none, one of theirs is not that of
    the joint fit, or a recording without one shows flicker or has a curve too low for it.
    Another one is too short to contradict.
    """
    laws = [axis.power_law for axis in singles if axis.power_law is not None]
    if not laws:
        return False
    if joint.power_law is None or any(
            axis.power_law is None and (axis.coefficients['bias_instability'].observable
                                        or _is_below(axis, joint.power_law))
            for axis in singles):
        return True
    q = 0.0
    for law in laws:
        error = (law.exponent_ci95[1] - law.exponent_ci95[0]) / (2 * NORMAL95)
        q += ((law.exponent - joint.power_law.exponent) / error)**2
    return float(chi_square.survival(q, len(laws))) < _CHANCE


def with_own_exponents(joint: AxisResult, singles: Sequence[AxisResult]) -> AxisResult:
    """
    Give an axis what its recordings say one by one.

    `joint`: of all recordings at once, under one exponent. `singles`: of each that has a fit.
    Returns: the noise density is the weighted mean of the single ones; the other terms, and it,
    too, where none shows it, are bounded by the largest of theirs. There is no common fit to be
    good, and no model.
    """
    coefficients = dict(joint.coefficients)
    for key in SPECTRAL_TERMS:
        bounds = [bound for axis in singles
                  if (bound := _most(axis.coefficients[key])) is not None]
        coefficients[key] = as_bound(coefficients[key], max(bounds, default=None))
    if densities := densities_of(singles):
        value, ends = _weighted_mean(densities)
        coefficients['noise_density'] = replace(
            coefficients['noise_density'], observable=True, value=value, ci95=ends, upper95=None)
    return replace(joint, coefficients=coefficients, power_law=None, gauss_markov=None,
                   goodness_of_fit=GoodnessOfFit(None, None, False),
                   curve=replace(joint.curve, model_adev=(0.0,) * len(joint.curve.tau_s)))


def _is_below(axis: AxisResult, law: PowerLaw) -> bool:
    """Whether the curve of an axis is lower than a law by itself, beyond chance."""
    curve = axis.curve
    _, highest = interval(np.array(curve.adev)**2, np.array(curve.edf), 1 - 2 * _CHANCE)
    expected = np.sqrt(power_law_avar(law.amplitude, law.exponent, np.array(curve.tau_s)))
    return bool(np.any(highest < expected))


def densities_of(singles: Iterable[AxisResult]) -> list[tuple[float, float, float]]:
    """Return value and both ends of each noise density that has a lower end."""
    found = [axis.coefficients['noise_density'] for axis in singles]
    return [(one.value, *one.ci95) for one in found
            if one.value is not None and one.ci95 is not None and one.ci95[0] > 0]


def _weighted_mean(densities: Sequence[tuple[float, float, float]]) -> tuple[float, Interval]:
    """
    Return the mean of densities by their logarithms, with its interval.

    What both ends of an interval have is error, and averages out. What one has beyond it is
    uncertainty about the exponent, on the same side in every recording, and does not.
    """
    middles, *ends = np.log(densities).T
    lows, highs = np.abs(ends - middles)
    weights = (lows + highs)**-2
    weights /= weights.sum()
    both = np.minimum(lows, highs)
    half = float(np.sqrt(np.sum((weights * both)**2)))
    middle = float(weights @ middles)
    return exp(middle), (exp(middle - half - float(weights @ (lows - both))),
                         exp(middle + half + float(weights @ (highs - both))))


def _most(found: Coefficient) -> float | None:
    return found.upper95 if found.ci95 is None else found.ci95[1]
