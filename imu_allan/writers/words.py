# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The words of every finding, in one module as they are one table.

No other module makes a sentence of a finding. The order of the table is the order in which
findings are shown, those to act upon first; docs/findings.md is written from it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from imu_allan.characterization.verdict import verdicts
from imu_allan.errors import printable
from imu_allan.finding import ACT, Finding
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result
from imu_allan.sensor.units import engineering, STANDARD_GRAVITY
from imu_allan.wording import about, counted, duration, listed, named, number, SENSORS

_PUBLISHERS = 'give every IMU a topic of its own'
_PART = 'analyze {} with --start and --duration'
_RAW = ('set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the autopilot for raw samples at the '
        'full rate')


class Figures:
    """The values of a finding as they are said; of several axes, from the lowest on."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def __contains__(self, key: str) -> bool:
        return self._values.get(key) is not None

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value as it is."""
        return self._values.get(key, default)

    def said(self, key: str, how: Callable[[Any], str], unit: str = '') -> str:
        """Return a number, or the span of several, with its unit."""
        value = self._values[key]
        if not isinstance(value, (list, tuple)):
            return how(value) + unit
        low, high = how(min(value)), how(max(value))
        return low + unit if low == high else f'{low} to {high}{unit}'

    def number(self, key: str, form: str = '.3g') -> str:
        """Return a number in a format."""
        return self.said(key, lambda value: format(value, form))

    def percent(self, key: str, digits: int = 0) -> str:
        """Return a share in percent."""
        return self.said(key, lambda value: f'{100 * value:.{digits}f}', ' %')

    def time(self, key: str) -> str:
        """Return a length of time."""
        return self.said(key, duration)

    def about(self, key: str) -> str:
        """Return a length of time to two digits."""
        return self.said(key, about)

    def in_unit(self, key: str, form: int = 3) -> str:
        """Return a value in the unit in which engineers say it."""
        unit = engineering(1.0, self['unit'])[1]
        return self.said(
            key, lambda value: number(engineering(value, self['unit'])[0], form), f' {unit}')


Says = Callable[[Figures], str]


@dataclass(frozen=True)
class Words:
    """
    What is said of one code.

    Attributes
    ----------
    title : str
        In two or three words.
    means, found : str
        What it means for the numbers, for docs/findings.md, and how it is found.
    says : callable
        One sentence with the figures.
    do, live : str or callable
        One sentence of what to do with a recording, and at a running node; empty where nothing
        is to be done. `live` None: the same.

    """

    title: str
    means: str
    found: str
    says: str | Says
    do: str | Says = ''
    live: str | None = None


def _times(count: int) -> str:
    return 'once' if count == 1 else f'{count} times'


def _lost(v: Figures) -> str:
    return f'; lost {v["lost"]} of {v["of"]} messages of {v["topic"]}' if 'lost' in v else ''


def _band(v: Figures) -> str:
    if 'low_hz' in v and 'high_hz' in v:
        return f' between {v.number("low_hz", "g")} and {v.number("high_hz", "g")} Hz'
    if 'low_hz' in v:
        return f' above {v.number("low_hz", "g")} Hz'
    return f' below {v.number("high_hz", "g")} Hz' if 'high_hz' in v else ''


def _not_steady(v: Figures) -> str:
    if 'drift_ratio' in v:
        less = 'second' if v['higher'] == 'first' else 'first'
        return (f'over {v.time("interval_s")} the {v["higher"]} half drifts '
                f'{v.number("drift_ratio", ".1f")} times as much as the {less}')
    if 'spread_share' in v:
        return (f'the noise{_band(v)} changes by {v.percent("spread_share")} (standard '
                f'deviation) between segments of {v.time("segment_s")}')
    until = f' {v.time("until_s")}' if 'until_s' in v else ' part'
    return (f'the noise{_band(v)} is {v.percent("change_share")} '
            f'{"higher" if v["higher"] == "first" else "lower"} in the first{until} than after')


def _not_steady_advice(v: Figures) -> str:
    if 'drift_ratio' in v:
        return 'numbers for a filter lie between the two; no interval is widened for it'
    return ('the intervals are widened; look for a change of temperature, supply or vibration, '
            'and record again if one is found')


def _poor_fit(v: Figures) -> str:
    if 'leaves_at_s' in v:
        return (f'from averaging times of {v.time("leaves_at_s")} on the measured curve leaves '
                'the band of the model')
    return ('no sum of noise terms describes this spectrum: its worst half-octave is off by '
            f'{v.percent("misfit_share")}')


def _power_law(v: Figures) -> str:
    if 'recordings' in v:
        each = ', '.join(
            f'{"flicker or none" if exponent is None else f"1/f^{exponent:.2f}"} in {path}'
            for path, exponent in zip(v['recordings'], v['exponents'], strict=True))
        return f'the slow noise does not have the same exponent in all recordings ({each})'
    return (f'the slow noise is no flicker: its density goes with 1/f to the power of '
            f'{v.number("exponent", ".2f")} (95 % interval '
            f'{_end(v, "exponent_low", min):.2f} to {_end(v, "exponent_high", max):.2f})')


def _power_law_advice(v: Figures) -> str:
    if 'recordings' in v:
        return ('the noise density is their mean, other terms are bounded; analyze without '
                '--together for a result of each' if v.get('density_is_mean') else
                'every term is bounded; analyze without --together for a result of each')
    return ('for a filter take the tuned numbers: N and K alone leave this noise out')


