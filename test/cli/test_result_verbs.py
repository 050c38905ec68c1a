# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs that start from a result: export, check, report, tune."""

from dataclasses import replace
import json
from pathlib import Path
import re
import shutil
import xml.etree.ElementTree as ElementTree

from exact_results import with_axes
import imu_allan
from imu_allan import datasheet
from imu_allan.block import ImuBlock
from imu_allan.finding import finding
from imu_allan.recordings.write import write_recording
from imu_allan.result import Inspection
from imu_allan.writers.filters import CONSUMERS
from imu_allan.writers.result_files import load_result, save_result
from imu_allan.writers.terminal import ProgressBar
import numpy as np
from on_terminal import assert_as_before
from processes import python
import pytest
from whole_lines import Varying
import yaml

SCREENS = Path(__file__).parents[1] / 'writers' / 'screens'


def test_export_writes_to_stdout_a_folder_or_a_file(result_file, tmp_path, output_of, fails_with):
    document = yaml.safe_load(output_of('export', result_file, '--for', 'kalibr'))
    assert document['gyroscope_noise_density'] == pytest.approx(0.005 * 0.0174533, rel=0.05)
    assert document['update_rate'] == pytest.approx(100, rel=1e-6)
    for given, path in ((tmp_path, tmp_path / 'vins_fusion_imu.yaml'),
                        (tmp_path / 'mine.yaml', tmp_path / 'mine.yaml')):
        assert output_of('export', result_file, '--for', 'vins', '--output', given) == f'{path}\n'
    old = (tmp_path / 'mine.yaml').read_text()
    assert (tmp_path / 'vins_fusion_imu.yaml').read_text() == old
    for consumer, wishes, lines in (
            ('vins_fusion', '--rate 25', ['Per sample at f = 25 Hz: N sqrt(f) and K sqrt(f).']),
            ('kalibr', '--aiding 1s --coast 2min --conservative --inflate N=2,K=5', [
                'Conservatively tuned for a correction every 1 s and 2 min unaided.',
                'INFLATED on request: K times 5, N times 2.']),
            ('kalibr', '--as-measured', ['Coefficients as measured (IEEE Std 952), not tuned.'])):
        shown = output_of('export', result_file, '--for', consumer, *wishes.split()).splitlines()
        assert {f'# {line}' for line in lines} <= {*shown}
    fails_with('--conservative is a way to tune, --as-measured does without: give one of the two',
               'export', result_file, '--for', 'kalibr', '--as-measured', '--conservative')
    result = load_result(result_file)
    save_result(replace(result, timeline=replace(result.timeline, sample_rate_hz=None)),
                tmp_path / 'rateless.json')
    fails_with('the configuration for vins_fusion needs the sample rate, which this result does '
               'not have; give it with --rate HZ', 'export', tmp_path / 'rateless.json', '--for',
               'vins_fusion', '--output', tmp_path)
    assert (tmp_path / 'vins_fusion_imu.yaml').read_text() == old


@pytest.mark.parametrize(('words', 'begins', 'table'), [
    ('analyze {recording} --json -', '{\n  "schema": "imu_allan.result/1"', 'angle random walk'),
    ('check {result} --spec consumer_mems --junit -', '<?xml ', 'ratio'),
    ('tune {result} --json -', '{\n  "schema": "imu_allan.tuning/1"', 'Numbers for')])
def test_an_output_called_minus_is_all_that_standard_output_gets(
        recording, result_file, tmp_path, words, begins, table):
    done = python('-m', 'imu_allan', *words.format(
        recording=recording, result=result_file).split(), cwd=tmp_path)
    assert done.stdout.startswith(begins)
    assert done.stdout.endswith(('}\n', '>\n'))
    assert table in done.stderr
    assert table not in done.stdout
    assert not [*tmp_path.iterdir()]


