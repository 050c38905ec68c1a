# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Several recordings of one axis whose slow noise goes with another exponent in each."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp

from imu_allan.noise import chi_square
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.random_effects import q_statistic
from imu_allan.result import AxisResult, Coefficient, GoodnessOfFit, Remark
import numpy as np

_CHANCE = 1e-3
"""Probability below which exponents differ by more than chance."""
_BOUNDED = ('quantization_noise', 'bias_instability', 'rate_random_walk')
OF_THE_COMMON_FIT = ('power_law', 'gauss_markov', 'band_limited')
"""Codes of remarks that a fit of one exponent to all recordings makes."""


def exponents_differ(joint: AxisResult, singles: Sequence[AxisResult]) -> bool:
    """
    Whether the slow noise of an axis is not told to have one exponent in all recordings.

    Parameters
    ----------
    joint : AxisResult
        Of all recordings at once.
    singles : sequence of AxisResult
        Of each that has a fit.

    Returns
    -------
    bool
        False where every recording may have flicker, or all tell another exponent, which is one.

    """
    laws = [axis.power_law for axis in singles if axis.power_law is not None]
    if len(laws) < len(singles) or joint.power_law is None:
        return bool(laws)
    if len(laws) < 2:
        return False
    errors = [(law.exponent_ci95[1] - law.exponent_ci95[0]) / (2 * NORMAL95) for law in laws]
    q = q_statistic([law.exponent for law in laws], errors)
    return float(chi_square.survival(q, len(laws) - 1)) < _CHANCE


def with_own_exponents(joint: AxisResult, singles: Sequence[AxisResult],
                       logarithms: Mapping[str, float], errors: Mapping[str, float]
                       ) -> AxisResult:
    """
    Give an axis what its recordings say one by one.

    Parameters
    ----------
    joint : AxisResult
        Of all recordings at once, under one exponent.
    singles : sequence of AxisResult
        Of each that has a fit.
    logarithms, errors : mapping of path to float
        Logarithm of the noise density of each that shows it, and its error.

    Returns
    -------
    AxisResult
        The noise density is the weighted mean of the single ones; what the slow noise bears on is
        bounded by the largest of them. There is no common fit to be good.

    """
    coefficients = dict(joint.coefficients)
    for key in _BOUNDED:
        bounds = [bound for axis in singles
                  if (bound := _most(axis.coefficients[key])) is not None]
        coefficients[key] = replace(
            coefficients[key], observable=False, value=None, ci95=None,
            upper95=max(bounds, default=None), observable_in_s=None, ci_halves_in_s=None)
    if logarithms:
        weights = np.array([errors[path]**-2 for path in logarithms])
        middle = float(np.average(list(logarithms.values()), weights=weights))
        half = NORMAL95 / float(np.sqrt(weights.sum()))
        coefficients['noise_density'] = replace(
            coefficients['noise_density'], observable=True, value=exp(middle),
            ci95=(exp(middle - half), exp(middle + half)), upper95=None)
    return replace(joint, coefficients=coefficients, power_law=None, gauss_markov=None,
                   goodness_of_fit=GoodnessOfFit(None, None, False))


def remark_on_exponents(singles: Mapping[str, AxisResult]) -> Remark:
    """
    Say what the slow noise of an axis is in each recording.

    Parameters
    ----------
    singles : mapping of path to AxisResult
        Of each recording that has a fit.

    Returns
    -------
    Remark

    """
    said = ', '.join(
        f'{"flicker or none" if axis.power_law is None else _law(axis.power_law.exponent)} in '
        f'{path}' for path, axis in singles.items())
    return Remark(
        'power_law', f'the slow noise is not told to be the same in all recordings ({said}); the '
        'noise density is the mean of the single results, the other terms are bounded by the '
        'largest of theirs; analyze the recordings without --together for a result of each')


def _law(exponent: float) -> str:
    return f'1/f to the power of {exponent:.2f}'


def _most(found: Coefficient) -> float | None:
    return found.upper95 if found.ci95 is None else found.ci95[1]