def _end(v: Figures, key: str, outer: Callable[[Sequence[float]], float]) -> float:
    value = v[key]
    return float(outer(value) if isinstance(value, (list, tuple)) else value)


def _warm_up(v: Figures) -> str:
    factor = _end(v, 'time_constant_factor', max)
    # From which on an error is no percentage.
    within = (f'within {max(100 * (factor - 1), 1):.0f} %' if factor < 2.0
              else f'within a factor of {factor:.0f}')
    more = ' and a second one' if _end(v, 'exponentials', max) > 1 else ''
    return (f'the mean settles by {v.number("amplitude")} {v["unit"]} after switching on, with '
            f'a time constant of {v.time("time_constant_s")} ({within}){more}; it is steady after '
            f'{v.time("steady_after_s")}')


def _warm_up_advice(v: Figures) -> str:
    if 'start' not in v:
        return ('numbers for a filter have the warm-up in them; the recording is too short to '
                'leave it out: let the sensor warm up first')
    from_s = f', which begins after {v.time("start_s")}' if v['start'] == 'auto' else ''
    return (f'numbers for a filter have the warm-up in them; leave it out with '
            f'--start {v["start"]}{from_s}')


def _start(v: Figures) -> str:
    if not v['warm_up_s']:
        return 'no warm-up was found: the recording is used from its beginning'
    if not v['left_out']:
        return (f'the warm-up takes {v.time("warm_up_s")}, more than half of the recording: '
                'nothing is left out')
    rest = f'; one axis takes {v.time("longest_s")}' if 'longest_s' in v else ''
    return f'the first {v.time("warm_up_s")} were left out: the sensor warmed up{rest}'


def _thermometer(v: Figures) -> str:
    fault = v['fault']
    if fault == 'short':
        return f'the temperature covers {v.percent("covered_share")} of the record: it is not used'
    if fault == 'constant':
        return 'the temperature never changes: its effect cannot be measured'
    if fault == 'coarse':
        return (f'the temperature comes in steps of {v.number("step_k", ".2g")} K within a range '
                f'of {v.number("range_k", ".2g")} K')
    if fault == 'gaps':
        return f'the temperature has {counted(v["gaps"], "gap")}, over which it is interpolated'
    return f'the temperature was not read: {v["reason"]}'


def _temperature(v: Figures) -> str:
    curved = ', and not in proportion to it' if v['curved'] else ''
    return (f'the mean follows the temperature by {v.number("per_kelvin")} {v["unit"]}/K{curved} '
            f'(95 % interval {_end(v, "per_kelvin_low", min):.3g} to '
            f'{_end(v, "per_kelvin_high", max):.3g}; '
            f'{_end(v, "lowest_c", min):.1f} to {_end(v, "highest_c", max):.1f} degrees Celsius)')


def _temperature_advice(v: Figures) -> str:
    lag = ''
    if 'lag_s' in v:
        behind = 'thermometer' if _end(v, 'lag_s', max) > 0 else 'sensor'
        lag = (f'; the {behind} lags by '
               f'{v.said("lag_s", lambda value: duration(abs(value)))}')
    return (f'coefficients are given without the temperature, numbers for a filter with it'
            f'{lag}')


def _rate_changed(v: Figures) -> str:
    change = f'from {v.number("from_hz", ".4g")} to {v.number("to_hz", ".4g")} Hz'
    if 'at_s' in v:
        return (f'the sample rate changed {change} at {v.number("at_s", ".6g")} s: the '
                f'{v["left_out"]} samples at another rate than the first are left out')
    return (f'the sample rate changed {change}: the {v["left_out"]} samples at the first rate '
            'are left out')


def _gravity(v: Figures) -> str:
    size = v['mean']
    hint = ('; is it in units of g?' if abs(size - 1) < 0.05
            else '; has gravity been removed?' if size < 0.5 else '')
    return (f'the mean acceleration is {size:.4g} m/s^2, not about '
            f'{STANDARD_GRAVITY:.2f}{hint}')


def _implausible(v: Figures) -> str:
    what = {'mean': 'a mean', 'noise_density': 'white noise'}[v['what']]
    likely = 'raw counts' if v['likely'] == 'counts' else f'{v["likely"]} in place of SI units'
    return (f'{what} of {v.number("value")} {v["unit"]} is more than any such sensor has at rest '
            f'({v.number("limit")}): {likely}, or motion')


def _slow_motion(v: Figures) -> str:
    more = '' if _end(v, 'count', max) == 1 else f', and {v.number("count", "d")} times in all'
    return (f'the mean moves by {v.number("size", ".2g")} {v["unit"]} for '
            f'{v.time("duration_s")} from {v.time("start_s")} on and comes back{more}')


def _rest(v: Figures) -> str:
    named_rests = ', '.join(f'{lasts:.4g} s at {start:.5g} s' for start, lasts in zip(
        v['starts_s'], v['durations_s'], strict=True))
    more = v['rests'] - len(v['starts_s'])
    return (f'the IMU moves during {v.percent("share")} of the samples: only the '
            f'{v.number("rest_s", ".4g")} s at rest are used ({named_rests}'
            f'{f" and {more} more" if more > 0 else ""})')


def _short(v: Figures) -> str:
    if 'samples' in v:
        return (f'{v["samples"]} samples in {v.time("duration_s")} are too few for any '
                f'coefficient: at least {v["needed"]} are needed')
    symbol = TERMS[v['coefficient']].symbol
    return f'{symbol} is not visible in {v.time("duration_s")}: only an upper bound is given'