def test_a_datasheet_in_place_of_a_result_is_marked_so(tmp_path, output_of, fails_with):
    sheet = tmp_path / 'sheet.yaml'
    export = ('export', '--spec', str(sheet), '--rate', '200Hz', '--for')
    sheet.write_text(
        'gyro: {noise_density: 0.03 deg/s/sqrt(Hz), rate_random_walk: 3e-6 rad/s^2/sqrt(Hz)}\n'
        'accel: {noise_density: 100 ug/sqrt(Hz)}\n')
    for name in CONSUMERS:
        if name.startswith('state_space'):
            assert fails_with(f'no configuration for {name}: a datasheet has no drift model; '
                              'plain has its numbers', *export, name) == ''
        else:
            assert (f'the DATASHEET {sheet}: nothing of it was measured'
                    in output_of(*export, name))
    document = yaml.safe_load(output_of(*export, 'Kalibr'))
    assert document['gyroscope_noise_density'] == pytest.approx(0.03 * 0.0174533, rel=1e-5)
    assert document['gyroscope_random_walk'] == 3e-6
    assert document.get('accelerometer_random_walk') is None
    sheet.write_text('gyro: {noise_density: 0.03 deg/s/sqrt(Hz), bias_instability: 10 deg/h}\n')
    text = output_of(*export, 'kalibr')
    # Without K the bias moves as far as its flicker: 0.664 B sqrt(3 / 60 s).
    assert yaml.safe_load(text)['gyroscope_random_walk'] == pytest.approx(7.2e-6, rel=2e-3)
    assert ('# Filter K is as large as all slow noise after 60 s unaided; flicker is 0.664 B.\n'
            in text)


@pytest.fixture
def against(tmp_path, ran):
    """Check something against a datasheet; gives the status, and what was written."""
    def run(source, limits, *options):
        (tmp_path / 'spec.yaml').write_text(limits)
        return ran('check', source, '--spec', tmp_path / 'spec.yaml', *options)
    return run


@pytest.mark.parametrize(('limit', 'status', 'word'), [
    ('0.006 deg/s/sqrt(Hz)', 0, 'pass'), ('0.2 deg/sqrt(h)', 3, 'fail')])
def test_check_of_a_result_or_a_recording_tells_by_its_status_whether_the_datasheet_is_kept(
        imu_recording, result_file, tmp_path, against, limit, status, word):
    verdicts = []
    for source in (imu_recording, result_file):
        found, out, _ = against(source, f'gyro: {{noise_density: {limit}}}', '--json',
                                tmp_path / 'c.json', '--junit', tmp_path / 'c.xml')
        assert found == status
        assert f'{word}: {source} against {tmp_path}/spec.yaml' in out.splitlines()
        document = json.loads((tmp_path / 'c.json').read_text())
        verdicts.append((document['verdict'], document['checks']))
        suite = ElementTree.parse(tmp_path / 'c.xml').find('testsuite')
        assert suite.get('failures') == ('3' if status else '0')
    assert verdicts == [(word, verdicts[0][1])] * 2


def test_check_takes_one_recording(recording, imu_recording, tmp_path, against):
    units = tmp_path / 'units'
    units.mkdir()
    (units / 'unit_2').symlink_to(recording)
    (units / 'unit_10').symlink_to(imu_recording)
    assert against(units, 'gyro: {noise_density: 0.5 deg/sqrt(h)}') == (
        1, '', f'imu_allan: {units}: holds 2 recordings; check each by itself\n')


@pytest.mark.parametrize('options', [(), ('--live',)])
def test_a_recording_without_usable_samples_is_an_error_not_a_unit_that_fails(
        tmp_path, against, options):
    path = tmp_path / 'one.csv'
    path.write_text('time,gx,gy,gz\n0.01,0.1,0.2,0.3\n')
    assert against(path, 'gyro: {noise_density: 0.5 deg/sqrt(h)}', *options) == (
        1, '', f'imu_allan: {path}: no usable sample; see what it holds with imu_allan info\n')


