# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What was found in the words that users read, in one module as they are read together."""

from collections.abc import Collection, Mapping, Sequence
from math import ceil, exp, inf, isfinite, isinf, log

from imu_allan.characterization.thermometer import COVERED, Temperature
from imu_allan.noise.axis_fit import SHORTEST_RECORD
from imu_allan.noise.bias_step import BiasStep
from imu_allan.noise.fit import Fit
from imu_allan.noise.saturation import CutOff
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.temperature import Dependence
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, Quantity, TERMS
from imu_allan.noise.warm_up import Warming
from imu_allan.result import AxisResult, Deadband, Remark, Segment, Span
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import about, duration, listed, named
import numpy as np
from scipy.special import fdtri

MEAN_MOVES = {'warm_up', 'slow_cycle', 'trend_or_walk', 'bias_step'}
"""Codes of the findings about a mean that moves."""


_COARSE = 1 / 8
"""Share of the range that a step of the thermometer may be: the mean then follows it in jumps."""
_FACTOR = 2.0
"""From which on an error is no percentage."""
_HEATED_S = 30.0
"""Period from which on a slow cycle may be one of temperature."""
_HALVES_CHANCE = 1.35e-3
"""Of a difference of the halves as large by chance, either way: 3 standard errors. A judgment."""
_HALVES_STEPS = 25
"""Innovations of a half: of fewer their model knows less than they do, and alarms are false."""
_AGREES = 2.0
"""Standard errors from what its sensor's axes say together, within which it holds for an axis."""
_LEAST_CHANGE = log(1.3)
"""Of a variance: 14 % in deviation, of which no user of a filter needs to know."""
_STEP_SHARE = 0.7
"""Share of the spread between segments from which it is told as one step."""


def constant_remark(value: float, quantity: Quantity) -> Remark:
    """Say that an axis never changes."""
    return Remark('constant_axis', f'every sample is {value:g} {quantity.unit}: '
                  'there is no noise to measure')


def still_remark(span: Span) -> Remark:
    """Say that an axis gave one value for a while."""
    return Remark('stood_still',
                  f'one and the same value for {duration(span.duration_s)} from '
                  f'{duration(span.start_s)} on: the sensor or its driver stood still; no '
                  'coefficient is told, analyze the rest with --start and --duration')


def saturated_remark(end: CutOff, quantity: Quantity) -> Remark:
    """Say that the output ends where the noise does not."""
    return Remark('saturated',
                  f'{100 * end.share:.1f} % of the samples stand at {end.value:.6g} '
                  f'{quantity.unit}, the {"highest" if end.is_highest else "lowest"} value: the '
                  'output is cut off there, noise is higher than it seems; no coefficient is '
                  'told, choose a larger range or another position')


def deadband_remark(found: Deadband, quantity: Quantity) -> Remark:
    """Say that small values are given as zero."""
    return Remark('deadband',
                  f'{100 * found.share:.0f} % of the samples are exactly 0, and none lies between '
                  f'0 and {found.width:.3g} {quantity.unit}: the driver gives small values as 0 '
                  '(a deadband), noise is higher than it seems; no coefficient is told, switch '
                  'the deadband off')


def copy_remark(one: str, other: str, sign: int) -> Remark:
    """Say that two axes are one; the only finding of an axis that names it itself."""
    return Remark('copied_axis',
                  f'{one} and {other} are the same, {"but for the sign, " if sign < 0 else ""}to '
                  'the last digit of every sample: the driver gives one axis of the sensor twice, '
                  'and another not at all; correct its assignment of axes')


def high_pass_remark(corner_hz: float) -> Remark:
    """Say that a filter has taken out what is slow."""
    return Remark('high_passed',
                  f'below about {corner_hz:.2g} Hz the noise falls away, which no sensor does: a '
                  'filter has subtracted a bias that it estimates, as imu_complementary_filter '
                  'does (or a broad vibration covers the noise); no coefficient is told, take the '
                  'raw topic')


def perhaps_high_passed_remark(corner_hz: float) -> Remark:
    """Say that a filter may have taken out what is slow."""
    return Remark('perhaps_high_passed',
                  f'below about {corner_hz:.2g} Hz the noise may fall away, as behind a filter '
                  'that subtracts a bias it estimates, or is small by chance: bias instability '
                  'and rate random walk are as uncertain as such a filter would make them; record '
                  'for longer, or take the raw topic if there is one')


