# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Texts for every code of a finding, in the order of `imu_allan.finding.CODES`.

A text is a template with the values of a finding in braces, as for `str.format`; after the colon
may also stand a form of `imu_allan.finding_messages`. A part in square brackets is left out if its
first value is unknown. Of several templates, the first is used of which all values are known.

Where more than that decides, a function returns the template. Its `f` holds the known values, and
the severity. A value that differs between axes is formatted as a range from lowest to highest.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Figures = Mapping[str, Any]
Text = str | tuple[str, ...] | Callable[[Figures], str]
"""A template, several of them, or a function that returns one."""


class Span(tuple[Any, ...]):
    """Values of several axes."""


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
        Advice independent of the values, if `do` depends on them; for docs/findings.md.
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


def most(value: Any) -> Any:
    """Return a number, or the largest of several axes."""
    return max(value) if isinstance(value, Span) else value


def _gravity(f: Figures) -> str:
    asks = ('; is it in units of g?' if 0.95 < f['mean'] < 1.05 else
            '; has gravity been removed?' if f['mean'] < 0.5 else '')
    return f'the mean acceleration is {{mean:4}} m/s^2, not about 9.81{asks}'


def _implausible_what(f: Figures) -> str:
    what = {'mean': 'a mean', 'spread': 'a spread'}.get(f['what'], 'white noise')
    return f'{what} of {{value:.3g}} {{unit}} is'


def _poor_fit(f: Figures) -> str:
    share = f.get('misfit_share')
    return 'no sum of noise terms ' + (
        'describes more than a small part of this spectrum' if share is None else
        'describes this spectrum: the best is off by {misfit_share:%}' if most(share) < 10 else
        'comes within a factor of ten of this spectrum')


def _implausible(f: Figures) -> str:
    likely = 'raw counts' if f['likely'] == 'counts' else '{likely} in place of SI units'
    return (f'{_implausible_what(f)} more than any such sensor has at rest ({{limit:.3g}}): '
            f'{likely}, or motion')


def _temperature(f: Figures) -> str:
    lags = '' if 'lag_s' not in f else '. The {} lags by {{lag_s:lag}}'.format(
        'thermometer' if most(f['lag_s']) > 0 else 'sensor')
    return ('the mean follows the temperature by {per_kelvin:.3g} {unit}/K (95 % interval '
            '{per_kelvin_low:least .3g} to {per_kelvin_high:most .3g})'
            '. It was {lowest_c:least .1f} to '
            f'{{highest_c:most .1f}} degrees Celsius{lags}')


def _rest_within_motion(f: Figures) -> str:
    rests = ', '.join(f'{lasts:.4g} s at {round(start, 3):.5g} s' for lasts, start in zip(
        f['durations_s'], f['starts_s'], strict=True))
    more = f['rests'] - len(f['starts_s'])
    return ('the IMU moves during {share:%} of the samples: only the {rest_s:.4g} s at rest are '
            f'used. These are {rests}{f" and {more:,} more" if more > 0 else ""}')


def _two_rates(f: Figures) -> str:
    rates = [f'{rate_hz or 0:.6g} Hz' for rate_hz in f['rates_hz']]
    first, second = ('', f', both at {rates[0]}') if len({*rates}) == 1 else (
        f' at {rate}' for rate in rates)
    return (f'the {{sensors[0]:sensor}} from {{topics[0]}}{first} and the {{sensors[1]:sensor}} '
            f'from {{topics[1]}}{second}; rate, gaps and faults are those of the '
            '{sensors[0]:sensor}')


def _again(f: Figures) -> str:
    return 'copy it again, or record anew' if f['severity'] == 'act' else ''


def _by_fault(**templates: str) -> Callable[[Figures], str]:
    return lambda f: templates[f['fault']]


