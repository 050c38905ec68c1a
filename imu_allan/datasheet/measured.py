# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Measured values of all quantities that a datasheet may limit, including noise coefficients."""

from dataclasses import dataclass
from math import hypot, sqrt

from imu_allan.characterization.accuracy_of_mean import error_of_mean, mean_is_known
from imu_allan.finding_messages import sentence_of
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.terms import TERMS
from imu_allan.result import AxisResult, Interval, Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.wording import duration

DEAD = 1e-3
"""Share of the noise density limit below which an axis is dead. No sensor is a thousand times
better than its datasheet, while rounding in a driver makes a stuck value vary by that little."""
_FILTERED = 'a filter has taken out the slow part of this axis; record the raw topic'


@dataclass(frozen=True)
class Measured:
    """
    The measured value of one quantity.

    Attributes
    ----------
    value : float or None
        Magnitude in the SI unit of the limit.
    ci95 : (float, float) or None
        95 % interval of the magnitude.
    upper95 : float or None
        95 % upper bound if there is no value.
    undecided : str or None
        Why value and bound are unreliable, or why there is none.

    """

    value: float | None = None
    ci95: Interval | None = None
    upper95: float | None = None
    undecided: str | None = None


def fault_of(axis: AxisResult | None, density_limit: float | None) -> str | None:
    """Return a sentence on why an axis does not measure properly, or None."""
    if axis is None:
        return 'the axis is missing: the result does not hold it'
    if axis.constant:
        return f'the axis is constant: every sample is {axis.mean:.6g} {axis.unit}'
    if (span := axis.stood_still) is not None:
        return (f'the axis is dead for {duration(span.duration_s)} from '
                f'{duration(span.start_s)} on: it gives one value all that time')
    if axis.saturated is not None:
        return (f'the axis is saturated: {100 * axis.saturated.share:.1f} % of the samples stand '
                f'at {axis.saturated.value:.6g} {axis.unit}, noise is higher than it seems')
    if axis.deadband is not None:
        return (f'the axis has a deadband: {100 * axis.deadband.share:.0f} % of the samples are '
                'exactly 0, noise is higher than it seems')
    # Fewer than 1 in 200 samples then differs, so a thousand in a row may be equal.
    if (ratio := _steps_of_noise(axis)) > 15.0:
        return (f'the axis is all but constant: its output steps by {axis.coarse_step:.3g} '
                f'{axis.unit}, {ratio:.0f} times the noise of one sample')
    density = axis.coefficients['noise_density']
    highest = density.ci95[1] if density.ci95 is not None else density.upper95
    if density_limit and highest is not None and highest < DEAD * density_limit:
        return (f'the axis is dead: its noise density is {highest:.2g} {density.unit} at most, '
                'less than a thousandth of the limit')
    return None


def stopped(result: Result) -> str | None:
    """Return a sentence if the whole sensor gave no new samples for a part of the recording."""
    return next((f'the sensor was dead for a part of the recording: {sentence_of(remark)}'
                 for remark in result.warnings if remark.code == 'frozen'), None)


def coefficient(axis: AxisResult, key: str) -> Measured:
    """Return a coefficient, for a ramp its magnitude."""
    found, fit = axis.coefficients[key], axis.goodness_of_fit
    undecided = (
        _FILTERED if axis.high_passed_hz is not None else
        'the noise model does not fit this axis'
        if not fit.acceptable and fit.p_value is not None else
        'not observable in this recording; record for longer'
        if not found.observable and found.upper95 is None else None)
    value = None if found.value is None else abs(found.value)
    interval = None if not found.observable or found.ci95 is None else _magnitude(found.ci95)
    return Measured(value, interval, found.upper95, undecided)


