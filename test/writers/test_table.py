# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import os
from pathlib import Path
import re
import subprocess
import sys

from changed import known_for, only, UNSEEN, with_axes, with_coefficient, with_edf
from imu_allan.finding import Finding, finding
from imu_allan.result import Saturation, Source, Span, Timeline
from imu_allan.writers.table import result_text
from imu_allan.writers.terminal import wrapped
from imu_allan.writers.words import advice, sentence_of, with_words
from on_terminal import FLAT, printed
import pytest


@pytest.mark.parametrize(('name', 'width', 'options'), [
    ('60', 60, {}), ('80', 80, {}), ('140', 140, {}),
    # Each value above its interval, terms that no axis shows with their bounds, and the mean.
    ('80_verbose', 80, {'verbose': True}), ('140_si', 140, {'units': 'si', 'verbose': True})])
def test_a_result_looks_on_the_terminal_as_it_did(filtered, name, width, options):
    """After a wanted change: IMU_ALLAN_SNAPSHOTS=write pytest test/writers/test_table.py."""
    text = '\n'.join(line.rstrip() for line in printed(filtered, width, **options).splitlines())
    snapshot = Path(__file__).with_name('snapshots') / f'terminal_{name}.txt'
    if os.environ.get('IMU_ALLAN_SNAPSHOTS') == 'write':
        snapshot.write_text(f'{text}\n')
    assert f'{text}\n' == snapshot.read_text()


def test_a_forecast_says_how_far_it_is_known(filtered):
    short = known_for(filtered, 30.0)
    assert re.search(r'Unaided drift after 60 s: [\d.]+ deg rms \([\d.]+ to [\d.]+\), '
                     r'extrapolated, [\d.]+ m rms \([\d.]+ to [\d.]+\), extrapolated\n',
                     printed(short, 120))
    assert re.search(r'Unaided drift after 60 s: gyro  .* extrapolated\n {26}accel .* rms',
                     printed(short))
    assert 'extrapolated' not in printed(filtered)
    # Of a second of recording: 5.2e-05 .. 5.1e+06 deg.
    unknown = with_edf(filtered, 0.01)
    assert len(re.findall(r' rms, not known to a factor of 10\b', printed(unknown, 120))) == 2
    short = replace(known_for(unknown, 5.0), timeline=Timeline(200.0, 2800, 14.0))
    assert 'Unaided drift after 60 s: not known from 14 s\n' in printed(short)


@pytest.mark.parametrize('edf', [2.0, 5.0, 20.0, 100.0])
def test_each_bound_of_a_forecast_has_two_digits(filtered, edf):
    steady = with_axes(filtered, stationarity=None)
    bounds = re.findall(r' rms \(([\d.]+) to ([\d.]+)\)', printed(with_edf(steady, edf), 120))
    assert [len(re.sub(r'^[0.]+|\.', '', bound)) for pair in bounds for bound in pair] == [2] * 4


def test_a_constant_sensor_says_so_and_has_no_empty_rows(make_axis, make_result):
    axis = make_axis('gyro_x', {}, curve=FLAT)
    axis = replace(axis, coefficients={key: replace(value, upper95=None)
                                       for key, value in axis.coefficients.items()})
    lines = printed(make_result(axes={'gyro_x': axis}, warnings=()), 120).splitlines()
    assert lines[0] == 'Gyroscope: not usable: constant (x).'
    assert [line for line in lines if line][3:] == ['Gyroscope       x', 'mean deg/s  0.573']


GOOD = {sensor: f'{sensor}: N is good (+-0.' for sensor in ('Gyroscope', 'Accelerometer')}
STILL, CUT_OFF = {'stood_still': Span(100.0, 50.0)}, {'saturated': Saturation(34.9, 0.2)}


