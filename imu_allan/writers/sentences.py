# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Texts for every code of a finding, in the order of `imu_allan.finding.CODES`.

In the functions, `f` holds the values of a finding as attributes, and its severity. Unknown values
are absent; test with `'name' in f`. A value that differs between axes is formatted as a range from
lowest to highest.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any

from imu_allan.noise.terms import TERMS
from imu_allan.sensor.units import engineering
from imu_allan.wording import about, counted, duration, listed, number, ranged, SENSORS

Text = str | Callable[[Any], str]
"""A sentence, or a function that makes one from the values of a finding."""


class Span(tuple[Any, ...]):
    """Values of several axes; formatted as a single value if they read the same."""

    def __format__(self, spec: str) -> str:
        return _each(self, lambda value: format(value, spec))


@dataclass(frozen=True)
class Words:
    """
    The texts for one code.

    Attributes
    ----------
    title : str
        Name of the finding in two or three words.
    means, found : str
        What the finding means for the numbers, and how it is detected; for docs/findings.md.
    says : Text
        One sentence with the values.
    do, live : Text
        One sentence of advice for a recording, and for a running node; empty if there is nothing
        to do. If `live` is None, `do` applies to both.
    general : str
        Advice independent of the values, if `do` is a function; for docs/findings.md.
    brief : Text
        Reason for a verdict, in its line; the title if empty.

    """

    title: str
    means: str
    found: str
    says: Text
    do: Text = ''
    live: str | None = None
    general: str = ''
    brief: Text = ''


def _each(value: Any, say: Callable[[Any], str], unit: str = '') -> str:
    """Format a number, or the range of numbers of several axes."""
    return (ranged(value, say) if isinstance(value, Span) else say(value)) + unit


def _most(value: Any) -> Any:
    """Return a number, or the largest of several axes."""
    return max(value) if isinstance(value, Span) else value


def _least(value: Any) -> Any:
    return min(value) if isinstance(value, Span) else value


def _different(value: Any) -> str:
    """Format a number, or the distinct numbers of several axes."""
    each = value if isinstance(value, Span) else (value,)
    return listed(list(dict.fromkeys(f'{one:g}' for one in each)))


def _time(seconds: Any) -> str:
    return _each(seconds, duration)


def _percent(share: Any, digits: int = 0) -> str:
    return _each(share, lambda one: f'{100 * one:.{digits}f}', ' %')


def _in_unit(value: Any, unit: str, digits: int = 3) -> str:
    """Format a value in the unit of datasheets."""
    return _each(value, lambda one: number(engineering(one, unit)[0], digits),
                 f' {engineering(1.0, unit)[1]}')


def _times(count: int) -> str:
    return 'once' if count == 1 else f'{count} times'


def _sensor(key: str) -> str:
    return SENSORS[key].lower()


def _within(factor: float) -> str:
    # From a factor of two on, an error is not given as a percentage.
    return (f'within {max(100 * (factor - 1), 1):.0f} %' if factor < 2
            else f'within a factor of {factor:.0f}')


def _band(f: Any) -> str:
    if 'low_hz' in f and 'high_hz' in f:
        return f' between {f.low_hz:g} and {f.high_hz:g} Hz'
    if 'low_hz' in f:
        return f' above {f.low_hz:g} Hz'
    return f' below {f.high_hz:g} Hz' if 'high_hz' in f else ''


def _not_steady(f: Any) -> str:
    if 'drift_ratio' in f:
        return (f'over {_time(f.interval_s)} the {f.higher} half drifts {f.drift_ratio:.1f} times '
                f'as much as the {"second" if f.higher == "first" else "first"}; numbers for a '
                'filter lie between the two')
    if 'spread_share' in f:
        return (f'noise{_band(f)} varies by {_percent(f.spread_share)} rms over segments of '
                f'{_time(f.segment_s)}')
    until = f'until {_time(f.until_s)}' if 'until_s' in f else 'at first'
    return (f'noise{_band(f)} is {_percent(f.change_share)} '
            f'{"higher" if f.higher == "first" else "lower"} {until}')


def _not_steady_brief(f: Any) -> str:
    if 'drift_ratio' in f:
        return f'the drift changed {f.drift_ratio:.1f} times'
    share = f.spread_share if 'spread_share' in f else f.change_share
    return f'the noise changed by {_percent(share)}'


def _warm_up(f: Any) -> str:
    within = f' ({_within(_most(f.time_constant_factor))})' if 'time_constant_factor' in f else ''
    second = ' and a second one' if _most(f.exponentials) > 1 else ''
    return (f'the mean settles by {f.amplitude:.3g} {f.unit} with a time constant of '
            f'{_time(f.time_constant_s)}{within}{second}. It is steady after '
            f'{_time(f.steady_after_s)}')