@pytest.mark.parametrize(('limit', 'options', 'status', 'reason'), [
    (1, [], 4, 'not observable in this recording; record for longer'),
    (1, ['--allow-undecided'], 0, 'not observable in this recording; record for longer'),
    (9000, ['--strict'], 0, None),
    (9000, ['--strict', '--min-duration', '1h'], 4,
     '5 min of data, and no less than 60 min may pass')])
def test_what_is_undecided_is_explained_and_has_a_status_of_its_own(
        result_file, tmp_path, against, limit, options, status, reason):
    found, out, _ = against(
        result_file, f'gyro: {{x: {{rate_random_walk: {limit} deg/h/sqrt(h)}}}}', *options)
    assert found == status
    word = 'pass' if reason is None else 'cannot tell'
    assert out.splitlines()[-2 if reason else -1:] == [
        f'{word}: {result_file} against {tmp_path}/spec.yaml',
        *([] if reason is None else [f'  (1) gyro_x K: {reason}'])]


@pytest.mark.parametrize(('name', 'columns', 'command'), [
    ('check_80', '80', 'check seen.json --spec spec.yaml'),
    ('compared', None, 'report three_hours.json warm_up.json --output out --format png'),
    ('tune_60', '60', 'tune three_hours.json --aiding 1s --coast 20s'),
    ('tune_beyond_what_is_known', None, 'tune seen.json --aiding 1ms --coast 5d')])
def test_results_look_on_a_terminal_or_in_a_pipe_as_they_did(
        name, columns, command, tmp_path, monkeypatch, ran):
    monkeypatch.chdir(tmp_path)
    if columns is not None:
        monkeypatch.setenv('COLUMNS', columns)
    for stored in ('three_hours', 'warm_up'):
        shutil.copy(SCREENS / f'{stored}.json', tmp_path)
    drifting = finding('not_steady', ('gyro_x',), low_hz=3.0, spread_share=0.2, segment_s=60.0)
    save_result(replace(load_result('three_hours.json'), warnings=(drifting,)), 'seen.json')
    Path('spec.yaml').write_text('gyro: {noise_density: 0.00801 deg/s/sqrt(Hz), rate_random_walk: '
                                 '1e-9 rad/s^2/sqrt(Hz)}')
    _, out, err = ran(*command.split())
    lines = [line.rstrip() for line in out.splitlines()]
    assert err == ''
    assert max(map(len, lines)) <= int(columns or 999)
    assert_as_before('\n'.join([*lines, '']), f'snapshots/{name}.txt')


@pytest.mark.parametrize('command', [
    'check a.json --spec tactical_mems', 'report a.json b.json', 'report a.json b.json c.json',
    'tune a.json'])
def test_no_number_is_cut_in_two_on_a_narrow_terminal(
        result_file, tmp_path, monkeypatch, ran, command):
    monkeypatch.chdir(tmp_path)
    for name in 'abc':
        shutil.copy(result_file, f'{name}.json')
    _, wide, error = ran(*command.split())
    assert wide
    assert not error
    monkeypatch.setenv('COLUMNS', '40')
    _, narrow, _ = ran(*command.split())
    assert sorted(narrow.split()) == sorted(wide.split())


def test_unit_operator_and_station_go_into_the_papers(result_file, tmp_path, ran):
    # What is not said stays as the result has it; a specification that is shipped has a name.
    save_result(replace(load_result(result_file),
                        inspection=Inspection(serial='A-17', operator='nobody')),
                tmp_path / 'r.json')
    assert ran('check', tmp_path / 'r.json', '--spec', 'consumer_mems', '--meta', 'operator=mk',
               '--meta', 'station=bench 3', '--json', tmp_path / 'c.json')[0] in (0, 3)
    assert json.loads((tmp_path / 'c.json').read_text())['inspection'] == {
        'serial': 'A-17', 'operator': 'mk', 'station': 'bench 3'}