@pytest.mark.parametrize(('changed', 'warnings', 'seconds', 'said'), [
    ({}, (), 10_800.0, {}),
    ({'gyro_z': {'curve': FLAT}, 'accel_x': STILL}, (), 10_800.0, {
        'Gyroscope': 'not usable: constant (z).',
        'Accelerometer': 'not usable: stood still (x).'}),
    ({'gyro_x': STILL, 'gyro_y': CUT_OFF, 'gyro_z': CUT_OFF}, (), 10_800.0, {
        'Gyroscope': 'not usable: stood still (x), saturated (y and z).'}),
    # An axis that is not there does not make the others useless.
    ({'gyro_x': None}, (finding('axis_not_finite', ('gyro_x',)),), 10_800.0, {
        'Gyroscope': 'use with care: no numbers (x).'}),
    ({}, (finding('gravity', mean=1.0),), 10_800.0, {
        'Accelerometer': 'use with care: the mean acceleration is 1 m/s^2, not 9.81.'}),
    # Of a finding about both sensors each has its own figures.
    ({}, (finding('bias_step', ('accel_z',), size=1.0, unit='m/s^2', after_s=540.0),
          *(finding('not_steady', (axis,), low_hz=3.0, spread_share=share, segment_s=60.0)
            for axis, share in (('gyro_z', 0.1), ('accel_x', 0.2), ('accel_y', 0.3))),
          finding('not_steady', ('accel_z',), low_hz=3.0, change_share=0.4, higher='first')),
     10_800.0, {
        'Gyroscope': 'use with care: the noise changed by 10 % (z).',
        'Accelerometer': 'use with care: bias step (z), not steady (x, y and z).'}),
    ({}, (finding('not_steady', ('accel_z',), low_hz=3.0, change_share=0.4, higher='first'),
          finding('not_steady', ('accel_x',), high_hz=3.0, change_share=0.1, higher='first'),
          finding('not_steady', ('gyro_y',), low_hz=3.0, change_share=0.1, higher='first'),
          finding('not_steady', ('gyro_x',), low_hz=3.0, spread_share=0.2, segment_s=60.0)),
     10_800.0, {'Accelerometer': 'use with care: the noise changed by 10 to 40 % (x and z).',
                'Gyroscope': 'use with care: not steady (x and y).'}),
    *(({}, found, 5.6, {'Gyroscope': 'not usable: 5.6 s at rest.',
                        'Accelerometer': 'not usable: 5.6 s at rest.'})
      for found in ((), (finding('gravity', mean=10.5),)))])
def test_the_first_lines_are_the_verdict_on_each_sensor(
        filtered, changed, warnings, seconds, said):
    axes = {name: replace(axis, **(changed.get(name) or {}))
            for name, axis in filtered.axes.items() if changed.get(name, {}) is not None}
    lines = printed(replace(
        filtered, axes=axes, warnings=warnings, sensors={}, timeline=replace(
            filtered.timeline, samples=round(200 * seconds), duration_s=seconds, gaps=(),
            motion=())), 200).splitlines()
    for line, (sensor, good) in zip(lines, GOOD.items(), strict=False):
        if sensor in said:
            assert line == f'{sensor}: {said[sensor]}'
        else:
            assert line.startswith(good)


def test_what_is_known_roughly_is_not_called_good(filtered):
    axis = filtered.axes['gyro_z']
    wide = replace(axis.coefficients['noise_density'], value=1e-3, ci95=(5e-4, 1.4e-3))
    axes = {**filtered.axes, 'gyro_z': replace(axis, coefficients={
        **axis.coefficients, 'noise_density': wide})}
    text = printed(replace(filtered, axes=axes, warnings=(), sensors={}))
    assert text.startswith('Gyroscope: N is known roughly (+-45 %). ')


def test_a_stored_verdict_is_that_of_a_sensor_that_is_there(filtered):
    judged = with_words(filtered)
    text = printed(replace(judged, axes={'gyro_x': judged.axes['gyro_x']}))
    assert text.startswith(GOOD['Gyroscope'])
    assert 'Accelerometer' not in text


def test_the_mean_has_the_digits_that_its_error_leaves(result):
    # The Allan deviation at three hours is 2.5e-4 rad/s with K, 0.8e-4 without.
    axes = {name: replace(result.axes[name], mean=1.23456789) for name in ('gyro_x', 'gyro_z')}
    text = printed(replace(result, axes=axes), units='si', verbose=True)
    assert 'mean rad/s 1.2346 1.23457' in [' '.join(line.split()) for line in text.splitlines()]


def test_what_to_act_upon_is_in_full_and_the_rest_is_named_each_kind_once(result):
    seen = replace(result, warnings=(
        *(finding('band_limited', (name,), window_s=window) for name, window in zip(
            result.axes, (0.0148, 0.015, 0.0152, 0.02, 0.02, 0.02), strict=True)),
        finding('gauss_markov', ('gyro_x',), sigma=0.01, unit='rad/s', correlation_time_s=9.0),
        finding('gravity', mean=1.001)))
    assert printed(seen, 200).splitlines()[-2:] == [
        'gravity: the mean acceleration is 1.001 m/s^2, not about 9.81; is it in units of g? -> '
        'check the unit and the topic; --accel :g converts',
        'Good to know (2): low-pass, correlated noise (imu_allan explain NAME, or --verbose).']
    assert '1,200 missing, 2 gaps (6 s), 2 segments of motion (5 min 45 s)' in printed(seen, 200)
    assert 'with a correlation time of 9 s' in ' '.join(printed(seen, 80, verbose=True).split())