def _uneven_stamps(v: Figures) -> str:
    seen = ('what was lost is known by the numbers of the messages' if v['numbered'] else
            'only gaps that last are seen')
    return (f'{v["clock"]} stamps come too unevenly to see a single missing sample: messages are '
            f'counted, {seen}')


def _uneven_error(v: Figures) -> str:
    parts = []
    if 'hidden_share' in v:
        parts.append(f'up to {v.percent("hidden_share", 1)} of the samples may be missing unseen, '
                     f'and N then up to {v.percent("density_high_share", 1)} too high')
    if 'rate_error_share' in v:
        parts.append(f'the rate may be up to {v.percent("rate_error_share", 1)} off')
    return '; '.join(parts)


def _truncated(v: Figures) -> str:
    if v['fault'] == 'compressed':
        return (f'the compressed file is damaged or cut short ({v["reason"]}); what comes before '
                'was read')
    if v['fault'] == 'database':
        return (f'{v["missing_bytes"]} of {v["bytes"]} bytes are missing at the end of the '
                'database (was the recorder killed, or the copy cut short?)')
    if v['fault'] == 'log':
        return f'the log breaks off in a message; its {v["bytes"]} bytes are lost'
    return (f'the recording breaks off (was the recorder killed?): {v["end"]}; '
            f'found {counted(v["whole_chunks"], "whole chunk")}')


def _damaged(v: Figures) -> str:
    fault = v['fault']
    if fault == 'chunks':
        return (f'left out {counted(v["broken"], "damaged chunk")} of {v["chunks"]} (the first '
                f'{v["first"]}){_lost(v)}')
    if fault == 'holes':
        return (f'left out {counted(v["holes"], "place")} without records (the '
                f'first: {v["first"]}){_lost(v)}')
    if fault == 'entries':
        return (f'{v["topic"]} is entered {v["entries"]} times; the messages of the first '
                f'{v["read"]} entries were read')
    if fault == 'database':
        return (f'the database is damaged in {counted(v["places"], "place")} ({v["reason"]}): '
                f'{counted(v["read"], "message")} of {v["topic"]} could be read, the others are '
                'lost')
    if fault == 'bytes':
        return f'left out {v["bytes"]:,} damaged bytes'
    if fault == 'file':
        return f'a file of it was left out: {v["reason"]}'
    return f'not all of it could be read{_lost(v)}'


def _unfinished(v: Figures) -> str:
    if v['fault'] == 'not_regular':
        return f'{v["file"]} beside it is not a regular file and was not used'
    if v['fault'] == 'unusable':
        return (f'{v["file"]} beside it could not be used ({v["reason"]}); the last messages '
                'before the recorder was killed are missing or damaged')
    return (f'{v["file"]} beside it tells that the recorder was killed; what it was about to '
            'write then is missing')


def _malformed(v: Figures) -> str:
    if v['what'] == 'line':
        first = f'; the first: {v["first"]}' if 'first' in v else ''
        return f'left out {counted(v["count"], "line")} without readable numbers{first}'
    return (f'left out {counted(v["count"], "invalid message")} of {v["topic"]} ({v["type"]}); '
            f'the first: {v["first"]}')


def _columns(v: Figures) -> str:
    more = v['count'] - len(v['columns'])
    names = ', '.join([*v['columns'], *([f'and {more:,} more'] if more > 0 else [])])
    return (f'columns that may be axes were not understood: {names}' if v['perhaps_axes'] else
            f'columns that are no axes were left out: {names}')


def _filtered(v: Figures) -> str:
    if v['by'] == 'autopilot':
        return ('IMU messages have passed the filters of the autopilot (INS_GYRO_FILTER, '
                'INS_ACCEL_FILTER)')
    return (f'the samples of {v["topic"]} have passed an orientation filter that changes them, '
            'perhaps by a bias that it estimates')


def _chosen(v: Figures) -> str:
    return (f'of {v["topics"]} IMU topics {" and ".join(v["chosen"])} '
            f'{"is" if len(v["chosen"]) == 1 else "are"} read, {v["reason"]}')


def _repeated(v: Figures) -> str:
    if 'half' not in v:
        return f'each message of topic {v["topic"]} repeats one of its halves'
    return f'topic {v["topic"]} repeats its {SENSORS[v["half"]].lower()} samples between new ones'


def _two_rates(v: Figures) -> str:
    rates = ' and '.join(
        f'the {SENSORS[sensor].lower()} from {topic} at {rate or 0:.6g} Hz' for sensor, topic, rate
        in zip(v['sensors'], v['topics'], v['rates_hz'], strict=True))
    return f'{rates}; rate, gaps and faults are those of the {SENSORS[v["sensors"][0]].lower()}'


def _disagree(v: Figures) -> str:
    term = TERMS[v['coefficient']].symbol
    others = v['others'][0] if len(v['others']) == 1 else 'the others'
    return (f'{term} differs between the recordings beyond error: {v.in_unit("value", 4)} in '
            f'{v["of_recording"]}, {v.in_unit("usual_value", 4)} in {others}')