@pytest.mark.parametrize(('limit', 'status', 'word', 'last'), [
    ('0.004 deg/s/sqrt(Hz)', 3, 'fail',
     '  (3) gyro_z N: above 0.004 deg/s/sqrt(Hz), certain after <number> s (measured <number>, '
     '<number> .. <number>)'),
    ('0.005 deg/s/sqrt(Hz)', 4, 'cannot tell',
     '  (3) gyro_z N: within 10 % of 0.005 deg/s/sqrt(Hz) after <number> s (measured <number>, '
     '<number> .. <number>)')])
def test_a_live_check_ends_as_soon_as_the_verdict_is_certain(
        recording, tmp_path, against, monkeypatch, limit, status, word, last):
    # Fewer looks.
    monkeypatch.setattr(datasheet, 'GROWTH', 1.5)
    bytes_read = []
    monkeypatch.setattr(ProgressBar, '__call__', lambda _, done: bytes_read.append(done))
    found, said, _ = against(recording, f'gyro: {{noise_density: {limit}}}', '--live',
                             '--json', tmp_path / 'c.json')
    assert found == status
    # Of the five minutes of the recording.
    assert float(re.match(r'certain after ([\d.]+) s', said)[1]) < 60
    assert json.loads((tmp_path / 'c.json').read_text())['verdict'] == word
    # A long one shows its progress.
    assert bytes_read
    assert Varying(last) in said.splitlines()


def test_check_takes_the_part_and_the_clock_that_analyze_takes(recording, against):
    for options, status in ((['--start', '250s', '--motion', 'keep', '--clock', 'receive'], 0),
                            (['--duration', '12s', '--live'], 4)):
        found, out, _ = against(recording, 'gyro: {noise_density: 0.01 deg/s/sqrt(Hz)}',
                                '--min-duration', '40s', *options)
        assert found == status
    assert 'not certain after 12 s; check without --live compares all of it' in out.splitlines()


def test_report_writes_page_and_plots_and_compares_several(result_file, tmp_path, output_of):
    names = {Path(line).name for line in output_of(
        'report', result_file, '--output', tmp_path / 'out', '--format', 'png,svg').split()}
    assert names == {path.name for path in (tmp_path / 'out').iterdir()} == {
        'report.html', *(f'{sheet}.{kind}' for kind in ('png', 'svg')
                         for sheet in ('allan_deviation', 'gyro', 'accel'))}
    paths = [tmp_path / f'unit{number}.json' for number in range(1, 9)]
    for path in paths:
        path.write_bytes(result_file.read_bytes())
    # More than there are colours are a population.
    eight = output_of('report', *paths, '--output', tmp_path / 'compared', '--format', 'png')
    page = (tmp_path / 'compared' / 'comparison.html').read_text()
    for text, words in ((eight, ['8 units', '8 of 8']), (page, ['8 results compared', 'unit8'])):
        assert [word for word in words if word not in text] == []
    assert (tmp_path / 'compared' / 'comparison.png').exists()


def test_a_folder_of_a_result_is_that_result(result_file, tmp_path, output_of, fails_with):
    assert output_of('tune', result_file.parent) == output_of('tune', result_file)
    several, empty = tmp_path / 'several', tmp_path / 'empty'
    (several / 'one').mkdir(parents=True)
    (several / 'one' / 'result.json').symlink_to(result_file)
    empty.mkdir()
    fails_with(f'{empty}: a folder without result.json; of a recording make one with: imu_allan '
               f'analyze {empty} --output DIR', 'tune', empty)
    fails_with(f'{several}: holds several results; name one of {several}/one', 'tune', several)
    fails_with(f'{result_file}: a result of imu_allan analyze, not a recording; go on with '
               f'imu_allan report, tune, export or check {result_file}', 'info', result_file)


@pytest.mark.parametrize(('key', 'reason'), [
    ('samples', '999999999…999999999 is not below 1e+60'),
    ('sample_rate_hz', '999999999…999999999 is not below 1e+60')])