def _warm_up_do(f: Any) -> str:
    have = 'numbers for a filter include it'
    if 'start_s' not in f:
        return f'{have}; the recording is too short to leave it out: let the sensor warm up first'
    start_s = _most(f.start_s)
    start = f'{ceil(start_s / 60)}min' if start_s > 600 else f'{ceil(start_s)}s'
    return f'{have}; leave it out with --start {start}'


def _rate_changed(f: Any) -> str:
    change = f'the sample rate changed from {f.from_hz:.4g} to {f.to_hz:.4g} Hz'
    of = ' (the larger part)' if f.most_left_out else ''
    if 'at_s' not in f:
        return f'{change}: the {f.left_out} samples{of} at the first rate are left out'
    return (f'{change} at {f.at_s:.6g} s: the {f.left_out} samples{of} at another rate than the '
            'first are left out')


def _gravity(f: Any) -> str:
    asks = ('; is it in units of g?' if 0.95 < f.mean < 1.05 else
            '; has gravity been removed?' if f.mean < 0.5 else '')
    return f'the mean acceleration is {f.mean:.4g} m/s^2, not about 9.81{asks}'


def _implausible_what(f: Any) -> str:
    return {'mean': 'a mean', 'spread': 'a spread'}.get(f.what, 'white noise')


def _implausible(f: Any) -> str:
    likely = 'raw counts' if f.likely == 'counts' else f'{f.likely} in place of SI units'
    return (f'{_implausible_what(f)} of {f.value:.3g} {f.unit} is more than any such sensor has '
            f'at rest ({f.limit:.3g}): {likely}, or motion')


def _damaged_recording(f: Any) -> str:
    lost = f'; lost {f.lost} of {f.of} messages of {f.topic}' if 'lost' in f else ''
    if f.fault == 'chunks':
        return (f'left out {counted(f.broken, "damaged chunk")} of {f.chunks} (the first '
                f'{f.first}){lost}')
    if f.fault == 'holes':
        return f'left out {counted(f.holes, "place")} without records (the first: {f.first}){lost}'
    if f.fault == 'entries':
        return (f'{f.topic} is entered {f.entries} times; the messages of the first {f.read} '
                'entries were read')
    if f.fault == 'database':
        return (f'the database is damaged in {counted(f.places, "place")} ({f.reason}): '
                f'{counted(f.read, "message")} of {f.topic} could be read, the others are lost')
    if f.fault == 'bytes':
        return f'left out {f.bytes:,} damaged bytes'
    return (f'a file of it was left out: {f.reason}' if f.fault == 'file' else
            f'not all of it could be read{lost}')


def _truncated_recording(f: Any) -> str:
    if f.fault == 'compressed':
        return (f'the compressed file is damaged or cut short ({f.reason}); what comes before was '
                'read')
    if f.fault == 'database':
        return (f'{f.missing_bytes} of {f.bytes} bytes are missing at the end of the database '
                '(was the recorder killed, or the copy cut short?)')
    if f.fault == 'log':
        return f'the log breaks off in a message; its {f.bytes} bytes are lost'
    return (f'the recording breaks off (was the recorder killed?): {f.end}; found '
            f'{counted(f.whole_chunks, "whole chunk")}')


def _malformed_messages(f: Any) -> str:
    if f.what == 'line':
        first = f'; the first: {f.first}' if 'first' in f else ''
        return f'left out {counted(f.count, "line")} without readable numbers{first}'
    return (f'left out {counted(f.count, "invalid message")} of {f.topic} ({f.type}); the first: '
            f'{f.first}')


def _short_recording(f: Any) -> str:
    if 'samples' in f:
        are = 'is' if f.samples == 1 else 'are'
        return (f'{counted(f.samples, "sample")} in {_time(f.duration_s)} {are} too few for any '
                f'coefficient: at least {f.needed} are needed')
    return (f'{TERMS[f.coefficient].symbol} is not visible in {_time(f.duration_s)}: only an '
            'upper bound is given')


def _recordings_disagree(f: Any) -> str:
    others = 'the others' if len(f.others) > 1 else f.others[0]
    return (f'{TERMS[f.coefficient].symbol} differs between the recordings beyond error: '
            f'{_in_unit(f.value, f.unit, 4)} in {f.of_recording}, '
            f'{_in_unit(f.usual_value, f.unit, 4)} in {others}')


def _thermometer(f: Any) -> str:
    if f.fault == 'short':
        return f'the temperature covers {_percent(f.covered_share)} of the record: it is not used'
    if f.fault == 'constant':
        return 'the temperature never changes: its effect cannot be measured'
    if f.fault == 'coarse':
        return (f'the temperature comes in steps of {f.step_k:.2g} K within a range of '
                f'{f.range_k:.2g} K')
    return (f'the temperature has {counted(f.gaps, "gap")}, over which it is interpolated'
            if f.fault == 'gaps' else f'the temperature was not read: {f.reason}')