WORDS: Mapping[str, Words] = {
    # --------------------------------------------------------------- the sensor does not measure
    'stood_still': Words(
        'stood still', 'The axis gave no new value for a while: it has no coefficients.',
        'One value repeats for far longer than noise does.',
        lambda v: f'one and the same value for {v.time("duration_s")} from {v.time("start_s")} '
                  'on: the sensor or its driver stood still',
        'no coefficient is given; analyze the rest with --start and --duration',
        'look at the sensor and its driver, then call ~/reset'),
    'constant_axis': Words(
        'constant', 'The axis is not connected, or its noise is below one step of its output.',
        'Every sample is the same.',
        lambda v: f'every sample is {_values(v)} {v["unit"]}: there is no noise to measure',
        'look whether the axis is connected and read out'),
    'saturated': Words(
        'saturated',
        'The output is cut off at an end of its range: the noise is higher than it seems.',
        'Many samples are at the highest or lowest value.',
        lambda v: f'{v.percent("share", 1)} of the samples stand at {v.number("value", ".6g")} '
                  f'{v["unit"]}, the {v["end"]} value: the output is cut off there',
        'no coefficient is given; choose a larger range or another position',
        'no coefficient is given; choose a larger range or another position, then call ~/reset'),
    'deadband': Words(
        'deadband', 'The driver gives small values as zero: the noise is higher than it seems.',
        'Many samples are exactly zero, none close to zero.',
        lambda v: f'{v.percent("share")} of the samples are exactly 0, and none lies between 0 '
                  f'and {v.number("width")} {v["unit"]}: the driver gives small values as 0',
        'no coefficient is given; switch the deadband off',
        'no coefficient is given; switch the deadband off, then call ~/reset'),
    'copied_axis': Words(
        'copied axis', 'The driver gives one axis twice, and another not at all.',
        'All samples of two axes are equal.',
        lambda v: 'they are the same to the last digit of every sample'
                  f'{", but for the sign" if v["opposite"] else ""}: the driver gives one axis '
                  'twice',
        'correct the assignment of axes in the driver'),
    'high_passed': Words(
        'slow part removed',
        'A filter has removed the bias, and slow noise with it: only N is that of the sensor.',
        'The spectrum falls towards low frequencies.',
        lambda v: f'below about {v.number("corner_hz", ".2g")} Hz the noise falls away, as behind '
                  'a filter that subtracts a bias it estimates (imu_complementary_filter does)',
        'only N is that of the sensor; take the raw topic'),
    'filtered': Words(
        'filtered', 'A filter has changed the samples.',
        'The raw topic beside them has other values, or the log says so.', _filtered,
        lambda v: _RAW if v['by'] == 'autopilot' else f'take {v["raw"]}'),
    'axis_not_finite': Words(
        'not finite', 'The axis holds no numbers and is left out.',
        'All values are NaN or infinite, or a table has no such column.',
        'no numbers (no such column, NaN or infinite), left out',
        'name its column, or look whether the driver fills in this axis'),
    'frozen': Words(
        'frozen sensor',
        'The sensor or its driver gave no new values for a while, which is left out.',
        'Whole messages repeat for far longer than noise does.',
        lambda v: f'{v["messages"]} messages repeat one value again and again'
                  f'{_since(v)}: the sensor or its driver stood still, they are left out',
        'look at the cable and the driver'),
    'unknown_rate': Words(
        'no rate', 'Without a sample rate there are no averaging times.',
        'There are too few stamps.',
        'the sample rate is not known from so few stamps', 'record for longer'),
    # ------------------------------------------------------------------------- it did not rest
    'mostly_motion': Words(
        'motion', 'The IMU was not at rest: what is measured is motion.',
        'More than half of the samples are above the noise level.',
        lambda v: f'{v.percent("share")} of the samples are motion',
        'record while the sensor stands still', 'let the IMU rest, or set motion to keep'),
    'slow_motion': Words(
        'slow motion', 'A slow turn or tilt looks like slow noise.',
        'The mean leaves and returns, by more than the noise explains.',
        _slow_motion, 'B and K are upper bounds; ' + _PART.format('the rest'),
        'call ~/reset to begin anew'),
    'noise_level_changed': Words(
        'noise level changes', 'The curve mixes two levels of noise and describes neither.',
        'The noise of all axes changes for good.',
        lambda v: 'the noise changed for good: ' + ', '.join(
            f'{ratio:.3g} times at about {time_s:.5g} s' for time_s, ratio in zip(
                v['at_s'], v['ratios'], strict=True)),
        'the curve mixes both levels; analyze them apart with --start and --duration',
        'call ~/reset to characterize the present level alone'),
    'bias_step': Words(
        'bias step', 'One step of the mean looks like a random walk.',
        'The mean steps once by more than the noise explains.',
        lambda v: f'the mean steps by {v.number("size")} {v["unit"]} after about '
                  f'{v.about("after_s")}, and nowhere else (a knock, or another supply voltage or '
                  'setting)',
        'K is an upper bound; analyze what lies before or behind it with --start and --duration',
        'K is an upper bound; call ~/reset to characterize what lies behind it alone'),
    'not_steady': Words(
        'not steady',
        'The noise was not the same all the time: a later recording may differ by as much.',
        'Segments differ by more than chance, band by band.',
        _not_steady, _not_steady_advice,
        'the intervals are widened; call ~/reset once temperature, supply and vibration are '
        'steady'),
    'warm_up': Words(
        'warming up', 'The sensor was still warming up: its mean settles exponentially.',
        'One or two exponentials explain the mean better than noise.',
        _warm_up, _warm_up_advice,
        'numbers for a filter have the warm-up in them; call ~/reset when it is over'),
    # ---------------------------------------------------------------- whose messages are these
    'several_publishers': Words(
        'several publishers',
        'Two sensors share a topic: the rate is twice too high, and N wrong by any factor.',
        'Neighbouring values differ in turn.',
        'neighbouring messages differ in turn, as those of two sensors that publish '
        'with one frame_id do',
        'find them with ros2 topic info --verbose, and record each alone', _PUBLISHERS),
    'alternating': Words(
        'values in turn',
        'If two sensors share the topic, the rate is twice too high and N is wrong.',
        'Means of neighbouring messages differ in turn.',
        'the values of neighbouring messages differ in turn: a vibration at half the message '
        'rate, or two sensors that publish with one frame_id',
        'see with ros2 topic info --verbose whether there are two publishers', _PUBLISHERS),
    'several_frames': Words(
        'several frames', 'Several IMUs share a topic; only the first is used.',
        'Messages have different frame_id.',
        lambda v: f'messages of frame_id {v["frame_id"]!r} are used, those of '
        + ', '.join(f'{name!r} ({count} messages)' for name, count in zip(
            v['others'], v['rejected'], strict=True)) + ' rejected',
        _PUBLISHERS,
        'a change that lasts begins a new run by itself; give every IMU a topic of its own'),
    'rate_changed': Words(
        'rate changed', 'Only the samples at one rate are used.',
        'The stamps advance by another step for good.', _rate_changed,
        lambda v: 'analyze them, the larger part, by themselves with --start and --duration'
        if v['most_left_out'] else 'analyze them by themselves with --start and --duration',
        'a change that lasts begins a new run by itself'),
    'clock_changed': Words(
        'clock changed', 'The header stamps became unusable; receive stamps are used from there.',
        'Header stamps stand still, jump or come in whole seconds.',
        lambda v: f'header stamps are {v["flaw"]} from about {v.number("since_s", ".6g")} s on: '
                  'receive stamps are used from there', 'mend the stamps of the driver'),
    'clock_speed': Words(
        'speed of clocks',
        'One clock is wrong, as in a replay: averaging times may be off by their ratio.',
        'Header and receive stamps last differently long.',
        lambda v: f'header stamps run {v.number("ratio")} times as fast as receive stamps, as in '
                  'a replay or a simulation',
        'if they are wrong, --clock receive uses the other clock',
        'check the clock of the driver'),
    'gravity': Words(
        'gravity', 'The acceleration is in another unit, or gravity was subtracted.',
        'The mean is not about 9.81 m/s^2.', _gravity,
        'check the unit and the topic; --accel :g converts', 'check the unit of the driver'),
    'implausible': Words(
        'implausible', 'The numbers are those of another unit, of raw counts, or of motion.',
        'A mean or noise density is far beyond any sensor at rest.',
        _implausible,
        'state the unit (--gyro, --accel), or record it at rest', 'check the unit of the driver'),
    # ------------------------------------------------------------------------ messages are lost
    'many_missing': Words(
        'many missing', 'So many samples are interpolated that N may be off.',
        'Places in the time grid are empty.',
        lambda v: f'{v.percent("share", 1)} of the samples are missing and interpolated'
                  + (f': N may be up to {v.percent("density_error_share")} off'
                     if 'density_error_share' in v else ''),
        'record with a deeper queue or with reliable delivery',
        'ask for a deeper queue or for reliable delivery with qos_overrides'),
    'spikes': Words(
        'outliers', 'Single outliers are left out; they point to errors on the bus.',
        'Samples lie ten times the noise from their neighbours.',
        lambda v: f'{counted(v["messages"], "single message holds", "single messages hold")} '
                  'outliers, ten times the noise and more, and '
                  f'{"is" if v["messages"] == 1 else "are"} left out',
        'look for errors on the bus of the sensor'),
    'field_absent': Words(
        'absent field', 'Some messages lack a sensor and are left out.',
        'Their covariance[0] is -1: not provided.',
        lambda v: f'{v["messages"]} messages declare angular velocity or linear acceleration as '
                  'not provided (covariance[0] is -1), others do not: they are left out',
        'let the driver fill in both, or publish them apart'),
    'axis_absent_in_part': Words(
        'absent in part', 'The record of this axis is shorter.',
        'Values are NaN for a while, or declared absent.',
        lambda v: f'no values in {v.number("absent", "d")} of {v["messages"]} messages (NaN, or '
                  'covariance[0] is -1)', 'look at the cable and the driver of this axis'),
    'interpolated': Words(
        'interpolated', 'The driver interpolates one sensor: its white noise is a third too low '
        'and not white.', 'The samples lie on lines between fewer.',
        lambda v: f'the {SENSORS[v["half"]].lower()} samples of topic {v["topic"]} are '
                  'interpolated between fewer', 'record without uniting (RealSense: '
        'unite_imu_method 0)', 'publish without uniting (RealSense: unite_imu_method 0)'),
    'batches': Words(
        'batches', 'The log holds short batches with pauses: only N can be seen.',
        'The log says so.', lambda v: f'topic {v["topic"]} comes in batches with pauses: it shows '
        'N and no more', _RAW),
    'damaged_recording': Words(
        'damaged recording', 'Part of the recording cannot be read; the rest is used.',
        'Checksums or places in the file are wrong.', _damaged, ''),
    'truncated_recording': Words(
        'truncated recording', 'The recording ends too early; what comes before is used.',
        'The file ends inside a record.', _truncated, ''),
    'lost_messages': Words(
        'lost messages', 'Fewer messages were found than recorded.',
        'metadata.yaml counts more.',
        lambda v: f'{v["found"]} of the {v["counted"]} messages of {v["topic"]} that '
                  'metadata.yaml counts were found', ''),
    'missing_file': Words(
        'missing file', 'Files of the recording are missing; the others are used.',
        'metadata.yaml lists them.',
        lambda v: f'{v["missing"]} of {v["listed"]} files that metadata.yaml lists cannot be '
                  f'found: {v["files"]}; the others were read', ''),
    'malformed_messages': Words(
        'malformed messages', 'Messages that are no IMU messages are left out.',
        'They are too short, or hold no numbers.', _malformed, ''),
    # ------------------------------------------------------------------- what the model explains
    'short_recording': Words(
        'short recording',
        'The record is too short to show this coefficient: it lies below the bound.',
        'Its interval reaches to zero.', _short,
        'record for longer', 'wait, or let it run overnight'),
    'poor_fit': Words(
        'poor fit', 'The noise is no sum of the terms that are fitted.',
        'Spectrum or curve leave the model by more than chance.', _poor_fit,
        'the intervals are widened; look for vibration, or a filter in the sensor or driver'),
    'recordings_disagree': Words(
        'recordings disagree', 'The recordings are not of one noise.',
        'A coefficient differs by more than its errors.', _disagree,
        'the interval is widened; look at what was different in that recording'),
    'thermometer': Words(
        'thermometer', 'The temperature cannot be used, or only partly.',
        'Its readings are few, constant, coarse or with gaps.', _thermometer,
        'record the temperature all the time and finely, or leave it out'),
    'trend_or_walk': Words(
        'trend or random walk', 'The slowest part may be a random walk or deterministic drift: '
        'K is an upper bound.', 'Models with and without a random walk explain the data alike.',
        'the slowest part of the signal may be a random walk or a deterministic drift: '
        'K is given as an upper bound',
        'record for longer, the sensor warm and at one temperature'),
    'power_law': Words(
        'no flicker', 'The slow noise has another slope than flicker: B is an upper bound.',
        'An exponent other than 1 explains the spectrum better.', _power_law,
        _power_law_advice),
    'band_limited': Words(
        'low-pass',
        'Sensor or driver filter the fast noise; the coefficients are those below the filter.',
        'The spectrum falls towards the highest frequencies.',
        lambda v: f'the spectrum falls above {v.number("edge_hz")} Hz (a low-pass in sensor or '
                  'driver, or noise that no term describes); the coefficients are fitted below'
        if 'edge_hz' in v else
        'the noise rolls off towards the highest frequencies (a low-pass in sensor or driver): '
        f'its effective window is {v.number("window_s")} s'),
    'gauss_markov': Words(
        'correlated noise', 'Part of the slow noise levels off after a correlation time.',
        'A first-order Gauss-Markov process explains the spectrum better.',
        lambda v: f'a first-order Gauss-Markov process of {v.number("sigma")} {v["unit"]} with a '
                  f'correlation time of {v.number("correlation_time_s")} s is part of the noise'),
    'temperature': Words(
        'temperature', 'The mean follows the temperature; that part is no noise.',
        'A regression of the mean on the thermometer.', _temperature, _temperature_advice),
    'slow_cycle': Words(
        # From 30 s on it may be one of temperature.
        'slow cycle', 'The mean follows a slow cycle; that part is no noise.',
        'A slow sine explains the mean better than noise.',
        lambda v: f'the mean follows a slow cycle of about {v.about("period_s")}'
                  + (", such as a heater's" if _end(v, 'period_s', min) >= 30.0 else ''),
        'coefficients are given without it, numbers for a filter with it'),
    'coarse_resolution': Words(
        'coarse steps', 'What lies below one step of the output is hidden.',
        'The smallest step is larger than the noise of a sample.',
        lambda v: f'the output steps by {v.number("step")} {v["unit"]}, '
                  f'{v.number("ratio", ".1f")} times the noise of one sample: what lies below '
                  'the step is hidden', 'choose a smaller range of the sensor'),
    'tones': Words(
        'tones', 'Vibration, mains or a converter: not noise, and left out of the fit.',
        'Narrow lines stand above the spectrum.',
        lambda v: f'{v.said("count", lambda n: f"{n:d}")} '
                  f'{"line" if _end(v, "count", max) == 1 else "lines"}, the strongest at '
                  f'{v.number("frequency_hz", ".4g")} Hz ({v.in_unit("amplitude")}), left out of '
                  'the fit'),
    'turn_on_bias': Words(
        'turn-on bias', 'The bias differs from one power-on to the next.',
        'Means of the recordings differ by more than they drift in one.',
        lambda v: f'the mean differs from recording to recording by {v.in_unit("sigma")} beyond '
                  f'what it drifts in one ({v.in_unit("sigma_low")} to '
                  f'{v.in_unit("sigma_high")})'),
    # ------------------------------------------------------------------- what was done about it
    'start_auto': Words(
        'start', 'What --start auto has come to.', 'The warm-up of each axis says when it ends.',
        _start, lambda v: 'record for longer, or switch on earlier'
        if v['warm_up_s'] and not v['left_out'] else ''),
    'motion': Words(
        'motion', 'Motion and knocks are left out.',
        'The noise rises for a moment.',
        lambda v: f'motion or knocks were cut out {_times(v["count"])}, '
                  f'{v.number("excluded_s", ".6g")} s in all'),
    'rest_within_motion': Words(
        'rest within motion', 'Only the time at rest is used.',
        'Between motions the noise is steady for five seconds and more.', _rest),
    'motion_kept': Words(
        'motion kept', 'Motion is part of what was measured, as asked for.',
        'The noise rises for a moment.',
        lambda v: f'motion or knocks were seen {_times(v["count"])}, '
                  f'{v.number("seen_s", ".6g")} s in all, first at {v.number("first_s", ".5g")} '
                  's, and kept as asked', 'coefficients and bounds describe them as much as the '
        'noise'),
    'motion_not_listed': Words(
        'motion not listed', 'The result lists the first spans of motion only.',
        'There are more than are kept.',
        lambda v: f'only the first {v["listed"]} spans of motion are listed'),
    'receive_clock': Words(
        'receive clock', 'Receive stamps are used, which are less even.',
        'Header stamps are zero, constant or coarse.',
        lambda v: f'header stamps are {v["flaw"]}: receive stamps are used' if 'flaw' in v else
        'header stamps come in ticks or batches: receive stamps, which come evenly, are used'),
    'counted_samples': Words(
        'counted samples', 'No stamps are used: missing samples cannot be seen.',
        'Neither clock is usable, or none was asked for.',
        lambda v: f'no usable stamps: samples are counted at the stated '
                  f'{v.number("rate_hz", "g")} Hz, and missing ones cannot be seen'),
    'uneven_stamps': Words(
        'uneven stamps', 'Single missing samples cannot be seen.',
        'The stamps scatter by a good part of the interval.', _uneven_stamps, _uneven_error),
    'uneven_rate': Words(
        'uneven rate', 'The rate varies: averaging times are off by up to so much, N by half of '
        'it.', 'The rate differs between segments.',
        lambda v: f'the sample rate varies between {v.number("lowest_hz", ".5g")} and '
                  f'{v.number("highest_hz", ".5g")} Hz: {v.number("mean_hz", ".5g")} Hz, its '
                  'mean, is used',
        lambda v: f'averaging times may be up to {v.percent("tau_error_share", 1)} off and N half '
                  'as much'),
    'clock_jumps': Words(
        'clock jumps', 'The record is in several segments; no difference is taken across a jump.',
        'A stamp and all that follow lie far from where the rate puts them.',
        lambda v: f'the {v["clock"]} clock jumped {_times(v["count"])}: no difference is taken '
                  'across a jump'),
    'gaps_not_listed': Words(
        'gaps not listed', 'The result lists the first gaps only.',
        'There are more than are kept.',
        lambda v: f'{v["gaps"]} gaps of {v.number("gaps_s", ".6g")} s in all; only the first '
                  f'{v["listed"]} are listed'),
    'held_values': Words(
        'held values', 'The driver polls the sensor faster than it samples.',
        'Messages repeat all values of the one before.',
        lambda v: f'{v.percent("share")} of the messages repeat the values of the one before: the '
                  'sensor is polled faster than it samples',
        'its own rate is used and the repeats are left out'),
    'late_start': Words(
        'late start', 'The first messages hold nothing and are left out.',
        'They repeat one value, or none.',
        lambda v: f'the first {v["messages"]} messages hold one value or none: the sensor had not '
                  'come to life yet, they are left out'),
    'axis_late_start': Words(
        'late axis', 'The record of this axis begins later.',
        'It holds one value at first.',
        lambda v: f'one value for the first {v.number("late", "d")} of {v["messages"]} messages: '
                  'the axis had not come to life yet'),
    'unit_g': Words(
        'unit g', 'Acceleration in g was converted to m/s^2.',
        'Its magnitude is near 1.',
        'the magnitude of the acceleration is near 1: taken as g, not m/s^2',
        '--accel :g says so, --accel :m/s^2 takes the numbers as they are',
        'set accel_unit to g to say so, to m/s^2 to take the numbers as they are'),
    'two_rates': Words(
        'two rates', 'Gyroscope and accelerometer come at rates of their own.',
        'They come on two topics, or one repeats its values.', _two_rates),
    'repeated_half': Words(
        'repeated half', 'One sensor repeats its values between new ones of the other.',
        'Its values change at a rate of their own.', _repeated,
        'each sensor is analyzed at its own rate'),
    'chosen_topic': Words(
        'chosen topic', 'Of several IMU topics one was chosen.', 'By its name and kind.',
        _chosen, lambda v: '--topic, or --gyro-topic and --accel-topic, choose among '
        f'{", ".join(v["others"])}'),
    'short_part': Words(
        'short part', 'Less is recorded than was asked for.',
        'The recording ends before.',
        lambda v: f'only {v.time("recorded_s")} of the {v.time("asked_s")} asked for are '
                  'recorded'),
    'ignored_columns': Words(
        'ignored columns', 'Columns of the table are not used.',
        'Their names are not those of axes.', _columns,
        lambda v: '--columns gyro_x=NAME,accel_x=NAME,time=NAME says which columns are what'
        if v['perhaps_axes'] else ''),
    'merged_messages': Words(
        'merged messages', 'Messages of the same times cannot be distinguished in such a file.',
        'Receive time and stamp are equal.',
        lambda v: f'merged {counted(v["count"], "message")} with another of the same receive time '
                  'and stamp, of which the last counts: nothing else in such a file tells them '
                  'apart'),
    'many_topics': Words(
        'many topics', 'The recording holds more topics than are listed.', 'They are counted.',
        lambda v: f'its first {v["listed"]:,} {v["what"]} are listed, the others are not read'),
    'many_definitions': Words(
        'many definitions', 'The descriptions of topics are too long to be true.',
        'Their bytes are counted.',
        'what it says about its topics is longer than any recorder writes; the topics '
        'from there on are not read'),
    'no_metadata': Words(
        'no metadata', 'The folder has no usable metadata.yaml; the files found are read.',
        'It is missing or cannot be parsed.',
        lambda v: f'metadata.yaml is damaged ({v["reason"]}); the files found were read'
        if 'reason' in v else
        'no metadata.yaml (was the recorder killed?); the files found were read'),
    'unfinished_recording': Words(
        'unfinished recording', 'The recorder was killed; its last messages may be missing.',
        'A journal of the database lies beside it.', _unfinished),
    'unpacked_in_memory': Words(
        'unpacked in memory', 'The recording was unpacked to a folder that takes memory.',
        'The temporary folder is in memory.',
        lambda v: f'its {v["bytes"]:,} bytes were unpacked to {v["folder"]}, which is in memory',
        'name a folder on a disk with TMPDIR'),
}
"""Words by code, in the order in which findings of one severity are shown."""

