# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a sensor keeps the limits of its datasheet: measured values, and verdicts on them.

A specification gives an upper limit for a quantity. The measured 95 % interval decides, not the
value. If the interval, or the upper bound of an unobservable term, is below the limit, the
quantity passes. If the interval is above the limit, it fails; otherwise this recording cannot
tell. An axis that measures nothing fails all its limits. A check of a unit on
the test bench ends as soon as the verdict is certain (`check_state`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, sqrt
from typing import Literal

from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.errors import ImuAllanError, printable
from imu_allan.finding_messages import FAULTS, of_axis, sentence_of
from imu_allan.noise.axis_fit import AxisFit
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.sequential import decide, Decision, SMALLEST_RECORD
from imu_allan.noise.terms import AXES, LASTING_TERMS, Quantity, TERMS
from imu_allan.noise.uncertainty import error_of_mean, mean_is_known
from imu_allan.result import AxisResult, Interval, Result
from imu_allan.sensor.noise_model import LIMITS, NoiseModel
from imu_allan.sensor.units import STANDARD_GRAVITY
from imu_allan.wording import duration

DEAD = 1e-3
"""Share of the noise density limit below which an axis is dead. No sensor is a thousand times
better than its datasheet, while rounding in a driver makes a stuck value vary by that little."""
GROWTH = 1.15
"""Growth of the record between looks; on average half of it is recorded in vain."""
_UNRELIABLE = {'several_publishers', 'implausible', 'interpolated'}
"""Codes of findings by which N may be wrong by any factor: another sensor, or another unit."""
MARGIN = 0.1
"""A unit whose value is nearer to its limit, by this share, is called neither good nor bad."""

Outcome = Literal['pass', 'fail', 'cannot tell']


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
    remedy : str
        What makes the interval narrower.

    """

    value: float | None = None
    ci95: Interval | None = None
    upper95: float | None = None
    undecided: str | None = None
    remedy: str = 'record for longer'


def fault_of(result: Result, name: str, density_limit: float | None) -> str | None:
    """Return a sentence on why an axis does not measure properly, or None."""
    for found in result.warnings:
        if found.code == 'frozen':
            return f'the sensor was dead for a part of the recording: {sentence_of(found)}'
    axis = result.axes.get(name)
    if axis is None:
        return 'the axis is missing: the result does not hold it'
    if axis.fault is not None:
        # A file may hold the fault without the finding.
        why = ''.join(f': {sentence_of(of_axis(found, name))}' for found in result.warnings
                      if found.code == FAULTS[axis.fault] and name in found.axes)
        return f'the axis is {axis.fault}{why}'
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


def unreliable(result: Result, axis: str) -> str | None:
    """Return a sentence if the noise of an axis may not be what it is taken for."""
    for remark in result.warnings:
        if (remark.code in _UNRELIABLE and axis in (remark.axes or [axis])
                and axis.startswith(str(remark.values.get('half', '')))):
            return sentence_of(remark)
    return None


def hidden(result: Result, axis: str, key: str, limit: float) -> str | None:
    """Return why no record shows whether a noise term keeps its limit (SI), or None."""
    if key not in TERMS or axis not in result.axes:
        return None
    return unreliable(result, axis) or _hidden_by_steps(result.axes[axis], key, limit)


def coefficient(axis: AxisResult, key: str) -> Measured:
    """Return a coefficient, for a ramp its magnitude."""
    found, fit = axis.coefficients[key], axis.goodness_of_fit
    undecided = (None if fit.acceptable or fit.p_value is None else
                 'the noise model does not fit this axis')
    value = None if found.value is None else abs(found.value)
    interval = None if not found.observable or found.ci95 is None else _magnitude(found.ci95)
    return Measured(value, interval, found.upper95, undecided)


def zero_bias(result: Result, name: str, expected: float) -> Measured:
    """Return the distance of the mean from `expected`, the largest of several recordings."""
    axis = result.axes[name]
    if axis.mean is None or not mean_is_known(axis):
        return Measured(undecided='the noise density does not show, and with it what the mean is '
                                  'worth; record for longer')
    starts = [(part.means[name], error_of_mean(axis, part.duration_s))
              for part in result.recordings if name in part.means]
    if not starts:
        # The result of a node may be of several starts: the error includes how they differ.
        spread = result.turn_on_bias.get(name)
        starts = [(axis.mean, hypot(error_of_mean(axis, result.rest_of(name)),
                                    0.0 if spread is None else spread.sigma))]
    distance, error = max(((mean - expected, error) for mean, error in starts),
                          key=lambda start: abs(start[0]))
    half = NORMAL95 * error
    return Measured(abs(distance), _magnitude((distance - half, distance + half)))


def of_limit(result: Result, axis: str, key: str, specification: NoiseModel) -> Measured:
    """Return the measured value of one limited quantity."""
    found = result.axes[axis]
    if found.high_passed_hz is not None:
        return Measured(undecided='a filter has taken out the slow part of this axis; record the '
                                  'raw topic')
    if key in TERMS:
        why = hidden(result, axis, key, abs(specification.axes[axis][key]))
        return coefficient(found, key) if why is None else Measured(undecided=why)
    if key == 'zero_bias':
        return zero_bias(result, axis, specification.mean.get(axis, 0.0))
    if key == 'turn_on_bias':
        # Spread of the mean from one power-on to the next.
        spread = result.turn_on_bias.get(axis)
        if spread is not None:
            return Measured(spread.sigma, spread.ci95, remedy='record more power-ons')
        return Measured(undecided='one power-on does not show it; analyze several recordings '
                                  'with --together')
    if found.trend is not None and (trend := found.trend.temperature) is not None:
        return Measured(abs(trend.per_kelvin), _magnitude(trend.ci95))
    recorded = result.temperature.mean if result.temperature is not None else ()
    if known := [celsius for celsius in recorded if celsius is not None]:
        return Measured(undecided=f'from {min(known):.1f} to {max(known):.1f} degrees Celsius no '
                        'dependence shows; change it by more')
    return Measured(undecided='the result knows no dependence on temperature; record the '
                              'temperature while it changes')


def _magnitude(interval: Interval) -> Interval:
    low, high = sorted(map(abs, interval))
    return 0.0 if interval[0] < 0 < interval[1] else low, high


# If the noise is at least half a step q, rounding adds white noise of q / sqrt(12). The total is
# then little more than the true noise. Smaller noise stays within a step or jumps between two,
# whatever its size. Truncation towards zero, as by a cast to an integer, gives a cell of two steps
# around zero, which hides twice as much.


def _hidden_by_steps(axis: AxisResult, key: str, limit: float) -> str | None:
    """Return why the steps of the output are too coarse to test a limit (SI), or None."""
    ratio = _steps_of_noise(axis)
    # Within two steps of zero, the mean of a truncated axis is inside the cell of double width.
    near_zero = axis.mean is not None and abs(axis.mean) < 2.0 * (axis.coarse_step or 0)
    # Up to two steps per noise of a sample, rounding attenuates a slow trend by at most 6 %.
    if not ratio or (ratio <= 2.0 and not near_zero):
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


@dataclass(frozen=True)
class Verdict:
    """
    One quantity of one axis compared with its limit.

    Attributes
    ----------
    axis, key, symbol, unit : str
        The quantity, and the SI unit of `limit`, `value`, `ci95` and `upper95`.
    limit : float
        The largest value that the specification allows.
    specified : str
        The limit as written in the file.
    value, ci95, upper95 : optional
        Measured magnitudes; None as in the result.
    ratio : float or None
        `value` divided by `limit`.
    verdict : 'pass', 'fail' or 'cannot tell'
    reason : str
        Reason in one sentence.

    """

    axis: str
    key: str
    symbol: str
    unit: str
    limit: float
    specified: str
    value: float | None
    ci95: tuple[float, float] | None
    upper95: float | None
    ratio: float | None
    verdict: Outcome
    reason: str

    def judged(self, verdict: Outcome, why: str) -> 'Verdict':
        """Return the comparison with another outcome, and why it has that."""
        return replace(self, verdict=verdict, reason=f'{self.axis} {self.symbol}: {why}')


def check(result: Result, specification: NoiseModel, *, shortest_s: float = 0.0) -> list[Verdict]:
    """Compare a result with a specification; nothing passes that is shorter than `shortest_s`."""
    verdicts = [_verdict(result, specification, axis, key, limit)
                for axis, key, limit in _limits(specification)]
    if not verdicts:
        raise ImuAllanError('the specification limits no coefficient; write for instance '
                            'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    return [one.judged('cannot tell', f'{duration(recorded)} of data, and no less than '
                       f'{duration(shortest_s)} may pass')
            if one.verdict == 'pass' and (recorded := result.rest_of(one.axis)) < shortest_s
            else one for one in verdicts]


def overall(verdicts: Sequence[Verdict]) -> Outcome:
    """Return 'fail' if any quantity fails, else 'cannot tell' if any is undecided, else 'pass'."""
    outcomes = {verdict.verdict for verdict in verdicts}
    return 'fail' if 'fail' in outcomes else 'cannot tell' if 'cannot tell' in outcomes else 'pass'


def _limits(specification: NoiseModel) -> Iterator[tuple[str, str, float]]:
    """Yield axis, key and limit, in order."""
    for axis in AXES:
        terms, others = specification.axes.get(axis, {}), specification.limits.get(axis, {})
        yield from ((axis, key, abs(terms[key])) for key in TERMS if key in terms)
        yield from ((axis, key, others[key]) for key in LIMITS if key in others)


def _verdict(result: Result, specification: NoiseModel, axis: str, key: str, limit: float
             ) -> Verdict:
    quantity = AXES[axis]
    symbol = TERMS[key].symbol if key in TERMS else key.replace('_', ' ').replace(
        'turn on', 'turn-on')
    unit = TERMS[key].unit(quantity) if key in TERMS else quantity.unit + LIMITS[key]
    written = specification.as_written.get(axis, {}).get(key) or f'{limit!r} {unit}'
    fault = fault_of(result, axis, specification.axes.get(axis, {}).get('noise_density'))
    measured = Measured() if fault is not None else of_limit(result, axis, key, specification)
    outcome, reason = _decide(measured, limit, printable(written), fault)
    value = measured.value
    if (key == 'zero_bias' and outcome == 'fail' and quantity is Quantity.LINEAR_ACCELERATION
            and axis not in specification.mean and (value or 0.0) > STANDARD_GRAVITY / 2):
        reason += f'; if that is gravity, write accel: {{{axis[-1]}: {{mean: 1 g}}}}'
    # With a limit close to zero, the ratio would overflow.
    ratio = None if value is None or limit <= 0 or value > limit * 1e300 else value / limit
    return Verdict(axis, key, symbol, unit, limit, written, value, measured.ci95, measured.upper95,
                   ratio, outcome, f'{axis} {symbol}: {reason}')


def _decide(measured: Measured, limit: float, shown: str, fault: str | None
            ) -> tuple[Outcome, str]:
    if fault is not None:
        return 'fail', fault
    if measured.undecided is not None:
        return 'cannot tell', measured.undecided
    if measured.ci95 is None:
        if measured.upper95 is not None and measured.upper95 <= limit:
            return 'pass', f'not observable, and with 95 % confidence below {shown}'
        return 'cannot tell', 'not observable in this recording; record for longer'
    low, high = measured.ci95
    if high <= limit:
        return 'pass', f'the 95 % interval is below {shown}'
    if low > limit:
        return 'fail', f'the 95 % interval is above {shown}'
    return 'cannot tell', f'the 95 % interval reaches across {shown}; {measured.remedy}'


@dataclass(frozen=True)
class CheckState:
    """
    State of a check.

    Attributes
    ----------
    decided : bool
        Whether the verdicts are final.
    verdicts : tuple of Verdict
        The current verdicts; open ones are 'cannot tell'.
    recorded_s : float
        Length of the record in seconds.

    """

    decided: bool
    verdicts: tuple[Verdict, ...]
    recorded_s: float


def check_state(result: Result, records: Sequence[FinishedRecord | None],
                specification: NoiseModel, *, shortest_s: float = 0.0) -> CheckState:
    """
    Compare a unit with its datasheet while it is recorded, each time `next_look` says so.

    `records`: the data of its result, of gyroscope and accelerometer apart if they have topics of
    their own.
    """
    verdicts = check(result, specification, shortest_s=shortest_s)
    known = [record for record in records
             if record is not None and record.samples >= SMALLEST_RECORD]
    if len(known) < len(records):
        return CheckState(False, tuple(map(_open, verdicts)), result.timeline.duration_s)
    recorded = min((record.samples / record.rate_hz for record in known), default=inf)
    tested = ('quantization_noise', *LASTING_TERMS)   # keys of the sequential test
    limited = sum(verdict.key in tested for verdict in verdicts)
    # The test applies to the terms of the sensor, not to what a high-pass filter leaves of them.
    raw = {name: fit for record in known for name, fit in record.fits.items()
           if name in result.axes and result.axes[name].high_passed_hz is None}
    settled = []
    for verdict in verdicts:
        # A longer record would not show it either.
        lasting = hidden(result, verdict.axis, verdict.key, verdict.limit) is not None
        settled.append(
            _settled(verdict, raw.get(verdict.axis), max(limited, 1), recorded)
            if verdict.key in tested and not lasting
            else (verdict, lasting or verdict.verdict != 'cannot tell'))
    found = [verdict for verdict, _ in settled]
    if recorded < shortest_s:
        found = [_open(verdict) if verdict.verdict == 'pass' else verdict for verdict in found]
        return CheckState(overall(found) == 'fail', tuple(found), recorded)
    if overall(found) == 'fail':
        # One failure decides. Other limits may be exceeded as well, but need more data to show it.
        why = 'left open, as the unit fails already'
        found = [verdict if done else _open(verdict, why) for verdict, done in settled]
        return CheckState(True, tuple(found), recorded)
    return CheckState(all(done for _, done in settled), tuple(found), recorded)


def _settled(verdict: Verdict, fitted: AxisFit | None, limited: int, recorded_s: float
             ) -> tuple[Verdict, bool]:
    """Apply the sequential test to one coefficient; return the verdict and whether it is final."""
    if fitted is None or (verdict.verdict == 'fail' and verdict.value is None):
        # A missing, constant or dead axis has already failed.
        return verdict, verdict.verdict == 'fail'
    if fitted.fit.power_law is not None and verdict.key == 'bias_instability':
        # Without flicker there is nothing to test but the curve.
        return verdict, verdict.verdict != 'cannot tell'
    if not fitted.fit.acceptable or verdict.limit <= 0:
        return _open(verdict), False
    # A good unit may fail at any of its limits by chance, so these share the error. A bad unit
    # passes only if its bad term passes.
    decision = decide(fitted.fit.estimates[verdict.key], verdict.limit, margin=MARGIN,
                      pass_error=0.05, fail_error=0.05 / limited)
    if decision == 'open':
        return _open(verdict), False
    after = f'after {duration(recorded_s)}'
    said: dict[Decision, tuple[Outcome, str]] = {
        'below': ('pass', f'below {verdict.specified}, certain {after}'),
        'above': ('fail', f'above {verdict.specified}, certain {after}'),
        'near': ('cannot tell', f'within {100 * MARGIN:.0f} % of {verdict.specified} {after}')}
    return verdict.judged(*said[decision]), True


def _open(verdict: Verdict, why: str = 'not certain enough to stop; record for longer') -> Verdict:
    faulty = verdict.verdict == 'fail' and verdict.value is None
    return verdict if faulty else verdict.judged('cannot tell', why)


def next_look(samples: int) -> int:
    """Return the number of samples at which to look again."""
    return max(SMALLEST_RECORD, round(samples * GROWTH))
