# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verb tune: four ways to feed a filter, the drift without any, another recording."""

from dataclasses import replace
import json
import re

from changed import with_axes
import imu_allan
from imu_allan.finding import finding
from imu_allan.writers.result_file import load_result, save_result
import numpy as np
import pytest
from whole_lines import Varying


@pytest.mark.parametrize('width', [60, None])
def test_the_four_ways_stand_side_by_side_and_nothing_is_broken_or_cut_on_a_terminal(
        result_file, output_of, monkeypatch, width):
    if width is not None:
        monkeypatch.setenv('COLUMNS', str(width))
    out = output_of('tune', result_file, '--aiding', '1s', '--coast', '20s')
    assert out.splitlines()[0] == (
        'Numbers for a filter that is corrected every 1 s and unaided for 20 s:')[:width]
    assert '…' not in out
    rows = [line.split() for line in out.splitlines()]
    for words in (['conservative'], ['ten', 'times', 'K']):
        assert sum(row[:len(words)] == words for row in rows) == 6
    assert all(len(row) == 6 for row in rows if row[:1] == ['conservative'])
    # Ten times a bound is a bound.
    assert len(re.findall(r'as measured +\S+ +< ', out)) == len(
        re.findall(r'ten times K +\S+ +< ', out))
    if width is not None:
        assert max(map(len, out.splitlines())) <= width
        # A line that goes on is set in.
        assert out.partition('On another day')[2].splitlines()[1].startswith('  ')
        return
    for row in ('Gyroscope: filter N rad/s/sqrt(Hz), filter K rad/s^2/sqrt(Hz), predicted rad/s',
                'Accelerometer: filter N m/s^2/sqrt(Hz), filter K m/s^3/sqrt(Hz), predicted m/s^2',
                'x tuned ', 'full model'):
        assert row in out
    assert Varying('After one unaided minute the error of heading is about <number>° rms '
                   '(<number> to <number>°; gyro_z, the worst axis).') in out.splitlines()


def test_the_numbers_as_json(result_file, tmp_path, output_of):
    path = tmp_path / 'tuning.json'
    output_of('tune', result_file, '--aiding', '1s', '--coast', '20s', '--json', path)
    document = json.loads(path.read_text())
    axis = document['axes']['gyro_x']
    tuned = axis['choices'][0]
    expected = imu_allan.tune(load_result(result_file).axes['gyro_x'], 1.0, 20.0)
    for key in 'noise_density', 'random_walk', 'known_from_s', 'known_to_s':
        assert tuned[key] == getattr(expected, key)
    assert (tuned['numbers'], len(tuned['consistency'])) == ('tuned', 7)
    assert axis['forecast']['position'] is None
    assert document['axes']['accel_x']['forecast']['position'][0] > 0


def test_how_far_another_day_may_be_off_and_what_changed_within_the_recording_is_said(
        result_file, output_of, tmp_path):
    out = output_of('tune', result_file, '--coast', '20s')
    [found] = [match for line in out.splitlines() if (match := re.fullmatch(
        r'On another day the squared error after 20 s may be ([\d.]+) to ([\d.]+) times '
        r'\(gyroscope\) and ([\d.]+) to ([\d.]+) times \(accelerometer\) as large as here '
        r'\(95 %\): sensors change, and a recording is short\.', line))]
    low, high, lower, higher = map(float, found.groups())
    assert low * high == pytest.approx(1, abs=0.05)
    # At least what real sensors change by: 17 and 36 % in deviation.
    assert lower < low < np.exp(4 * 0.17) < high < higher
    assert 'Not steady' not in out
    seen = finding('not_steady', ('gyro_x',), interval_s=60.0, drift_ratio=2.0, higher='first',
                   half_s=600.0)
    save_result(replace(load_result(result_file), warnings=(seen,)), tmp_path / 'seen.json')
    out = output_of('tune', tmp_path / 'seen.json', '--coast', '3h').splitlines()
    assert ('Not steady: gyro x: over 60 s the first half drifts 2.0 times as much as the second; '
            'numbers for a filter lie between the two.'
            in out)
    assert ('On another day the squared error after 3 h may be any number of times (gyroscope) '
            'and any number of times (accelerometer) as large as here (95 %): sensors change, and '
            'a recording is short.') in out


def test_the_numbers_hold_on_the_recording_they_come_from(
        result_file, imu_recording, tmp_path, output_of):
    path = tmp_path / 'verified.json'
    out = output_of('tune', result_file, '--aiding', '1s', '--verify', imu_recording,
                    '--no-progress', '--json', path, '--plot', tmp_path / 'drift.svg')
    for text, parts in (
            ((tmp_path / 'drift.svg').read_text(), (
                'Drift observed in', 'Accelerometer', 'x axis', '60 s')),
            (out, (f'\nThe tuned numbers held against {imu_recording}:\n',
                   f'\nFilters with these numbers, run over 5 min of rest in {imu_recording}, in '
                   'one part:\n', 'NIS 10 s', 'off after 10 s'))):
        assert [part for part in parts if part not in text] == []
    found = json.loads(path.read_text())['verification']
    assert found['other'] == str(imu_recording)
    for axis in found['axes'].values():
        assert axis['stops'] == 1
        assert axis['full']['innovations'][0]['nis'] == pytest.approx(1, abs=0.4)
        assert axis['noise_ci95'][0] < 1 < axis['noise_ci95'][1]
        assert {'from_s', 'to_s', 'ratio', 'ci95'} == set(axis['excess'][0])
    out = output_of('tune', result_file, '--verify', result_file)
    assert re.search('axis +NIS +error +N times +K times', out)
    assert out.splitlines()[-1] == (
        'N times, K times: the factor that would make the numbers right there, with its 95 % '
        'interval. Above 1 with motors or wheels running, it is what the motion adds: put it into '
        '--inflate. By averaging time: Allan deviation there over the one predicted. The models '
        'are compared; name the recording itself to run filters over it.')


@pytest.mark.parametrize(('options', 'seen'), [
    ('--verify x --plot drift.jpg',
     '--plot drift.jpg: write a file that ends in .png, .svg, .pdf'),
    ('--aiding 10s --coast 1s',
     '--coast 1 s is shorter than --aiding 10 s: a filter is unaided for at least one interval'),
    ('--verify {result} --plot drift.png', '--plot: a result holds no series to run filters '
     'over: name the recording itself behind --verify'),
    ('--verify {old}', '{old}: no axis has a drift model in both recordings')])
def test_what_cannot_be_is_refused(result_file, tmp_path, options, seen, fails_with):
    old = tmp_path / 'old.json'
    save_result(with_axes(load_result(result_file), drift_model=None), old)
    fails_with('no axis of this result has a drift model (constant, too short, or from an older '
               'version): analyze the recording again', 'tune', old)
    shown = fails_with(seen.format(old=old), 'tune', result_file,
                       *options.format(result=result_file, old=old).split())
    # What needs no recording is refused before anything is read.
    assert (shown == '') == ('{' not in options)