_RANK = {code: rank for rank, code in enumerate(WORDS)}


def _values(v: Figures) -> str:
    value = v['value']
    if isinstance(value, (list, tuple)):
        return listed(list(dict.fromkeys(f'{each:g}' for each in value)))
    return f'{value:g}'


def _since(v: Figures) -> str:
    return f', first at {v.number("since_s", ".6g")} s' if 'since_s' in v else ''


def title_of(found: Finding) -> str:
    """Return the name of a finding, in two or three words."""
    words = WORDS.get(found.code)
    return words.title if words is not None else printable(found.code).replace('_', ' ')


def says(found: Finding) -> str:
    """Return the sentence with the figures of a finding, with what it is about before it."""
    if 'more' in found.values:
        return f'{_about(found)}{found.values["more"]} more like these'
    made = _made(WORDS[found.code].says, found) if found.code in WORDS else ''
    if made:
        return f'{_about(found)}{made}'
    return printable(found.message) or f'{_about(found)}{title_of(found)}'


def advice(found: Finding, *, live: bool = False) -> str:
    """Return what to do about a finding, with a recording or at a running node; or nothing."""
    words = WORDS.get(found.code)
    if words is None or 'more' in found.values or not _made(words.says, found):
        return ''
    return _made(words.live if live and words.live is not None else words.do, found)