def step_remarks(step: float, noise: float, quantity: Quantity) -> list[Remark]:
    """Say where the output steps by more than the noise of one sample; `step` may be infinite."""
    if not noise < step < inf or noise <= 0:
        return []
    return [Remark('coarse_resolution',
                   f'the output steps by {step:.3g} {quantity.unit}, {step / noise:.1f} times '
                   'the noise of one sample: what lies below the step is hidden')]


def fit_remarks(fitted: Fit, quantity: Quantity) -> list[Remark]:
    """Say what the fit of an axis found beside coefficients."""
    remarks = []
    if fitted.window_s is not None and fitted.edge_hz is not None:
        remarks.append(Remark(
            'band_limited',
            f'the spectrum is bent above {fitted.edge_hz:.3g} Hz (a low-pass in sensor or driver, '
            'or noise that no term describes); the coefficients are fitted below'))
    elif fitted.window_s is not None:
        remarks.append(Remark(
            'band_limited',
            'the noise rolls off towards the highest frequencies (a low-pass in sensor or '
            f'driver): its effective window is {fitted.window_s:.3g} s'))
    if fitted.plateau is not None and fitted.edge_hz is not None:
        density = fitted.estimates['noise_density']
        remarks.append(Remark(
            'poor_fit',
            f'above {fitted.edge_hz:.3g} Hz the noise levels out again, at '
            f'{100 * fitted.plateau / density.value:.0f} % of its density below: that is no '
            'low-pass, and no sum of noise terms describes it (a short correlation, or what '
            'strong vibration leaves around its lines); the noise density is that below, its '
            'interval reaches to that above'))
    elif not fitted.acceptable:
        remarks.append(Remark(
            'poor_fit',
            'no sum of noise terms describes this spectrum (worst half-octave off by '
            f'{100 * fitted.misfit:.0f} %); the intervals are widened accordingly'))
    if (law := fitted.power_law) is not None:
        remarks.append(Remark(
            'power_law',
            f'the slow noise is no flicker: its density goes with 1/f to the power of '
            f'{law.exponent:.2f} (95 % interval {law.ci95[0]:.2f} to {law.ci95[1]:.2f}), not of '
            '1; the noise density is that of the white noise beside it, and the bias instability '
            'an upper bound from the lowest point of the curve; for a filter take the tuned '
            'numbers, N and K alone leave this noise out'))
    if fitted.gauss_markov:
        sigma, time = fitted.gauss_markov.sigma, fitted.gauss_markov.correlation_time_s
        remarks.append(Remark(
            'gauss_markov',
            f'a first-order Gauss-Markov process of {sigma:.3g} {quantity.unit} with a '
            f'correlation time of {time:.3g} s is part of the noise'))
    return [*remarks, *_temperature_remarks(fitted, quantity),
            *_mean_remarks(fitted, quantity)]


def bias_step_remark(step: BiasStep, dt: float, quantity: Quantity) -> Remark:
    """Say that the mean steps once."""
    return Remark('bias_step',
                  f'the mean steps by {step.size:.3g} {quantity.unit} after about '
                  f'{about(step.place * dt)}, and nowhere else (a knock, or another supply '
                  'voltage or setting): the rate random walk is given as an upper bound; analyze '
                  'what lies before or behind it with --start and --duration')


def leaving_remark(tau_s: float) -> Remark:
    """Say that the model does not follow the curve at its long end."""
    return Remark('poor_fit', f'from averaging times of {duration(tau_s)} on the measured curve '
                  'leaves the band of the model: no sum of noise terms describes it there')