def test_text_from_a_recording_is_neither_markup_nor_control_sequence(result):
    nasty = '[red]x[/red] \x1b[31m [link=http://a]b[/link] \r\n \u202e'
    text = printed(replace(
        result, source=Source('recording', nasty, nasty, nasty, nasty, 'header'),
        warnings=(Finding('motion', message=nasty),)), force_terminal=True, color_system=None)
    assert [part in text for part in ('[red]x[/red]', '[link=http://a]')] == [True] * 2
    assert [part for part in ('\x1b', '\r', '\u202e') if part in text] == []


LONG = 'the noise of this axis is not what it was ' * 5


def test_a_pipe_gets_plain_text_unbroken_or_of_the_width_that_is_stated(result, tmp_path):
    seen = replace(result, warnings=(Finding('poor_fit', 'act', message=LONG),))
    (tmp_path / 'r.json').write_text(seen.to_json())
    done = subprocess.run(
        [sys.executable, '-c', """
import os, sys
from imu_allan.writers.result_file import load_result
from imu_allan.writers.table import print_result
for columns in sys.argv[2:]:
    if columns:
        os.environ['COLUMNS'] = columns
    print_result(load_result(sys.argv[1]))
    print(flush=True, end='\\f')
""", str(tmp_path / 'r.json'), '', '60', '120'], capture_output=True, text=True, check=True,
        env={'PATH': '', 'PYTHONUTF8': '1'})
    assert '\x1b' not in done.stdout
    plain, *broken, _ = done.stdout.split('\f')
    assert LONG.strip() in plain
    for columns, text in zip((60, 120), broken, strict=True):
        assert '2.406 +-0.2 %' in text
        assert LONG.strip() not in text
        assert max(map(len, text.splitlines())) <= columns


def test_what_recording_on_would_bring_is_reported(result):
    known = with_coefficient(with_coefficient(
        result, 'gyro_x', 'noise_density', ci_halves_in_s=7200.0), 'gyro_x', 'rate_random_walk',
        **UNSEEN, upper95=1e-6, observable_in_s=600.0)
    text = ' '.join(printed(only(known, 'gyro_x'), verbose=True).split())
    assert 'half as wide after another 2 h' in text
    assert 'K of gyro x after 10 min at the earliest' in text


def test_print_of_a_result_is_the_table_and_its_repr_one_line(result):
    assert str(result) == result_text(result)
    assert '\x1b' not in str(result)
    assert all(len(line) <= 80 for line in str(result).splitlines())
    for one in (result, *result.axes.values()):
        assert '\n' not in repr(one)
        assert len(repr(one)) < 400


def test_what_to_act_upon_is_in_full_and_what_has_no_room_beside_it_is_left_out(filtered):
    steps = [finding('bias_step', (name,), size=1e-3, unit='rad/s', after_s=600.0)
             for name in ('gyro_x', 'gyro_y')]
    slow = [finding('slow_motion', ('accel_x',), size=0.01, unit='m/s^2', start_s=start_s,
                    duration_s=28.0, count=1) for start_s in (60.0, 900.0)]
    known = [finding(code) for code in ('no_metadata', 'unit_g', 'trend_or_walk')]
    few, many = (with_words(replace(filtered, sensors={}, warnings=(*found, *known)))
                 for found in (steps, [
                     *steps, *slow, finding('poor_fit', ('gyro_x',), misfit_share=0.12),
                     finding('gravity', mean=1.0)]))
    for result, in_the_table in ((few, True), (many, False)):
        lines = printed(result, 80).splitlines()
        assert len(lines) <= 23
        shown = ' '.join(' '.join(lines).split())
        assert all(sentence_of(one) in shown and advice(one) in shown
                   for one in result.warnings if one.severity == 'act')
        assert ('\nGyroscope  ' in printed(result, 80)) == in_the_table
        assert ('Coefficients of each axis: --verbose.' in lines) == (not in_the_table)
    # What differs in figures alone has its advice once.
    assert printed(many, 200).count('analyze the rest with --start') == 1
    assert printed(many, 200, verbose=True).count('analyze the rest with --start') == 2


def test_no_line_ends_between_a_number_and_its_unit():
    [first, second, third] = wrapped(['the noise is higher by 19 % until 13 min 39 s. K: 3'], 25)
    assert [first.plain, second.plain, third.plain] == [
        'the noise is higher by', '  19 % until 13 min 39 s.', '  K: 3']


@pytest.mark.parametrize('units', ['datasheet', 'si'])
@pytest.mark.parametrize('width', [40, 60, 80, 100, 200])
def test_nothing_is_wider_than_the_terminal_and_no_digit_is_lost(filtered, width, units):
    values = {'datasheet': ('2.406', '2.647', '407.9', '119', '23.5'),
              'si': ('0.0007000', '0.0007700', '0.003800')}[units]
    for verbose in (False, True):
        text = printed(filtered, width, units, verbose)
        assert max(map(len, text.splitlines())) <= width
        assert '…' not in text
        assert [value for value in values if value not in text] == []
