# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace
from pathlib import Path

from exact_results import with_coefficient
from imu_allan.finding import Finding, finding
from imu_allan.finding_messages import advice, sentence_of, with_words
from imu_allan.result import Saturation, Source, Span
from imu_allan.writers.result_files import load_result
from on_terminal import assert_as_before, FLAT, printed
import pytest

GOOD = {sensor: f'{sensor}: N is good (+-0.' for sensor in ('Gyroscope', 'Accelerometer')}
STILL, CUT_OFF = {'stood_still': Span(100.0, 50.0)}, {'saturated': Saturation(34.9, 0.2)}


@pytest.mark.parametrize(('name', 'width', 'options'), [
    ('60', 60, {}), ('80', 80, {}), ('140', 140, {}),
    # Each value above its interval, terms that no axis shows with their bounds, and the mean.
    ('80_verbose', 80, {'verbose': True}), ('140_si', 140, {'si': True, 'verbose': True})])
def test_a_result_looks_on_the_terminal_as_it_did(result, name, width, options):
    text = '\n'.join(line.rstrip() for line in printed(result, width, **options).splitlines())
    assert max(map(len, text.splitlines())) <= width
    assert '…' not in text
    assert_as_before(f'{text}\n', f'snapshots/terminal_{name}.txt')


@pytest.mark.parametrize('name', [
    'dead_axis', 'driving', 'five_seconds', 'g_and_degrees', 'three_hours', 'two_minutes',
    'vibration', 'warm_up'])
def test_a_first_screen_is_as_it_was_and_begins_with_what_a_newcomer_wants(name):
    """`screens/` holds the results of eight typical recordings."""
    stored = load_result(Path(__file__).with_name('screens') / f'{name}.json')
    lines = [line.rstrip() for line in printed(stored).splitlines()]
    # The last of 24 says how to save.
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80
    assert_as_before('\n'.join([*lines, '']), f'screens/{name}.txt')


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
            for axis, share in (('gyro_z', 0.1), ('accel_x', 0.2), ('accel_y', 0.3)))),
     10_800.0, {
        'Gyroscope': 'use with care: the noise changed by 10 % (z).',
        'Accelerometer': 'use with care: bias step (z), not steady (x and y).'}),
    # A minute by stamps in microseconds.
    ({}, (), 59.9999, {}),
    ({}, (finding('short_recording', samples=40, duration_s=40.0, needed=64, severity='act'),),
     40.0, dict.fromkeys(('Gyroscope', 'Accelerometer'), 'use with care: 40 samples in 40 s.')),
    ({}, (), 5.6, {'Gyroscope': 'not usable: 5.6 s at rest.',
                   'Accelerometer': 'not usable: 5.6 s at rest.'})])
def test_the_first_lines_are_the_verdict_on_each_sensor(result, changed, warnings, seconds, said):
    axes = {name: replace(axis, **(changed.get(name) or {}))
            for name, axis in result.axes.items() if changed.get(name, {}) is not None}
    lines = printed(replace(
        result, axes=axes, warnings=warnings, sensors={}, timeline=replace(
            result.timeline, samples=round(200 * seconds), duration_s=seconds, gaps=(),
            motion=())), 200).splitlines()
    for line, (sensor, good) in zip(lines, GOOD.items(), strict=False):
        if sensor in said:
            assert line == f'{sensor}: {said[sensor]}'
        else:
            assert line.startswith(good)


def test_an_unknown_drift_after_unequal_rests_names_the_sensors():
    stored = load_result(Path(__file__).with_name('screens') / 'five_seconds.json')
    rests = replace(stored, axes={name: replace(axis, rest_s=5.0 if name < 'b' else 5.6)
                                  for name, axis in stored.axes.items()})
    assert [line.split(':')[-1].strip() for line in printed(rests).splitlines()
            if 'not known from' in line] == ['gyro  not known from 5.6 s',
                                             'accel not known from 5 s']


def test_what_is_known_roughly_is_not_called_good(result):
    wide = with_coefficient(result, 'gyro_z', 'noise_density', value=1e-3, ci95=(5e-4, 1.4e-3))
    text = printed(replace(wide, warnings=(), sensors={}))
    assert text.startswith('Gyroscope: N is known roughly (+-45 %). ')


def test_text_from_a_recording_is_neither_markup_nor_control_sequence(result):
    nasty = '[red]x[/red] \x1b[31m [link=http://a]b[/link] \r\n \u202e'
    text = printed(replace(
        result, source=Source('recording', nasty, nasty, nasty, nasty, 'header'),
        warnings=(Finding('motion', message=nasty),)), force_terminal=True, color_system=None)
    assert [part in text for part in ('[red]x[/red]', '[link=http://a]')] == [True] * 2
    assert [part for part in ('\x1b', '\r', '\u202e') if part in text] == []


def test_what_to_act_upon_is_in_full_and_what_has_no_room_beside_it_is_left_out(result):
    steps = [finding('bias_step', (name,), size=1e-3, unit='rad/s', after_s=600.0)
             for name in ('gyro_x', 'gyro_y')]
    slow = [finding('slow_motion', ('accel_x',), size=0.01, unit='m/s^2', start_s=start_s,
                    duration_s=28.0, count=1) for start_s in (60.0, 900.0)]
    known = [finding(code) for code in ('no_metadata', 'unit_g', 'trend_or_walk')]
    few, many = (with_words(replace(result, sensors={}, warnings=(*found, *known)))
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