def steadiness_remarks(steady: Steadiness, segments: Sequence[Segment]) -> list[Remark]:
    """Say in which band the noise changes most, by how much and when."""
    if steady.steady or not steady.changes:
        return []
    change = steady.changes[0]
    where = ('' if change.low_hz <= 0 and isinf(change.high_hz)
             else f' below {change.high_hz:g} Hz' if change.low_hz <= 0
             else f' above {change.low_hz:g} Hz' if isinf(change.high_hz)
             else f' between {change.low_hz:g} and {change.high_hz:g} Hz')
    level = change.amplitude
    # The split into a beginning and an end that explains most of the spread.
    count = len(level)
    gain, cut = max((cut * (count - cut) * (level[:cut].mean() - level[cut:].mean())**2, cut)
                    for cut in range(1, count))
    total = count * float(((level - level.mean())**2).sum())
    if gain > _STEP_SHARE * total:
        ratio = float(level[:cut].mean() / level[cut:].mean()) - 1
        until = duration(segments[cut].start_s) if cut < len(segments) else ''
        words = (f'the noise{where} is {100 * abs(ratio):.0f} % '
                 f'{"higher" if ratio > 0 else "lower"} in the first {until} than after')
    else:
        words = (f'the noise{where} changes by {100 * change.spread:.0f} % (standard deviation) '
                 f'between parts of {duration(segments[0].duration_s)}')
    return [Remark('not_steady', f'{words}; the intervals are widened accordingly')]


def halves_remarks(axes: Mapping[str, AxisResult]) -> dict[str, Remark]:
    """
    Say by how much one half of the record drifts more than the other, by axis.

    What changes one axis of a sensor, its temperature first of all, changes the others: where no
    axis alone is certain they may be together.
    """
    changes = {name: change for name, axis in axes.items()
               if (change := _change_of_halves(axis)) is not None}
    told = {}
    for name, change in changes.items():
        claims = [change]
        # Only what was asked over the same time tells of one another.
        sensor = [other for beside, other in changes.items()
                  if beside.split('_')[0] == name.split('_')[0] and other[2] == change[2]]
        ratio, steps, interval = np.mean(sensor, axis=0)
        if abs(change[0] - ratio) <= _AGREES * 2 / change[1]**0.5:
            claims.append((ratio, steps * len(sensor), interval))
        for log_ratio, known, over in claims:
            if abs(log_ratio) > max(_by_chance(known), _LEAST_CHANGE):
                told[name] = _halves_remark(log_ratio, over, axes[name])
                break
    return told


def _halves_remark(log_ratio: float, interval_s: float, axis: AxisResult) -> Remark:
    more, less = ('first', 'second') if log_ratio > 0 else ('second', 'first')
    each = duration(axis.backtest.tested_s) if axis.backtest is not None else ''
    return Remark('not_steady', f'over {duration(interval_s)} the {more} half drifts '
                  f'{exp(abs(log_ratio) / 2):.1f} times as much as the {less} ({each} each, of '
                  'the longest stretch without a break); numbers for a filter are between the '
                  'two, and no interval is widened for it')


def _change_of_halves(axis: AxisResult) -> tuple[float, float, float] | None:
    """Logarithm of the ratio of the halves' drift in variance, innovations of each, their time."""
    if axis.backtest is None:
        return None
    for row in reversed(axis.backtest.innovations):
        if row.steps >= 2 * _HALVES_STEPS and row.of_halves is not None and min(row.of_halves) > 0:
            first, second = row.of_halves
            # Each half is the measure of the other: the ratio is there twice.
            return log(first / second) / 2, row.steps / 2, row.interval_s
    return None


def _by_chance(steps: float) -> float:
    """
    Logarithm of the ratio that equal halves of so many innovations hardly ever reach.

    A mean square of n innovations has n degrees of freedom, and what the model of the other half
    predicts for it is known about as well: their ratio follows F.
    """
    return log(fdtri(steps, steps, 1 - _HALVES_CHANCE))


def steady_after_s(axis: AxisResult) -> float:
    """Seconds after which a warm-up is over; 0 where there is none."""
    flicker = axis.coefficients['bias_instability']
    floor = FLICKER_FLOOR * (flicker.value or flicker.upper95 or 0.0)
    parts = (axis.trend.warm_up, axis.trend.second_warm_up) if axis.trend is not None else ()
    return max((Warming(part.amplitude, *part.ci95, part.time_constant_s).steady_after_s(floor)
                for part in parts if part is not None), default=0.0)


def is_worth_cutting(start_s: float, length_s: float) -> bool:
    """Tell whether a record is long enough to do without its beginning."""
    return start_s <= length_s / 2