def zero_bias(result: Result, name: str, expected: float) -> Measured:
    """Return the distance of the mean from `expected`, the largest of several recordings."""
    axis = result.axes[name]
    if axis.mean is None:
        return Measured(undecided='there is no mean')
    if (undecided := _undecided_mean(axis)) is not None:
        return Measured(undecided=undecided)
    starts = [(part.means[name], error_of_mean(axis, part.duration_s))
              for part in result.recordings if name in part.means]
    if not starts:
        # The result of a node may be of several starts: the error includes how they differ.
        spread = result.turn_on_bias.get(name)
        starts = [(axis.mean, hypot(error_of_mean(axis, result.timeline.rest_s),
                                    0.0 if spread is None else spread.sigma))]
    distance, error = max(((mean - expected, error) for mean, error in starts),
                          key=lambda start: abs(start[0]))
    half = NORMAL95 * error
    return Measured(abs(distance), _magnitude((distance - half, distance + half)))


def of_limit(result: Result, axis: str, key: str, specification: NoiseModel) -> Measured:
    """Return the measured value of one limited quantity."""
    found = result.axes[axis]
    if key in TERMS:
        hidden = hidden_by_steps(found, key, abs(specification.axes[axis][key]))
        return coefficient(found, key) if hidden is None else Measured(undecided=hidden)
    if key == 'zero_bias':
        return zero_bias(result, axis, specification.mean.get(axis, 0.0))
    if found.high_passed_hz is not None:
        return Measured(undecided=_FILTERED)
    if key == 'turn_on_bias':
        # Spread of the mean from one power-on to the next.
        spread = result.turn_on_bias.get(axis)
        if spread is not None:
            return Measured(spread.sigma, spread.ci95)
        return Measured(undecided='one power-on does not show it; analyze several recordings '
                                  'with --together')
    if found.trend is not None and (trend := found.trend.temperature) is not None:
        return Measured(abs(trend.per_kelvin), _magnitude(trend.ci95))
    return Measured(undecided='the result knows no dependence on temperature; record the '
                              'temperature while it changes')


def _undecided_mean(axis: AxisResult) -> str | None:
    if mean_is_known(axis):
        return None
    if axis.high_passed_hz is not None:
        return _FILTERED
    if axis.saturated is not None:
        return 'the axis is saturated, and its mean with it; choose a larger range'
    if axis.deadband is not None:
        return 'the axis has a deadband, and its mean is not known; switch the deadband off'
    return ('the noise density does not show, and with it what the mean is worth; record for '
            'longer')


def _magnitude(interval: Interval) -> Interval:
    low, high = sorted(map(abs, interval))
    return 0.0 if interval[0] < 0 < interval[1] else low, high


# If the noise is at least half a step q, rounding adds white noise of q / sqrt(12). The total is
# then little more than the true noise. Smaller noise stays within a step or jumps between two,
# whatever its size. Truncation towards zero, as by a cast to an integer, gives a cell of two steps
# around zero, which hides twice as much.


def hidden_by_steps(axis: AxisResult, key: str, limit: float) -> str | None:
    """Return why the steps of the output are too coarse to test a limit (SI), or None."""
    ratio = _steps_of_noise(axis)
    # Within two steps of zero, the mean of a truncated axis is inside the cell of double width.
    near_zero = axis.mean is not None and abs(axis.mean) < 2.0 * (axis.coarse_step or 0)
    # Up to two steps per noise of a sample, rounding attenuates a slow trend by at most 6 %.
    if key not in TERMS or not ratio or (ratio <= 2.0 and not near_zero):
        return None
    step = axis.coarse_step or 0.0
    if key == 'noise_density':
        a_step = step * sqrt(axis.curve.tau_s[0])
        interval = axis.coefficients[key].ci95
        # Truncated noise above sqrt(2) steps still scatters by more than a step. A mean midway
        # between two steps turns even tiny noise into half a step.
        if limit >= sqrt(2.0) * a_step or (
                interval is not None and interval[0]**2 - (0.5 * a_step)**2 > limit**2):
            return None
    return (f'the output steps by {step:.3g} {axis.unit}, {ratio:.1f} times the noise of one '
            'sample, and hides what is limited; record with a finer resolution')


def _steps_of_noise(axis: AxisResult) -> float:
    """Return the output step divided by the noise of a sample; 0 if the step is not coarse."""
    noise = axis.curve.adev[0] if axis.curve.adev else 0.0
    return axis.coarse_step / noise if axis.coarse_step is not None and noise > 0 else 0.0