def _made(part: str | Says, found: Finding) -> str:
    """Return a sentence of the table; empty where a file of another version lacks its figures."""
    if isinstance(part, str):
        return part
    try:
        return printable(part(Figures(found.values)))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        return ''


def message_of(found: Finding, *, live: bool = False) -> str:
    """Return what was found and what to do about it, on one line."""
    return '; '.join(filter(None, (says(found), advice(found, live=live))))


def explained(code: str) -> list[str]:
    """Return what a code means in lines: title, severity, meaning, how it is found, advice."""
    words = WORDS[code]
    lines = [f'{code}: {words.title} '
             f'({"act upon it" if code in ACT else "good to know"})',
             f'What it means: {words.means}', f'How it is found: {words.found}']
    for name, do in (('With a recording', words.do), ('At a running node', words.live)):
        if isinstance(do, str) and do:
            lines.append(f'{name}: {do}.')
        elif callable(do):
            lines.append(f'{name}: the message says what fits the figures.')
    return lines


def of_axis(found: Finding, axis: str) -> Finding:
    """Return what a finding about several axes says about one of them, which is not named."""
    place, many = found.axes.index(axis), len(found.axes)
    return replace(found, axes=(), values={
        name: value[place] if many > 1 and isinstance(value, (list, tuple)) and len(value) == many
        else value for name, value in found.values.items()})