def start_of(steady_s: Sequence[float], length_s: float) -> float:
    """Give the latest end of a warm-up that a record is long enough to leave out, or 0."""
    return max((time for time in steady_s if time > 0 and is_worth_cutting(time, length_s)),
               default=0.0)


def start_remark(start_s: float, length_s: float, longest_s: float = 0.0) -> Remark:
    """Say what choosing the start has come to, where an axis takes as long as `longest_s`."""
    if start_s <= 0:
        return Remark('start_auto', 'no warm-up was found: the recording is used from its '
                      'beginning')
    if not is_worth_cutting(start_s, length_s):
        return Remark('start_auto', f'the warm-up takes {duration(start_s)}, more than half of '
                      'the recording: nothing is left out, and the coefficients are given without '
                      'the warm-up; record for longer, or switch on earlier')
    rest = (f'; an axis that takes {duration(longest_s)} is given without its warm-up'
            if longest_s > start_s else '')
    return Remark('start_auto', f'the first {duration(start_s)} were left out: the sensor warmed '
                  f'up{rest}')


def thermometer_remarks(seen: Temperature) -> list[Remark]:
    """Say what is wrong with the readings of a thermometer."""
    if seen.course is None and seen.covered < COVERED:
        return [Remark('temperature', f'the temperature covers {100 * seen.covered:.0f} % of the '
                       'record only: it is not used')]
    if seen.course is None:
        return [Remark('temperature', 'the temperature never changes: nothing can be told from '
                       'it')]
    remarks = []
    span = seen.course.highest - seen.course.lowest
    if seen.step > span * _COARSE:
        remarks.append(Remark(
            'temperature', f'the temperature comes in steps of {seen.step:.2g} K within a range '
            f'of {span:.2g} K: what lies between them is a guess'))
    if seen.gaps:
        remarks.append(Remark(
            'temperature', f'the temperature has {seen.gaps} '
            f'{"gap" if seen.gaps == 1 else "gaps"}, over which a line is drawn'))
    return remarks


def _temperature_remarks(fitted: Fit, quantity: Quantity) -> list[Remark]:
    """Say how the mean depends on temperature, and what the random walk was without that."""
    heat = fitted.temperature
    if heat is None:
        return []
    walk, before = fitted.estimates['rate_random_walk'], heat.before.get('rate_random_walk')
    instead = ''
    if before is not None and (not walk.observable or not walk.low < before < walk.high):
        instead = (f'. Without the temperature a rate random walk of {before:.3g} would be read '
                   'from it')
    curved = ', and not in proportion to it' if heat.per_kelvin_squared is not None else ''
    return [Remark(
        'temperature',
        f'the mean follows the temperature by {heat.per_kelvin:.3g} {quantity.unit}/K{curved} '
        f'(95 % interval {heat.low:.3g} to {heat.high:.3g}, seen from {heat.lowest_c:.1f} to '
        f'{heat.highest_c:.1f} degrees Celsius){_lag(heat)}; the coefficients are given without '
        f'it, the numbers for a filter with it{instead}')]


def _lag(heat: Dependence) -> str:
    """Say which of the two follows the other, thermometer or sensor."""
    if heat.lag_s is None or heat.lag_ci95 is None:
        return ''
    behind, ahead = (('thermometer', 'sensor') if heat.lag_s > 0 else ('sensor', 'thermometer'))
    low, high = sorted(abs(end) for end in heat.lag_ci95)
    return (f'. The {behind} follows the {ahead} with a time constant of '
            f'{duration(abs(heat.lag_s))} ({duration(low)} to {duration(high)}), which is taken '
            'into account')


def _mean_remarks(fitted: Fit, quantity: Quantity) -> list[Remark]:
    """Say what moves the mean, and what that means for the random walk."""
    remarks = [Remark('warm_up', _warm_up(fitted, quantity))] if fitted.warmings else []
    if fitted.cycle_s is not None:
        such = ", such as a heater's" if fitted.cycle_s >= _HEATED_S else ''
        remarks.append(Remark(
            'slow_cycle',
            f'the mean follows a slow cycle of about {about(fitted.cycle_s)}{such}; the '
            'coefficients are given without it, the numbers for a filter with it'))
    if fitted.walk_unclear:
        remarks.append(Remark(
            'trend_or_walk',
            'the slowest part of the signal may be a random walk, noise that levels off, or a '
            'mean that bends, settles, steps or follows the temperature in another way than was '
            'told: the rate random walk is given as an upper bound. A longer recording of the '
            'warm sensor at one temperature tells them apart'))
    return remarks