def _temperature(f: Any) -> str:
    lags = '' if 'lag_s' not in f else (
        f'. The {"thermometer" if _most(f.lag_s) > 0 else "sensor"} lags by '
        f'{_each(f.lag_s, lambda lag: duration(abs(lag)))}')
    return (f'the mean follows the temperature by {f.per_kelvin:.3g} {f.unit}/K (95 % interval '
            f'{_least(f.per_kelvin_low):.3g} to {_most(f.per_kelvin_high):.3g})'
            f'{", and not in proportion to it" if f.curved else ""}. It was '
            f'{_least(f.lowest_c):.1f} to {_most(f.highest_c):.1f} degrees Celsius{lags}')


def _rest_within_motion(f: Any) -> str:
    rests = ', '.join(f'{lasts:.4g} s at {start:.5g} s' for lasts, start in zip(
        f.durations_s, f.starts_s, strict=True))
    more = f.rests - len(f.starts_s)
    return (f'the IMU moves during {_percent(f.share)} of the samples: only the {f.rest_s:.4g} s '
            f'at rest are used. These are {rests}{f" and {more:,} more" if more > 0 else ""}')


def _uneven_stamps(f: Any) -> str:
    hidden = '' if 'hidden_share' not in f else (
        f'. Up to {_percent(f.hidden_share, 1)} of the samples may be missing unseen, and N '
        f'then up to {_percent(f.density_high_share, 1)} too high')
    off = '' if 'rate_error_share' not in f else (
        f'. The rate may be up to {_percent(f.rate_error_share, 1)} off')
    return (f'{f.clock} stamps come too unevenly to see a single missing sample: messages are '
            f'counted, only gaps that last are seen{hidden}{off}')


def _two_rates(f: Any) -> str:
    rates = [f'{rate_hz or 0:.6g} Hz' for rate_hz in f.rates_hz]
    same = len({*rates}) < len(rates)
    each = ' and '.join(f'the {_sensor(sensor)} from {topic}{"" if same else f" at {rate}"}'
                        for sensor, topic, rate in zip(f.sensors, f.topics, rates, strict=True))
    return (f'{each}{f", both at {rates[0]}" if same else ""}; rate, gaps and faults are those of '
            f'the {_sensor(f.sensors[0])}')


def _ignored_columns(f: Any) -> str:
    more = f.count - len(f.columns)
    return (f'columns that name no axis were left out: {", ".join(f.columns)}'
            f'{f", and {more:,} more" if more > 0 else ""}')


def _unfinished_recording(f: Any) -> str:
    if f.fault == 'not_regular':
        return f'{f.file} beside it is not a regular file and was not used'
    return (f'{f.file} beside it could not be used ({f.reason}); the last messages before the '
            'recorder was killed are missing or damaged')


def _again(f: Any) -> str:
    return 'copy it again, or record anew' if f.severity == 'act' else ''