def test_a_number_of_many_digits_is_one_line(result_file, tmp_path, fails_with, key, reason):
    text, found = re.subn(
        rf'("{key}": )[\d.]+', rf'\g<1>{"9" * 400}', result_file.read_text(), count=1)
    assert found == 1
    (tmp_path / 'damaged.json').write_text(text)
    fails_with(f'{tmp_path}/damaged.json.timeline.{key}: {reason}', 'export',
               tmp_path / 'damaged.json', '--for', 'kalibr')


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


def test_the_numbers_hold_on_their_own_recording(result_file, imu_recording, tmp_path, output_of):
    path = tmp_path / 'verified.json'
    out = output_of('tune', result_file, '--aiding', '1s', '--verify', imu_recording,
                    '--no-progress', '--json', path)
    for part in (f'\nFilters with these numbers, run over 5 min of rest in {imu_recording}, in '
                 'one part:\n', 'off after ', 'N, K times', '\nThe numbers are from this very '
                 'recording, which cannot show whether they hold in another.\n'):
        assert part in out
    found = json.loads(path.read_text())['verification']
    assert found['other'] == str(imu_recording)
    for axis in found['axes'].values():
        assert axis['stops'] == 1
        assert axis['full']['innovations'][0]['nis'] == pytest.approx(1, abs=0.4)
        assert axis['noise_factor'] == pytest.approx(1, abs=0.2)


def test_what_is_wrong_with_the_other_recording_is_said_and_its_sensors_keep_their_own_times(
        result_file, tmp_path, output_of, monkeypatch):
    monkeypatch.chdir(tmp_path)
    samples = np.random.default_rng(6).normal([0, 0, 0, 0, 0, 9.8], 0.02, (30_000, 6))
    samples[:, 1] = 0.5
    # The accelerometer has a third of the rate.
    absent = np.stack([np.zeros(30_000, bool), np.arange(30_000) % 3 > 0], axis=1)
    stamps = 1_800_000_000 * 10**9 + np.arange(30_000) * 10**7
    write_recording('other', [ImuBlock(stamps, stamps, samples, absent, 'imu_link')])
    out = output_of('tune', result_file, '--verify', 'other', '--no-progress', '--json', 'v.json')
    lines = out.splitlines()
    assert 'other by itself. Gyroscope: not usable: every sample is the same (y).' in lines
    assert [line.split()[2:5] for line in lines if 'NIS ' in line and 'numbers' in line][2:] == [
        ['NIS', '1.28', 's'], ['NIS', '960', 'ms']]
    assert 'very recording' not in out
    found = json.loads(Path('v.json').read_text())['verification']
    assert list(found['axes']) == ['gyro_x', 'gyro_z', 'accel_x', 'accel_y', 'accel_z']
    assert ['gyro_y'] in [one['axes'] for one in found['warnings']]


@pytest.mark.parametrize(('options', 'seen'), [
    ('--aiding 10s --coast 1s',
     'a coast of 1 s is shorter than an aiding interval of 10 s: a filter is unaided for at least '
     'one interval'),
    ('--verify {old}', '--verify {old}: is a result, without samples to run filters over; name '
     'the recording itself'),
    ('--verify nowhere', 'nowhere: no such file or directory')])
def test_what_cannot_be_is_refused(result_file, tmp_path, options, seen, fails_with):
    old = tmp_path / 'old.json'
    save_result(with_axes(load_result(result_file), drift_model=None), old)
    fails_with('no axis of this result has a drift model. Gyroscope: <words> If it is from an '
               'older version, analyze the recording again', 'tune', old)
    # Before the tables, of which a reader would think that they were verified.
    assert fails_with(seen.format(old=old), 'tune', result_file, *options.format(
        result=result_file, old=old).split()) == ''


def test_numbers_from_seconds_come_with_the_verdict(recording, analyzed, tmp_path, output_of):
    analyzed(recording, '--duration', '5s')
    assert output_of('tune', tmp_path / 'analyzed.json').startswith(
        'Gyroscope: not usable: 5 s at rest.\nNumbers for a filter')