def _within(part: Warming) -> str:
    """Say how well a time constant is known."""
    factor = part.longest_s / part.time_constant_s
    return (f'within {max(100 * (factor - 1), 1):.0f} %' if factor < _FACTOR
            else f'within a factor of {factor:.0f}')


def _warm_up(fitted: Fit, quantity: Quantity) -> str:
    """Say how the mean settles, and when it has."""
    flicker = fitted.estimates['bias_instability']
    floor = FLICKER_FLOOR * (flicker.value if flicker.observable else
                             flicker.upper if isfinite(flicker.upper) else 0.0)
    steady_s = max(part.steady_after_s(floor) for part in fitted.warmings)
    parts = [f'{part.amplitude:.3g} {quantity.unit} at the beginning, with a time constant of '
             f'{duration(part.time_constant_s)} ({_within(part)})' for part in fitted.warmings]
    return (f'the mean settles as after switching on: {", and ".join(parts)}; it is steady after '
            f'{duration(steady_s)}')


def warm_up_remarks(axes: Mapping[str, AxisResult], length_s: float, *, several: bool = False
                    ) -> list[Remark]:
    """
    Say which numbers have the warm-up in them, and how to be without it.

    Parameters
    ----------
    axes : mapping of axis name to AxisResult
        What was fitted.
    length_s : float
        Of the recording, the shortest of several.
    several : bool, optional
        Whether the axes are of several recordings, for which no start is chosen.

    Returns
    -------
    list of Remark
        One for the whole recording, where an axis warms up: the recording begins once.

    """
    steady = [time for axis in axes.values() if (time := steady_after_s(axis)) > 0]
    if not steady:
        return []
    start_s, longest_s = start_of(steady, length_s), max(steady)
    if several and longest_s < length_s:
        advice = f'leave it out with --start {ceil(longest_s / 60)}min'
    elif several or start_s <= 0:
        advice = 'this recording is too short to leave it out; let the sensor warm up first'
    else:
        advice = 'leave it out with --start auto'
        if longest_s > start_s:
            advice += (f', which begins after {duration(start_s)}, since half of the recording '
                       'must remain')
    return [Remark('warm_up', 'the coefficients are given without the warm-up, but the numbers '
                   f'for a filter and the drift have it in them; {advice}')]


def length_remarks(axes: Mapping[str, AxisResult], summary: TimelineSummary,
                   unclear: Collection[str] = ()) -> list[Remark]:
    """
    Say what the record is too short for.

    Parameters
    ----------
    axes : mapping of axis name to AxisResult
        What was fitted.
    summary : TimelineSummary
        Of the same record.
    unclear : collection of str
        Axes whose random walk is hidden by a trend, not by the length of the record.

    Returns
    -------
    list of Remark

    """
    live = {name: axis for name, axis in axes.items()
            if axis.goodness_of_fit.p_value is not None}
    length = duration(summary.timeline.duration_s)
    if not live:
        if summary.timeline.samples < SHORTEST_RECORD:
            return [Remark('short_recording',
                           f'{summary.timeline.samples} samples in {length} are too few '
                           f'for any coefficient; at least {SHORTEST_RECORD} are needed')]
        return []
    remarks = []
    for key in ('noise_density', 'rate_random_walk'):
        hidden = {name: axis.coefficients[key] for name, axis in live.items()
                  if not axis.coefficients[key].observable
                  and not (key == 'rate_random_walk' and name in unclear)}
        if not hidden:
            continue
        terms: dict[str, list[str]] = {}
        for name in hidden:
            terms.setdefault(TERMS[key].name(AXES[name]), []).append(name)
        what = listed([f'{term} of {named(names)}' for term, names in terms.items()])
        remarks.append(Remark(
            'short_recording',
            f'{what} {"does" if len(terms) == 1 else "do"} not show in {length} of data: '
            f'only an upper bound is given'))
    return remarks