WORDS: Mapping[str, Words] = {
    # the sensor does not measure
    'stood_still': Words(
        'stood still', 'The axis gave no new value for a while.',
        'One value repeats for far longer than noise does.',
        says=lambda f: f'one and the same value for {_time(f.duration_s)} from '
                       f'{_time(f.start_s)} on: the sensor or its driver stood still',
        do='no coefficient is given; analyze the rest with --start and --duration',
        live='look at the sensor and its driver, then call ~/reset',
        brief=lambda f: f'no new values for {_time(f.duration_s)}'),
    'constant_axis': Words(
        'constant', 'The axis is not connected, or its noise is below one step of its output.',
        'Every sample is the same.',
        says=lambda f: f'every sample is {_different(f.value)} {f.unit}: there is no noise to '
                       'measure',
        do='look whether the axis is connected and read out',
        brief='every sample is the same'),
    'saturated': Words(
        'saturated',
        'The output is cut off at an end of its range: the noise is higher than it seems.',
        'Many samples are at the highest or lowest value.',
        says=lambda f: f'{_percent(f.share, 1)} of the samples stand at {f.value:.6g} {f.unit}, '
                       f'the {f.end} value: the output is cut off there',
        do='no coefficient is given; choose a larger range or another position',
        live='no coefficient is given; choose a larger range or another position, then call '
             '~/reset',
        brief='the output is cut off'),
    'deadband': Words(
        'deadband', 'The driver gives small values as zero: the noise is higher than it seems.',
        'Many samples are exactly zero, none close to zero.',
        says=lambda f: f'{_percent(f.share)} of the samples are exactly 0, and none lies '
                       f'between 0 and {f.width:.3g} {f.unit}: the driver gives small values as '
                       '0',
        do='no coefficient is given; switch the deadband off',
        live='no coefficient is given; switch the deadband off, then call ~/reset',
        brief='small values are given as 0'),
    'copied_axis': Words(
        'copied axis', 'The driver gives one axis twice, and another not at all.',
        'All samples of two axes are equal.',
        says=lambda f: 'they are the same to the last digit of every sample'
                       f'{", but for the sign" if f.opposite else ""}: the driver gives one '
                       'axis twice',
        do='correct the assignment of axes in the driver',
        brief='one axis is given twice'),
    'high_passed': Words(
        'slow part removed', 'A filter has removed the bias, and slow noise with it.',
        'The spectrum falls towards low frequencies.',
        says=lambda f: f'below about {f.corner_hz:.2g} Hz the noise falls away, as behind a '
                       'filter that subtracts a bias it estimates (imu_complementary_filter '
                       'does)',
        do='only N is that of the sensor; take the raw topic',
        brief='a filter has removed slow noise'),
    'filtered': Words(
        'filtered', 'A filter has changed the samples.',
        'IMU messages of ArduPilot are those behind its filters.',
        says='IMU messages have passed the filters of the autopilot (INS_GYRO_FILTER, '
             'INS_ACCEL_FILTER)',
        do='set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the autopilot for raw samples at the '
           'full rate',
        brief='a filter has changed the samples'),
    'axis_not_finite': Words(
        'no numbers', 'The axis holds no numbers and is left out.',
        'All values are NaN or infinite, or a table has no such column.',
        says=lambda f: 'left out: the table has no such column' if 'no_column' in f else
        'left out: all values are NaN or infinite',
        do=lambda f: 'name its column with --columns' if 'no_column' in f else
        'look whether the driver fills in this axis',
        general='name its column, or look whether the driver fills in this axis',
        brief='no numbers'),
    'frozen': Words(
        'frozen sensor',
        'The sensor or its driver gave no new values for a while, which is left out.',
        'Whole messages repeat for far longer than noise does.',
        says=lambda f: f'{f.messages} messages repeat one value'
                       f'{f", first at {f.since_s:.6g} s" if "since_s" in f else ""}: the '
                       'sensor or its driver stood still, they are left out',
        do='look at the cable and the driver',
        brief='no new values for a while'),
    'unknown_rate': Words(
        'no rate', 'Without a sample rate there are no averaging times.',
        'There are too few stamps.',
        says='the sample rate is not known from so few stamps',
        do='record for longer',
        brief='the sample rate is not known'),
    # it did not rest
    'mostly_motion': Words(
        'motion', 'The IMU was not at rest: what is measured is motion.',
        'More than half of the samples are above the noise level.',
        says=lambda f: f'{_percent(f.share)} of the samples are motion',
        do='record while the sensor stands still',
        live='let the IMU rest, or set motion to keep',
        brief=lambda f: f'{_percent(f.share)} of the samples are motion'),
    'slow_motion': Words(
        'slow motion', 'A slow turn or tilt looks like slow noise.',
        'The mean leaves and returns, by more than the noise explains.',
        says=lambda f: f'the mean moves by {f.size:.2g} {f.unit} for {_time(f.duration_s)} from '
                       f'{_time(f.start_s)} on and comes back'
                       f'{f", and {f.count:d} times in all" if _most(f.count) > 1 else ""}',
        do='B and K are upper bounds; analyze the rest with --start and --duration',
        live='call ~/reset to begin anew',
        brief=lambda f: f'the mean moves away for {_time(f.duration_s)}'),
    'noise_level_changed': Words(
        'noise level changes', 'The curve describes neither of two levels of noise.',
        'The noise of all axes changes for good.',
        says=lambda f: 'the noise changed for good: ' + ', '.join(
            f'{ratio:.3g} times at about {at_s:.5g} s'
            for ratio, at_s in zip(f.ratios, f.at_s, strict=True)),
        do='analyze both levels apart with --start and --duration',
        live='call ~/reset to characterize the present level alone',
        brief='the noise changed for good'),
    'bias_step': Words(
        'bias step', 'One step of the mean, as by a knock, looks like a random walk.',
        'The mean steps once by more than the noise explains.',
        says=lambda f: f'the mean steps once, by {f.size:.3g} {f.unit} after about '
                       f'{_each(f.after_s, about)} (a knock?)',
        do='analyze before and after it with --start and --duration',
        live='call ~/reset to characterize what comes after it',
        brief=lambda f: f'the mean steps once, after about {_each(f.after_s, about)}'),
    'not_steady': Words(
        'not steady',
        'The noise was not the same all the time: a later recording may differ by as much. '
        'Where a band changes, intervals are widened.',
        'Segments differ by more than chance, band by band.',
        says=_not_steady,
        do='keep temperature, supply and vibration steady',
        live='call ~/reset once temperature, supply and vibration are steady',
        brief=_not_steady_brief),
    'warm_up': Words(
        'warming up', 'The sensor was still warming up: its mean settles exponentially. Numbers '
        'for a filter include it.',
        'One or two exponentials explain the mean better than noise.',
        says=_warm_up,
        do=_warm_up_do,
        live='call ~/reset when it is over',
        general='leave it out with --start, or let the sensor warm up first',
        brief=lambda f: f'it is steady only after about {about(_most(f.steady_after_s))}'),
    # whose messages are these
    'several_publishers': Words(
        'several publishers',
        'Two sensors share a topic: the rate is twice too high, and N wrong by any factor.',
        'Neighbouring values differ in turn.',
        says='neighbouring messages differ in turn, as those of two sensors that publish with '
             'one frame_id do',
        do='find them with ros2 topic info --verbose, and record each alone',
        live='give every IMU a topic of its own',
        brief='two sensors share the topic'),
    'alternating': Words(
        'values in turn',
        'If two sensors share the topic, the rate is twice too high and N is wrong.',
        'Means of neighbouring messages differ in turn.',
        says='the values of neighbouring messages differ in turn: a vibration at half the '
             'message rate, or two sensors that publish with one frame_id',
        do='see with ros2 topic info --verbose whether there are two publishers',
        live='give every IMU a topic of its own',
        brief='perhaps two sensors share the topic'),
    'several_frames': Words(
        'several frames', 'Several IMUs share a topic; only the first is used.',
        'Messages have different frame_id.',
        says=lambda f: f'messages of frame_id {f.frame_id!r} are used, those of ' + ', '.join(
            f'{other!r} ({rejected} messages)' for other, rejected in zip(
                f.others, f.rejected, strict=True)) + ' rejected',
        do='give every IMU a topic of its own',
        live='give every IMU a topic of its own; a change that lasts begins a new run by itself',
        brief='several IMUs share the topic'),
    'rate_changed': Words(
        'rate changed', 'Only the samples at one rate are used.',
        'The stamps advance by another step for good.',
        says=_rate_changed,
        do='analyze them by themselves with --start and --duration',
        live='a change that lasts begins a new run by itself',
        brief=lambda f: f'the sample rate changed from {f.from_hz:.4g} to {f.to_hz:.4g} Hz'),
    'clock_changed': Words(
        'clock changed', 'The header stamps became unusable; receive stamps are used from there.',
        'Header stamps stand still, jump or come in whole seconds.',
        says=lambda f: f'header stamps are {f.flaw} from about {f.since_s:.6g} s on: receive '
                       'stamps are used from there',
        do='mend the stamps of the driver',
        brief='the header stamps became unusable'),
    'clock_speed': Words(
        'speed of clocks',
        'One clock is wrong, as in a replay: averaging times may be off by their ratio.',
        'Header and receive stamps last differently long.',
        says=lambda f: f'header stamps run {f.ratio:.3g} times as fast as receive stamps, as in '
                       'a replay or a simulation',
        do='--clock header or --clock receive says which is right',
        live='mend the clock of the driver, or set clock to header',
        brief=lambda f: f'one of two clocks runs {f.ratio:.3g} times as fast'),
    'gravity': Words(
        'gravity', 'The acceleration is in another unit, or gravity was subtracted.',
        'The mean is not about 9.81 m/s^2.',
        says=_gravity,
        do='check the unit (--accel :g, of counts :g/16384) and the topic',
        live='check the unit of the driver',
        brief=lambda f: f'the mean acceleration is {f.mean:.4g} m/s^2, not 9.81'),
    'implausible': Words(
        'implausible', 'The numbers are those of another unit, of raw counts, or of motion.',
        'A mean, spread or noise density is beyond any sensor at rest.',
        says=_implausible,
        do='state the unit (--gyro, --accel; of counts :g/16384), or record it at rest',
        live='check the unit of the driver',
        brief=lambda f: f'{_implausible_what(f)} of {f.value:.3g} {f.unit} is implausible'),
    # messages are lost
    'many_missing': Words(
        'many missing', 'So many samples are interpolated that N may be off.',
        'Places in the time grid are empty.',
        says=lambda f: f'{_percent(f.share, 1)} of the samples are missing and interpolated' + (
            '' if 'density_error_share' not in f else
            f': N may be up to {_percent(f.density_error_share)} off'),
        do='record with a deeper queue or with reliable delivery',
        live='set a deeper queue or reliable delivery with qos_overrides',
        brief=lambda f: f'{_percent(f.share)} of the samples are missing'),
    'spikes': Words(
        'outliers', 'Single outliers are left out.',
        'Samples lie ten times the noise from their neighbours.',
        says=lambda f: (
            f'{counted(f.messages, "single message holds", "single messages hold")} outliers, '
            f'ten times the noise and more, and {"is" if f.messages == 1 else "are"} left out'),
        do='look for errors on the bus of the sensor, or for knocks'),
    'field_absent': Words(
        'absent field', 'Some messages lack a sensor and are left out.',
        'Their covariance[0] is -1: not provided.',
        says=lambda f: f'{f.messages} messages declare angular velocity or linear acceleration '
                       'as not provided (covariance[0] is -1), others do not: they are left out',
        do='let the driver fill in both, or publish them apart',
        brief='some messages lack a sensor'),
    'axis_absent_in_part': Words(
        'absent in part', 'The record of this axis is shorter.',
        'Values are NaN for a while, or declared absent.',
        says=lambda f: f'no values in {f.absent:d} of {f.messages} messages (NaN, or '
                       'covariance[0] is -1)',
        do='look at the cable and the driver of this axis'),
    'interpolated': Words(
        'interpolated',
        'The driver interpolates one sensor: its white noise is a third too low and not white.',
        'The samples lie on lines between fewer.',
        says=lambda f: f'the {_sensor(f.half)} samples of topic {f.topic} are interpolated '
                       'between fewer',
        do='switch uniting off in the driver (RealSense: unite_imu_method 0)',
        brief='the driver interpolates it'),
    'damaged_recording': Words(
        'damaged recording', 'Part of the recording cannot be read; the rest is used.',
        'Checksums or places in the file are wrong.',
        says=_damaged_recording,
        do=_again, general='copy it again',
        brief='most of the recording is damaged'),
    'truncated_recording': Words(
        'truncated recording', 'The recording ends too early; what comes before is used.',
        'The file ends inside a record.',
        says=_truncated_recording,
        do=_again, general='copy it again',
        brief='most of the recording is missing'),
    'lost_messages': Words(
        'lost messages', 'Fewer messages were found than recorded.',
        'metadata.yaml counts more, or numbers of messages are missing.',
        says=lambda f: f'{f.found} of the {f.counted} messages of {f.topic} '
                       + ('that metadata.yaml counts were found' if f.by != 'numbers' else
                          'by their numbers were recorded'),
        do=_again, general='copy it again',
        brief='most messages are lost'),
    'missing_file': Words(
        'missing file', 'Files of the recording are missing; the others are used.',
        'metadata.yaml lists them.',
        says=lambda f: f'{f.missing} of {f.listed} files that metadata.yaml lists cannot be '
                       f'found: {f.files}; the others were read',
        do=_again, general='copy it again',
        brief='most files are missing'),
    'malformed_messages': Words(
        'malformed messages', 'Messages that are no IMU messages are left out.',
        'They are too short, or hold no numbers.',
        says=_malformed_messages,
        brief=lambda f: f'most {f.what}s cannot be read'),
    # what the model explains
    'short_recording': Words(
        'short recording',
        'The record is too short to show this coefficient: it lies below the bound.',
        'Its interval reaches to zero.',
        says=_short_recording,
        do='record for longer',
        live='wait, or let it run overnight'),
    'poor_fit': Words(
        'poor fit', 'The noise is no sum of the terms that are fitted: intervals are widened.',
        'Spectrum or curve leave the model by more than chance.',
        says=lambda f: (
            'no sum of noise terms describes this spectrum: the best is off by '
            f'{_percent(f.misfit_share)}' if 'leaves_at_s' not in f else
            f'from averaging times of {_time(f.leaves_at_s)} on the curve leaves the band of the '
            'model'),
        do='look for vibration, or a filter in the sensor or driver',
        brief='no noise model fits'),
    'recordings_disagree': Words(
        'recordings disagree', 'The recordings are not of one noise.',
        'A coefficient differs by more than its errors.',
        says=_recordings_disagree,
        do='the interval is widened; look at what was different in that recording',
        brief='the recordings disagree'),
    'thermometer': Words(
        'thermometer', 'The temperature cannot be used, or only partly.',
        'Its readings are few, constant, coarse or with gaps.',
        says=_thermometer,
        do='record the temperature all the time and finely, or leave it out'),
    'trend_or_walk': Words(
        'trend or random walk',
        'The slowest part may be a random walk or deterministic drift: K is an upper bound.',
        'Models with and without a random walk explain the data equally well.',
        says='the slowest part of the signal may be a random walk or a deterministic drift: K '
             'is given as an upper bound',
        do='record for longer, the sensor warm and at one temperature'),
    'power_law': Words(
        'no flicker', 'The slow noise has another slope than flicker: B is an upper bound.',
        'An exponent other than 1 explains the spectrum better.',
        says=lambda f: 'the slow noise is no flicker: its density goes with 1/f to the power of '
                       f'{f.exponent:.2f} (95 % interval {_least(f.exponent_low):.2f} to '
                       f'{_most(f.exponent_high):.2f})',
        do='for a filter take the tuned numbers: N and K alone leave this noise out'),
    'band_limited': Words(
        'low-pass',
        'Sensor or driver filter the fast noise; the coefficients are those below the filter.',
        'The spectrum falls towards the highest frequencies.',
        says=lambda f: (
            'the noise rolls off towards the highest frequencies (a low-pass in sensor or '
            f'driver). Its effective window is {f.window_s:.3g} s' if 'edge_hz' not in f else
            f'the spectrum falls above {f.edge_hz:.3g} Hz (a low-pass in sensor or driver, or '
            'noise that no term describes); the coefficients are fitted below')),
    'gauss_markov': Words(
        'correlated noise', 'Part of the slow noise levels off after a correlation time.',
        'A first-order Gauss-Markov process explains the spectrum better.',
        says=lambda f: f'a first-order Gauss-Markov process of {f.sigma:.3g} {f.unit} with a '
                       f'correlation time of {f.correlation_time_s:.3g} s is part of the noise'),
    'temperature': Words(
        'temperature', 'The mean follows the temperature; that part is no noise.',
        'The readings of the thermometer explain the mean better than noise.',
        says=_temperature,
        do='coefficients are given without the temperature, numbers for a filter with it'),
    'slow_cycle': Words(
        'slow cycle', 'The mean follows a slow cycle; that part is no noise.',
        'A slow sine explains the mean better than noise.',
        says=lambda f: f'the mean follows a slow cycle of about {_each(f.period_s, about)}' + (
            ", such as a heater's" if _most(f.period_s) > 29.999 else ''),
        do='coefficients are given without it, numbers for a filter with it'),
    'coarse_resolution': Words(
        'coarse steps', 'What lies below one step is hidden; noise below half of it, too.',
        'The smallest step is larger than the noise of a sample.',
        says=lambda f: f'the output steps by {f.step:.3g} {f.unit}, {f.ratio:.1f} times the '
                       'noise of one sample: ' + (
                           'N depends on where the mean lies within the step'
                           if _most(f.ratio) > 1.9 else 'what lies below the step is hidden'),
        do='choose a smaller range of the sensor'),
    'tones': Words(
        'tones', 'Vibration, mains or a converter: not noise, and left out of the fit.',
        'Narrow lines stand above the spectrum.',
        says=lambda f: f'{f.count:d} {"lines" if _most(f.count) > 1 else "line"}, the strongest '
                       f'at {f.frequency_hz:.4g} Hz ({_in_unit(f.amplitude, f.unit)}), left out '
                       'of the fit' + (
                           '. One at half the message rate is a vibration, or two sensors publish '
                           'in turn' if _most(f.half_rate) else '')),
    'turn_on_bias': Words(
        'turn-on bias', 'The bias differs from one power-on to the next.',
        'Means of the recordings differ by more than they drift in one.',
        says=lambda f: 'the mean differs from recording to recording by '
                       f'{_in_unit(f.sigma, f.unit)} beyond what it drifts in one '
                       f'({_in_unit(f.sigma_low, f.unit)} to {_in_unit(f.sigma_high, f.unit)})'),
    # what was done about it
    'motion': Words(
        'motion', 'Motion and knocks are left out.',
        'The noise rises for a moment.',
        says=lambda f: f'motion or knocks were cut out {_times(f.count)}, {_time(f.excluded_s)} '
                       'in all'),
    'rest_within_motion': Words(
        'rest within motion', 'Only the time at rest is used.',
        'Between motions the noise is steady for five seconds and more.',
        says=_rest_within_motion),
    'motion_kept': Words(
        'motion kept', 'Motion is part of what was measured, as asked for.',
        'The noise rises for a moment.',
        says=lambda f: f'motion or knocks were seen {_times(f.count)}, {_time(f.seen_s)} in all, '
                       f'first at {_time(f.first_s)}, and kept as asked',
        do='coefficients and bounds describe them as much as the noise'),
    'motion_not_listed': Words(
        'motion not listed', 'The result lists the first spans of motion only.',
        'There are more.',
        says=lambda f: f'only the first {f.listed} spans of motion are listed'),
    'receive_clock': Words(
        'receive clock', 'Receive stamps are used, which are less even.',
        'Header stamps are zero, constant or coarse.',
        says=lambda f: (
            'header stamps come in ticks or batches: receive stamps, which come evenly, are used'
            if 'flaw' not in f else f'header stamps are {f.flaw}: receive stamps are used')),
    'counted_samples': Words(
        'counted samples', 'No stamps are used: missing samples cannot be seen.',
        'Neither clock is usable, or none was asked for.',
        says=lambda f: f'no usable stamps: samples are counted at the stated {f.rate_hz:g} Hz, '
                       'and missing ones cannot be seen'),
    'uneven_stamps': Words(
        'uneven stamps', 'Single missing samples cannot be seen.',
        'The stamps scatter by a good part of the interval.',
        says=_uneven_stamps,
        do='let the driver stamp each sample when it is taken'),
    'uneven_rate': Words(
        'uneven rate',
        'The rate varies: averaging times are off by up to so much, N by half of it.',
        'The rate differs between segments.',
        says=lambda f: f'the sample rate varies between {f.lowest_hz:.5g} and '
                       f'{f.highest_hz:.5g} Hz: {f.mean_hz:.5g} Hz, its mean, is used. '
                       f'Averaging times may be up to {_percent(f.tau_error_share, 1)} off and '
                       'N half as much',
        do='let the sensor set the rate, not a timer of the driver'),
    'clock_jumps': Words(
        'clock jumps', 'The record is in several segments; no difference is taken across a jump.',
        'A stamp and all that follow lie far from where the rate puts them.',
        says=lambda f: f'the {f.clock} stamps jumped {_times(f.count)}: no difference is taken '
                       'across a jump'),
    'gaps_not_listed': Words(
        'gaps not listed', 'The result lists the first gaps only.',
        'There are more.',
        says=lambda f: f'{f.gaps} gaps of {f.gaps_s:.6g} s in all; only the first {f.listed} '
                       'are listed'),
    'held_values': Words(
        'held values', 'The driver polls the sensor faster than it samples.',
        'Messages repeat all values of the one before.',
        says=lambda f: f'{_percent(f.share)} of the messages repeat the values of the one '
                       'before: the sensor is polled faster than it samples',
        do='its own rate is used and the repeats are left out'),
    'late_start': Words(
        'late start', 'The first messages hold nothing and are left out.',
        'They repeat one value, or none.',
        says=lambda f: f'the first {f.messages} messages hold one value or none: the sensor had '
                       'not started yet, they are left out'),
    'axis_late_start': Words(
        'late axis', 'The record of this axis begins later.',
        'It holds one value at first.',
        says=lambda f: f'one value for the first {f.late:d} of {f.messages} messages: the axis '
                       'had not started yet'),
    'unit_g': Words(
        'unit g', 'Acceleration in g was converted to m/s^2.',
        'Its magnitude is near 1.',
        says='the magnitude of the acceleration is near 1: taken as g, not m/s^2',
        do='--accel :g says so, --accel :m/s^2 takes the numbers as they are',
        live='set accel_unit to g or to m/s^2'),
    'two_rates': Words(
        'separate sensors', 'Gyroscope and accelerometer each have their own rate.',
        'By topics, or repeated values.',
        says=_two_rates),
    'repeated_half': Words(
        'repeated half', 'One sensor repeats its values between new ones of the other.',
        'Its values change at a rate of their own.',
        says=lambda f: (
            f'topic {f.topic} repeats its {_sensor(f.half)} samples between new ones'
            if 'half' in f else f'each message of topic {f.topic} repeats one of its halves'),
        do='each sensor is analyzed at its own rate'),
    'chosen_topic': Words(
        'chosen topic', 'Of several IMU topics one was chosen.',
        'By its name and kind.',
        says=lambda f: f'of {f.topics} IMU topics {" and ".join(f.chosen)} '
                       f'{"are" if len(f.chosen) > 1 else "is"} read, {f.reason}; the others: '
                       f'{", ".join(f.others)}',
        do='choose others with --topic, or --gyro-topic and --accel-topic'),
    'short_part': Words(
        'short part', 'Less is recorded than was asked for.',
        'The recording ends before.',
        says=lambda f: f'only {_time(f.recorded_s)} of the {_time(f.asked_s)} asked for are '
                       'recorded'),
    'ignored_columns': Words(
        'ignored columns', 'Columns of the table are not used.',
        'Their names are not those of axes.',
        says=_ignored_columns,
        do='--columns gyro_x=NAME,accel_x=NAME,time=NAME says which columns are what'),
    'repeated_part': Words(
        'repeated part', 'A part that comes twice counts once.',
        'Stamps and values repeat those before.',
        says=lambda f: f'left out {counted(f.messages, "message")} whose stamps and values repeat '
                       'those of earlier ones'),
    'many_definitions': Words(
        'many definitions', 'The descriptions of topics are too long to be true.',
        'Their bytes are counted.',
        says='what it says about its topics is longer than any recorder writes; the topics '
             'from there on are not read'),
    'no_metadata': Words(
        'no metadata', 'The folder has no usable metadata.yaml; the files found are read.',
        'It is missing or damaged.',
        says=lambda f: (
            'no metadata.yaml (was the recorder killed?); the files found were read'
            if 'reason' not in f else
            f'metadata.yaml is damaged ({f.reason}); the files found were read')),
    'unfinished_recording': Words(
        'unfinished recording', 'The recorder was killed; its last messages may be missing.',
        'A journal of the database lies beside it.',
        says=_unfinished_recording),
}
"""The texts by code, in the order in which findings are shown."""