def presented(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """
    Return findings as every front end shows them.

    Parameters
    ----------
    findings : sequence of Finding
        As they were found, each axis by itself.

    Returns
    -------
    tuple of Finding
        Those of one kind about several axes are one, with a list of each value that differs.
        Those to act upon come first. Each has its message.

    """
    ranked = sorted(_grouped(findings), key=lambda found: (
        found.severity != 'act', _RANK.get(found.code, len(_RANK))))
    return tuple(replace(found, message=message_of(found)) for found in ranked)


def with_words(result: Result) -> Result:
    """Return a result with findings and verdicts as every front end shows them."""
    shown = replace(result, warnings=presented(result.warnings))
    return replace(shown, sensors=verdicts(shown))


def _grouped(findings: Sequence[Finding]) -> list[Finding]:
    """Join what differs in the axis and in numbers alone."""
    groups: dict[object, list[Finding]] = {}
    for found in findings:
        key: object = len(groups)
        if len(found.axes) == 1 and found.values is not None:
            key = (found.code, found.severity, *(
                (name, value if not _is_number(value) else None, _is_number(value))
                for name, value in sorted(found.values.items())))
        same = groups.setdefault(_hashable(key), [])
        if any(one.axes == found.axes for one in same):
            groups[len(groups), 'again'] = [found]
        else:
            same.append(found)
    return [_joined(same) for same in groups.values()]


def _joined(same: Sequence[Finding]) -> Finding:
    if len(same) == 1:
        return same[0]
    axes = tuple(axis for found in same for axis in found.axes)
    values: dict[str, Any] = {}
    for name in same[0].values:
        each = [found.values[name] for found in same]
        values[name] = each[0] if all(value == each[0] for value in each) else each
    return replace(same[0], axes=axes, values=values)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _hashable(key: object) -> object:
    return repr(key)


def _about(found: Finding) -> str:
    """Return the recording and the axes that a finding is about, as they come before it."""
    recording = found.values.get('recording')
    where = f'{printable(str(recording))}: ' if recording else ''
    return f'{where}{named([printable(axis) for axis in found.axes])}: ' if found.axes else where
