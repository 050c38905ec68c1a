# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Several recordings of one axis whose slow noise goes with another exponent in each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import exp

from imu_allan.finding import Finding, finding
from imu_allan.noise import chi_square
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.curve import interval
from imu_allan.noise.terms import power_law_avar
from imu_allan.result import (
    AxisResult,
    Coefficient,
    GoodnessOfFit,
    Interval,
    PowerLaw,
)
import numpy as np

_CHANCE = 1e-3
"""Probability below which exponents differ by more than chance."""
_BOUNDED = ('quantization_noise', 'noise_density', 'bias_instability', 'rate_random_walk')
OF_THE_COMMON_FIT = ('power_law', 'gauss_markov', 'band_limited')
"""Codes of remarks that a fit of one exponent to all recordings makes."""


def exponents_differ(joint: AxisResult, singles: Sequence[AxisResult]) -> bool:
    """
    Whether the slow noise of an axis does not show one exponent in all recordings.

    `joint`: of all recordings at once. `singles`: of each that has a fit. Returns: where some tell
    another exponent than flicker's: whether the joint fit tells none, one of theirs is not that of
    the joint fit, or a recording that tells none shows flicker or has a curve too low for it.
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
    for key in _BOUNDED:
        bounds = [bound for axis in singles
                  if (bound := _most(axis.coefficients[key])) is not None]
        coefficients[key] = replace(
            coefficients[key], observable=False, value=None, ci95=None,
            upper95=max(bounds, default=None), observable_in_s=None, ci_halves_in_s=None)
    if densities := _densities(singles):
        value, ends = _weighted_mean(densities)
        coefficients['noise_density'] = replace(
            coefficients['noise_density'], observable=True, value=value, ci95=ends, upper95=None)
    return replace(joint, coefficients=coefficients, power_law=None, gauss_markov=None,
                   goodness_of_fit=GoodnessOfFit(None, None, False),
                   curve=replace(joint.curve, model_adev=(0.0,) * len(joint.curve.tau_s)))


def remark_on_exponents(singles: Mapping[str, AxisResult]) -> Finding:
    """
    Say what the slow noise of an axis is in each recording.

    `singles`: of each recording that has a fit.
    """
    return finding('power_law', recordings=list(singles), exponents=[
        None if axis.power_law is None else axis.power_law.exponent for axis in singles.values()],
        density_is_mean=bool(_densities(singles.values())))


def _is_below(axis: AxisResult, law: PowerLaw) -> bool:
    """Whether the curve of an axis is lower than a law by itself, beyond chance."""
    curve = axis.curve
    _, highest = interval(np.array(curve.adev)**2, np.array(curve.edf), 1 - 2 * _CHANCE)
    expected = np.sqrt(power_law_avar(law.amplitude, law.exponent, np.array(curve.tau_s)))
    return bool(np.any(highest < expected))


def _densities(singles: Iterable[AxisResult]) -> list[tuple[float, float, float]]:
    """Return value and both ends of each noise density that has a lower end."""
    found = [axis.coefficients['noise_density'] for axis in singles]
    return [(one.value, *one.ci95) for one in found
            if one.value is not None and one.ci95 is not None and one.ci95[0] > 0]


def _weighted_mean(densities: Sequence[tuple[float, float, float]]) -> tuple[float, Interval]:
    """
    Return the mean of densities by their logarithms, with its interval.

    What both ends of an interval have is error, and averages out. What one has beyond it is doubt
    about the exponent, on the same side in every recording, and does not.
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