WORDS: Mapping[str, Words] = {
    # the sensor does not measure
    'stood_still': Words(
        'stood still', 'The axis gave no new value for a while.',
        'One value repeats for far longer than noise does.',
        says='one and the same value for {duration_s:time} from {start_s:time} on: the sensor or '
             'its driver stood still',
        do='no coefficient is given; analyze the rest with --start and --duration',
        live='look at the sensor and its driver, then call ~/reset',
        brief='no new values for {duration_s:time}'),
    'constant_axis': Words(
        'constant', 'The axis is not connected, or its noise is below one step of its output.',
        'Every sample is the same.',
        says='every sample is {value:each} {unit}: there is no noise to measure',
        do='look whether the axis is connected and read out', brief='every sample is the same'),
    'saturated': Words(
        'saturated',
        'The output is cut off at an end of its range: the noise is higher than it seems.',
        'Many samples are at the highest or lowest value.',
        says='{share:.1%} of the samples stand at {value:.6g} {unit}, the {end} value: the output '
             'is cut off there',
        do='no coefficient is given; choose a larger range or another position',
        live='no coefficient is given; choose a larger range or another position, then call '
             '~/reset',
        brief='the output is cut off'),
    'deadband': Words(
        'deadband', 'The driver gives small values as zero: the noise is higher than it seems.',
        'Many samples are exactly zero, none close to zero.',
        says='{share:%} of the samples are exactly 0, and none lies between 0 and {width:.3g} '
             '{unit}: the driver gives small values as 0',
        do='no coefficient is given; switch the deadband off',
        live='no coefficient is given; switch the deadband off, then call ~/reset',
        brief='small values are given as 0'),
    'high_passed': Words(
        'slow part removed', 'A filter has removed the bias, and slow noise with it.',
        'The spectrum falls towards low frequencies.',
        says='below about {corner_hz:.2g} Hz the noise falls away, as behind a filter that '
             'subtracts a bias it estimates (imu_complementary_filter does)',
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
        says=lambda f: ('left out: the table has no such column' if 'no_column' in f else
                        'left out: all values are NaN or infinite'),
        do=lambda f: ('name its column with --columns' if 'no_column' in f else
                      'look whether the driver fills in this axis'),
        general='name its column, or look whether the driver fills in this axis',
        brief='no numbers'),
    'frozen': Words(
        'frozen sensor',
        'The sensor or its driver gave no new values for a while, which is left out.',
        'Whole messages repeat for far longer than noise does.',
        says='{messages} messages repeat one value[, first at {since_s:.6g} s]: the sensor or its '
             'driver stood still, they are left out',
        do='look at the cable and the driver', brief='no new values for a while'),
    'unknown_rate': Words(
        'no rate', 'Without a sample rate there are no averaging times.',
        'There are too few stamps.', says='the sample rate is not known from so few stamps',
        do='record for longer', brief='the sample rate is not known'),
    # it did not rest
    'mostly_motion': Words(
        'motion', 'The IMU was not at rest: what is measured is motion.',
        'More than half of the samples are above the noise level.',
        says='{share:%} of the samples are motion', do='record while the sensor stands still',
        live='let the IMU rest, or set motion to keep',
        brief='{share:%} of the samples are motion'),
    'slow_motion': Words(
        'slow motion', 'A slow turn or tilt looks like slow noise.',
        'The mean leaves and returns, by more than the noise explains.',
        says='the mean moves by {size:.2g} {unit} for {duration_s:time} from {start_s:time} on '
             'and comes back{count:one |, and {count:d} times in all}',
        do='B and K are upper bounds; analyze the rest with --start and --duration',
        live='call ~/reset to begin anew', brief='the mean moves away for {duration_s:time}'),
    'noise_level_changed': Words(
        'noise level changes', 'The curve describes neither of two levels of noise.',
        'The noise of all axes changes for good.',
        says=lambda f: 'the noise changed for good: ' + ', '.join(
            f'{ratio:.3g} times at about {at_s:.5g} s'
            for ratio, at_s in zip(f['ratios'], f['at_s'], strict=True)),
        do='analyze both levels apart with --start and --duration',
        live='call ~/reset to characterize the present level alone',
        brief='the noise changed for good'),
    'bias_step': Words(
        'bias step', 'One step of the mean, as by a knock, looks like a random walk.',
        'The mean steps once by more than the noise explains.',
        says='the mean steps once, by {size:.3g} {unit} after about {after_s:about} (a knock?)',
        do='analyze before and after it with --start and --duration',
        live='call ~/reset to characterize what comes after it',
        brief='the mean steps once, after about {after_s:about}'),
    'not_steady': Words(
        'not steady',
        'The noise was not the same all the time: a later recording may differ by as much. Where '
        'a band changes, intervals are widened.',
        'Segments differ by more than chance, band by band.',
        says=('noise between {low_hz:2} and {high_hz:2} Hz varies by {spread_share:%} rms '
              'over segments of {segment_s:time}',
              'noise[ above {low_hz:2} Hz][ below {high_hz:2} Hz] varies by {spread_share:%} '
              'rms over segments of {segment_s:time}'),
        do='keep temperature, supply and vibration steady',
        live='call ~/reset once temperature, supply and vibration are steady',
        brief='the noise changed by {spread_share:%}'),
    'warm_up': Words(
        'warming up',
        'The sensor was still warming up: its mean settles exponentially. Numbers for a filter '
        'include it.',
        'One or two exponentials explain the mean better than noise.',
        says='the mean settles by {amplitude:.3g} {unit} with a time constant of '
             '{time_constant_s:time}[ ({time_constant_factor:most within})]'
             '{exponentials:one | and a second one}. It is steady after {steady_after_s:time}',
        do=('numbers for a filter include it; leave it out with --start {start_s:most start}',
            'numbers for a filter include it; the recording is too short to leave it out: let the '
            'sensor warm up first'),
        live='call ~/reset when it is over',
        general='leave it out with --start, or let the sensor warm up first',
        brief='it is steady only after about {steady_after_s:most about}'),
    # whose messages are these
    'several_publishers': Words(
        'several publishers',
        'If two sensors share the topic, the rate is twice too high, and N wrong by any factor.',
        'Neighbouring values differ in turn.',
        says='neighbouring messages differ in turn: two sensors that publish with one frame_id, '
             'or a vibration at half the message rate',
        do='look with ros2 topic info --verbose for two publishers, and record each alone',
        live='give every IMU a topic of its own', brief='perhaps two sensors share the topic'),
    'several_frames': Words(
        'several frames', 'Several IMUs share a topic; only the first is used.',
        'Messages have different frame_id.',
        says=lambda f: 'messages of frame_id {frame_id!r} are used, those of ' + ', '.join(
            f'{{others[{i}]!r}} ({{rejected[{i}]}} messages)'
            for i in range(max(len(f['others']), len(f['rejected'])))) + ' rejected',
        do='give every IMU a topic of its own',
        live='give every IMU a topic of its own; a change that lasts begins a new run by itself',
        brief='several IMUs share the topic'),
    'rate_changed': Words(
        'rate changed', 'Only the samples at one rate are used.',
        'The stamps advance by another step for good.',
        says=lambda f: (
            'the sample rate changed from {from_hz:.4g} to {to_hz:.4g} Hz[ at {at_s:.6g} s]: the '
            '{left_out} samples{most_left_out:if  (the larger part)} at '
            f'{"another rate than the first" if "at_s" in f else "the first rate"} are left out'),
        do='analyze them by themselves with --start and --duration',
        live='a change that lasts begins a new run by itself',
        brief='the sample rate changed from {from_hz:.4g} to {to_hz:.4g} Hz'),
    'clock_changed': Words(
        'clock changed', 'The header stamps became unusable; receive stamps are used from there.',
        'Header stamps stand still, jump or come in whole seconds.',
        says='header stamps are {flaw} from about {since_s:.6g} s on: receive stamps are used '
             'from there',
        do='mend the stamps of the driver', brief='the header stamps became unusable'),
    'clock_speed': Words(
        'speed of clocks',
        'One clock is wrong, as in a replay: averaging times may be off by their ratio.',
        'Header and receive stamps last differently long.',
        says='header stamps run {ratio:.3g} times as fast as receive stamps, as in a replay or a '
             'simulation',
        do='--clock header or --clock receive says which is right',
        live='mend the clock of the driver, or set clock to header',
        brief='one of two clocks runs {ratio:.3g} times as fast'),
    'gravity': Words(
        'gravity', 'The acceleration is in another unit, or gravity was subtracted.',
        'The mean is not about 9.81 m/s^2.', says=_gravity,
        do='check the unit (--accel :g, of counts :g/16384) and the topic',
        live='check the unit of the driver',
        brief='the mean acceleration is {mean:4} m/s^2, not 9.81'),
    'implausible': Words(
        'implausible', 'The numbers are those of another unit, of raw counts, or of motion.',
        'A mean, spread or noise density is beyond any sensor at rest.', says=_implausible,
        do='state the unit (--gyro, --accel; of counts :g/16384), or record it at rest',
        live='check the unit of the driver',
        brief=lambda f: f'{_implausible_what(f)} implausible'),
    # messages are lost
    'many_missing': Words(
        'many missing', 'So many samples are interpolated that N may be off.',
        'Places in the time grid are empty.',
        says='{share:.1%} of the samples are missing and interpolated[: N may be up to '
             '{density_error_share:%} off]',
        do='record with a deeper queue or with reliable delivery',
        live='set a deeper queue or reliable delivery with qos_overrides',
        brief='{share:%} of the samples are missing'),
    'spikes': Words(
        'outliers', 'Single outliers are left out.',
        'Samples lie ten times the noise from their neighbours.',
        says='{messages:,} single {messages:one message holds|messages hold} outliers, ten times '
             'the noise and more, and {messages:one is|are} left out',
        do='look for errors on the bus of the sensor, or for knocks'),
    'field_absent': Words(
        'absent field', 'Some messages lack an axis that others have.',
        'Values are NaN, or covariance[0] is -1: not provided.',
        says='{messages} messages have values on other axes than the first ones (NaN, or '
             'covariance[0] is -1). Axes that the first lack are not used, nor are messages that '
             'lack others',
        do='let the driver fill in both sensors in each message, or publish them apart',
        brief='some messages lack an axis'),
    'interpolated': Words(
        'interpolated',
        'The driver interpolates one sensor: its white noise is a third too low and not white.',
        'The samples lie on lines between fewer.',
        says='the {half:sensor} samples of topic {topic} are interpolated between fewer',
        do='switch uniting off in the driver (RealSense: unite_imu_method 0)',
        brief='the driver interpolates it'),
    'damaged_recording': Words(
        'damaged recording', 'Part of the recording cannot be read; the rest is used.',
        'Checksums or places in the file are wrong.',
        says=_by_fault(
            places='left out {places:count damaged place} (the first {first})[; lost {lost} of '
                   '{of} messages of {topic}]',
            database='the database is damaged ({reason}): {read:count message} of {topic} could '
                     'be read, the rest is lost',
            bytes='left out {bytes:,} damaged bytes',
            file='a file of it was left out: {reason}',
            unread='not all of it could be read[; lost {lost} of {of} messages of {topic}]'),
        do=_again, general='copy it again', brief='most of the recording is damaged'),
    'truncated_recording': Words(
        'truncated recording', 'The recording ends too early; what comes before is used.',
        'The file ends inside a record.',
        says=_by_fault(
            compressed='the compressed file is damaged or cut short ({reason}); what comes before '
                       'was read',
            database='{missing_bytes} of {bytes} bytes are missing at the end of the database '
                     '(was the recorder killed, or the copy cut short?)',
            log='the log breaks off in a message; its {bytes} bytes are lost',
            ends='the recording breaks off (was the recorder killed?): {end}; found '
                 '{whole_chunks:count whole chunk}'),
        do=_again, general='copy it again', brief='most of the recording is missing'),
    'lost_messages': Words(
        'lost messages', 'Fewer messages were found than recorded.', 'metadata.yaml counts more.',
        says='{found} of the {counted} messages of {topic} that metadata.yaml counts were found',
        do=_again, general='copy it again', brief='most messages are lost'),
    'missing_file': Words(
        'missing file', 'Files of the recording are missing; the others are used.',
        'metadata.yaml lists them.',
        says='{missing} of {listed} files that metadata.yaml lists cannot be found: {files}; the '
             'others were read',
        do=_again, general='copy it again', brief='most files are missing'),
    'malformed_messages': Words(
        'malformed messages', 'Messages that are no IMU messages are left out.',
        'They are too short, or hold no numbers.',
        says=lambda f: (
            'left out {count:count line} without readable numbers[; the first: {first}]'
            if f['what'] == 'line' else
            'left out {count:count invalid message} of {topic} ({type}); the first: {first}'),
        brief='most {what}s cannot be read'),
    # what the model explains
    'short_recording': Words(
        'short recording',
        'The record is too short to show this coefficient: it lies below the bound.',
        'Its interval reaches to zero.',
        says=('{samples:count sample} in {duration_s:time} {samples:one is|are} too few for any '
              'coefficient: at least {needed} are needed',
              '{coefficient:term} is not visible in {duration_s:time}: only an upper bound is '
              'given'),
        do='record for longer', live='wait, or let it run overnight',
        brief='{samples:count sample} in {duration_s:time}'),
    'poor_fit': Words(
        'poor fit', 'The noise is no sum of the terms that are fitted: intervals are widened.',
        'The spectrum leaves the model by more than chance.',
        # A signal without noise leaves only rounding, and a model that is off by its range.
        says=_poor_fit,
        do='look for vibration, or a filter in the sensor or driver', brief='no noise model fits'),
    'recordings_disagree': Words(
        'recordings disagree', 'The recordings are not of one noise.',
        'A coefficient differs by more than its errors.',
        says=lambda f: (
            '{coefficient:term} differs between the recordings beyond error: {value:4 in {unit}} '
            'in {of_recording}, {usual_value:4 in {unit}} in '
            + ('the others' if len(f['others']) > 1 else '{others[0]}')),
        do='the interval is widened; look at what was different in that recording',
        brief='the recordings disagree'),
    'thermometer': Words(
        'thermometer', 'The temperature cannot be used.', 'Its readings are few or constant.',
        says=_by_fault(
            short='the temperature covers {covered_share:%} of the record: it is not used',
            constant='the temperature has not changed: its effect cannot be measured',
            unread='the temperature was not read: {reason}'),
        do='record the temperature all the time and finely, or leave it out',
        live='publish the temperature all the time and finely'),
    'trend_or_walk': Words(
        'trend or random walk',
        'The slowest part may be a random walk or deterministic drift: K is an upper bound.',
        'Models with and without a random walk explain the data equally well.',
        says='the slowest part of the signal may be a random walk or a deterministic drift: K is '
             'given as an upper bound',
        do='record for longer, the sensor warm and at one temperature'),
    'power_law': Words(
        'no flicker', 'The slow noise has another slope than flicker: B is an upper bound.',
        'An exponent other than 1 explains the spectrum better.',
        says='the slow noise is no flicker: its density goes with 1/f to the power of '
             '{exponent:.2f} (95 % interval {exponent_low:least .2f} to {exponent_high:most .2f})',
        do='for a filter take the tuned numbers: N and K alone leave this noise out'),
    'band_limited': Words(
        'low-pass',
        'Sensor or driver filter the fast noise; the coefficients are those below the filter.',
        'The spectrum falls towards the highest frequencies, or no term describes them.',
        says=('no term describes the spectrum above {edge_hz:.3g} Hz (a low-pass in sensor or '
              'driver, or other noise); the coefficients are fitted below',
              'the noise rolls off towards the highest frequencies (a low-pass in sensor or '
              'driver). Its effective window is {window_s:.3g} s')),
    'gauss_markov': Words(
        'correlated noise', 'Part of the slow noise levels off after a correlation time.',
        'A first-order Gauss-Markov process explains the spectrum better.',
        says='a first-order Gauss-Markov process of {sigma:.3g} {unit} with a correlation time of '
             '{correlation_time_s:.3g} s is part of the noise'),
    'temperature': Words(
        'temperature', 'The mean follows the temperature; that part is no noise.',
        'The readings of the thermometer explain the mean better than noise.', says=_temperature,
        do='coefficients are given without the temperature, numbers for a filter with it'),
    'slow_cycle': Words(
        'slow cycle', 'The mean follows a slow cycle; that part is no noise.',
        'A slow sine explains the mean better than noise.',
        says=lambda f: 'the mean follows a slow cycle of about {period_s:about}' + (
            ", such as a heater's" if most(f['period_s']) > 29.999 else ''),
        do='coefficients are given without it, numbers for a filter with it'),
    'coarse_resolution': Words(
        'coarse steps', 'What lies below one step is hidden; noise below half of it, too.',
        'The smallest step is larger than the noise of a sample.',
        says=lambda f: (
            'the output steps by {step:.3g} {unit}, {ratio:.1f} times the noise of one sample: '
            + ('N depends on where the mean lies within the step' if most(f['ratio']) > 1.9 else
               'what lies below the step is hidden')),
        do='choose a smaller range of the sensor'),
    'tones': Words(
        'tones', 'Vibration, mains or a converter: not noise, and left out of the fit.',
        'Narrow lines stand above the spectrum.',
        says='{count:d} {count:one line|lines}, the strongest at {frequency_hz:.4g} Hz '
             '({amplitude:3 in {unit}}), left out of the fit{half_rate:if . One at half the '
             'message rate is a vibration, or two sensors publish in turn}'),
    'turn_on_bias': Words(
        'turn-on bias', 'The bias differs from one power-on to the next.',
        'Means of the recordings differ by more than they drift in one.',
        says='the mean differs between recordings by {sigma:3 in {unit}} beyond its drift in '
             'one (95 % interval {sigma_low:least 3 in {unit}} to {sigma_high:most 3 in {unit}})'),
    # what was done about it
    'motion': Words(
        'motion', 'Motion and knocks are left out.', 'The noise rises for a moment.',
        says='motion or knocks were cut out {count:times}, {excluded_s:time} in all'),
    'rest_within_motion': Words(
        'rest within motion', 'Only the time at rest is used.',
        'Between motions the noise is steady for five seconds and more.',
        says=_rest_within_motion),
    'motion_kept': Words(
        'motion kept', 'Motion is part of what was measured, as asked for.',
        'The noise rises for a moment.',
        says='motion or knocks were seen {count:times}, {seen_s:time} in all, first at '
             '{first_s:time}, and kept as asked',
        do='coefficients and bounds describe them as much as the noise'),
    'receive_clock': Words(
        'receive clock', 'Receive stamps are used, which are less even.',
        'Header stamps are zero, constant or coarse.',
        says=('header stamps are {flaw}: receive stamps are used',
              'header stamps come in ticks or batches: receive stamps, which come evenly, are '
              'used')),
    'counted_samples': Words(
        'counted samples', 'No stamps are used: missing samples cannot be seen.',
        'Neither clock is usable, or none was asked for.',
        says='no stamps are used: samples are counted at the stated {rate_hz:g} Hz, and missing '
             'ones cannot be seen'),
    'uneven_stamps': Words(
        'uneven stamps', 'Single missing samples cannot be seen.',
        'The stamps scatter by a good part of the interval.',
        says='{clock} stamps come too unevenly to see a single missing sample: messages are '
             'counted, only gaps that last are seen[. Up to {hidden_share:.1%} of the samples may '
             'be missing unseen, and N then up to {density_high_share:.1%} too high][. The rate '
             'may be up to {rate_error_share:.1%} off]',
        do='let the driver stamp each sample when it is taken'),
    'clock_jumps': Words(
        'clock jumps', 'The record is in several segments; no difference is taken across a jump.',
        'A stamp and all that follow lie far from where the rate puts them.',
        says='the {clock} stamps jumped {count:times}: no difference is taken across a jump'),
    'held_values': Words(
        'held values', 'The driver polls the sensor faster than it samples.',
        'Messages repeat all values of the one before.',
        says='{share:%} of the messages repeat the values of the one before: the sensor is polled '
             'faster than it samples',
        do='its own rate is used and the repeats are left out'),
    'unit_g': Words(
        'unit g', 'Acceleration in g was converted to m/s^2.', 'Its magnitude is near 1.',
        says='the magnitude of the acceleration is near 1: taken as g, not m/s^2',
        do='--accel :g says so, --accel :m/s^2 takes the numbers as they are',
        live='set accel_unit to g or to m/s^2'),
    'unit_assumed': Words(
        'unit assumed', 'The angular velocity was taken as rad/s.',
        'The header of a table states no unit.',
        says='no unit of the angular velocity is stated: taken as rad/s',
        do='--gyro :deg/s converts it, --gyro :rad/s says so'),
    'two_rates': Words(
        'separate sensors', 'Gyroscope and accelerometer each have their own rate.',
        'By topics, or repeated values.', says=_two_rates),
    'repeated_half': Words(
        'repeated half', 'One sensor repeats its values between new ones of the other.',
        'Its values change at a rate of their own.',
        says='topic {topic} repeats its {half:sensor} samples between new ones',
        do='each sensor is analyzed at its own rate'),
    'chosen_topic': Words(
        'chosen topic', 'Of several IMU topics one was chosen.', 'By its name and kind.',
        says=lambda f: (
            f'of {{topics}} IMU topics {{chosen:both}} {"are" if len(f["chosen"]) > 1 else "is"} '
            'read, {reason}; the others: {others:list}'),
        do='choose others with --topic, or --gyro-topic and --accel-topic'),
    'short_part': Words(
        'short part', 'Less is recorded than was asked for.', 'The recording ends before.',
        says='only {recorded_s:time} of the {asked_s:time} asked for are recorded'),
    'ignored_columns': Words(
        'ignored columns', 'Columns of the table are not used.',
        'Their names are not those of axes, or --columns names other axes.',
        says=lambda f: 'columns not read: {columns:list}' + (
            f', and {more:,} more' if (more := f['count'] - len(f['columns'])) > 0 else ''),
        do='--columns gyro_x=NAME,accel_x=NAME,time=NAME says which columns are what; it has to '
           'name all axes that shall be read'),
    'repeated_part': Words(
        'repeated part', 'A part that comes twice counts once.',
        'Stamps and values repeat those before.',
        says='left out {messages:count message} whose stamps and values repeat those of earlier '
             'ones'),
    'no_metadata': Words(
        'no metadata', 'The folder has no usable metadata.yaml; the files found are read.',
        'It is missing or damaged.',
        says=('metadata.yaml is damaged ({reason}); the files found were read',
              'no metadata.yaml (was the recorder killed?); the files found were read')),
    'unfinished_recording': Words(
        'unfinished recording', 'The recorder was killed; its last messages may be missing.',
        'A journal of the database lies beside it.',
        says=_by_fault(
            not_regular='{file} beside it is not a regular file and was not used',
            unusable='{file} beside it could not be used ({reason}); the last messages before the '
                     'recorder was killed are missing or damaged')),
}
"""The texts by code, in the order in which findings are shown."""
