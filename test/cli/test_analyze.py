# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import contextlib
import json
import os
from pathlib import Path
import pty
import subprocess
import sys

from bags import mcap_written, serialized
import imu_allan
from imu_allan.cli import workers
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.plot import overview_png
from imu_messages import encode_imu
import numpy as np
import pytest
import yaml

START_NS = 1_700_000_000 * 10**9

COMMAND = [sys.executable, '-m', 'imu_allan', 'analyze']
NOTHING_SAVED = 'Nothing is saved: --output DIR keeps result, report, plot and curve.'


def test_the_table_goes_to_stdout_unless_a_configuration_does(imu_recording, output_of, ran):
    shown = output_of('analyze', imu_recording)
    for part in '\n30,000 samples at 100 Hz, 5 min\n', 'angle random walk', 'velocity random walk':
        assert part in shown
    assert shown.splitlines()[-1] == NOTHING_SAVED
    status, out, err = ran('analyze', imu_recording, '--for', 'kalibr')
    assert status == 0
    assert set(yaml.safe_load(out)) == {
        'accelerometer_noise_density', 'accelerometer_random_walk', 'gyroscope_noise_density',
        'gyroscope_random_walk', 'rostopic', 'update_rate'}
    assert 'angle random walk' in err


def test_output_holds_what_python_returns_and_every_file(recording, tmp_path, output_of):
    output = tmp_path / 'with' / 'parents'
    shown = output_of('analyze', recording, '--units', 'si', '--for', 'kalibr', '--for', 'px4',
                      '--output', output, '--json', tmp_path / 'r.json')
    assert [text in shown for text in ('rad/s/sqrt(Hz)', 'deg/h', NOTHING_SAVED)] == [
        True, False, False]
    # The last line says where to look.
    where, names = shown.splitlines()[-1].rsplit(': ', 1)
    assert where == f'Written to {output}'
    assert set(names.split(', ')) == {path.name for path in output.iterdir()} == {
        'allan_deviation.png', 'curve.csv', 'report.html', 'result.json', 'imu.yaml',
        'px4_imu.params'}
    for path in (output / 'result.json', tmp_path / 'r.json'):
        assert json.loads(path.read_text()) == imu_allan.analyze(recording).to_dict()


@pytest.mark.parametrize('processes', [True, False])
def test_the_picture_is_the_same_whatever_process_draws_it(
        recording, tmp_path, output_of, monkeypatch, processes):
    started, start_python = [], workers.start_python

    def start(*args, **more):
        started.append(args)
        if not processes:
            raise OSError('no further process')
        return start_python(*args, **more)

    monkeypatch.setattr(workers, 'start_python', start)
    monkeypatch.setattr(os, 'cpu_count', lambda: 2)
    output_of('analyze', recording, '--output', tmp_path / 'out')
    assert started
    result = imu_allan.load_result(tmp_path / 'out')
    assert (tmp_path / 'out' / 'allan_deviation.png').read_bytes() == overview_png(result)


def test_several_recordings_get_folders_and_lines_in_order(recording, tmp_path, model, fails_with):
    paths = [write_recording(tmp_path / name / 'at_rest', simulated_blocks(model, rate, 5000))
             for name, rate in (('b', 50.0), ('c', 200.0))]
    (tmp_path / 'a').mkdir()
    (tmp_path / 'a' / 'at_rest').symlink_to(recording)
    output = tmp_path / 'out'
    output.mkdir()
    # A folder that cannot be made does not keep the others from being written.
    (output / 'a_at_rest').write_text('in the way')
    (output / 'fleet.html').mkdir()
    lines = fails_with(
        f'{output}/a_at_rest/result.json: cannot be written (Not a directory); choose a folder '
        'that exists on a disk with room and may be written to; not written either: curve.csv, '
        f'report.html, allan_deviation.png\nimu_allan: {output}/fleet.html: cannot be written (is '
        'a directory); choose a folder that exists on a disk with room and may be written to',
        'analyze', tmp_path / 'a' / 'at_rest', *paths, '--output', output).splitlines()
    assert [line[:22] for line in lines[:3]] == [f'{name}_at_rest: Gyroscope: ' for name in 'abc']
    rates = {folder.name: json.loads((folder / 'result.json').read_text())['timeline'][
        'sample_rate_hz'] for folder in output.glob('[bc]*')}
    assert rates == {'b_at_rest': pytest.approx(50), 'c_at_rest': pytest.approx(200)}
    assert (output / 'c_at_rest' / 'report.html').exists()


@pytest.fixture
def two_topics(tmp_path, model):
    path = tmp_path / 'two.mcap'
    with mcap_written(path) as write:
        for topic, rate in (('/front/imu', 100.0), ('/../up', 50.0)):
            for block in simulated_blocks(model, rate, 3000, start_ns=START_NS):
                for stamp, row in serialized(block):
                    write(topic, stamp, row)
    return path


def test_all_topics_are_analyzed_as_each_alone(two_topics, tmp_path, output_of, fails_with):
    assert 'all with --all-topics' in output_of('info', two_topics)
    for option in (['--json', 'r.json'], ['--for', 'kalibr']):
        fails_with(f'{two_topics}: has 2 Imu topics, too many for {option[0]}; choose one with '
                   '--topic or use --output DIR', 'analyze', two_topics, '--all-topics', *option)
    assert not Path('r.json').exists()
    output = tmp_path / 'deep' / 'output'
    shown = output_of('analyze', two_topics, '--all-topics', '--output', output, '--jobs', '2'
                      ).splitlines()
    assert {*shown} > {'3,000 samples at 100 Hz, 30 s', '3,000 samples at 50 Hz, 60 s',
                       '2 units, not compared: topics may be of different models'}
    assert sorted(path.suffix for path in output.iterdir() if path.is_file()) == [
        '.csv', '.html', '.json']
    assert len([path for path in output.iterdir() if path.is_dir()]) == 2
    assert list((tmp_path / 'deep').iterdir()) == [output]
    for topic in ('/../up', '/front/imu'):
        folder = output / f'two_{topic[1:].replace("/", "_")}'
        output_of('analyze', two_topics, '--topic', topic, '--json',
                  tmp_path / 'alone.json')
        assert (folder / 'result.json').read_text() == (tmp_path / 'alone.json').read_text()


def test_of_all_topics_the_one_without_a_coefficient_is_named(tmp_path, fails_with):
    path = tmp_path / 'a.mcap'
    with mcap_written(path) as write:
        for number, row in enumerate(np.random.default_rng(1).normal(size=(3000, 6))):
            stamp = START_NS + number * 10**7
            for topic in ['/imu', '/short'][:1 + (number < 20)]:
                write(topic, stamp, encode_imu(stamp, row, 'imu'))
    fails_with(f'{path}, topic /short: no coefficient. Gyroscope: not usable: 20 samples in 200 '
               'ms. Accelerometer: not usable: 20 samples in 200 ms.',
               'analyze', path, '--all-topics')


def test_start_and_duration_choose_a_part(recording, analyzed, fails_with, capsys):
    result = analyzed(recording, '--start', '1min', '--duration', '100')
    assert result['timeline']['samples'] == 10_000
    assert result['source']['start_time'].startswith('2023-11-14T22:14:20')
    fails_with(f'{recording}: lasts 5 min: --start 2 h leaves nothing of it',
               'analyze', recording, '--start', '2h')
    fails_with(f'{recording}, topic /imu/data_raw: no usable sample in the chosen part; --start '
               'and --duration choose another', 'analyze', recording, '--duration', '1ms')
    for part, short in ((['--start', '3min'], True), ([], False)):
        analyzed(recording, '--duration', '5min', '--verbose', *part)
        assert short == ('only 2 min of the 5 min asked for are recorded'
                         in ' '.join(capsys.readouterr().out.split()))


def test_a_stated_rate_that_contradicts_the_stamps_must_be_forced(recording, analyzed, fails_with):
    # The simulator receives each message when it is stamped, so there is no other clock.
    fails_with(f'{recording}, topic /imu/data_raw: the stated rate is 200 Hz, but the times '
               'advance at 100 Hz. Leave out the rate, or count samples at the stated rate '
               '(analyze --clock none)',
               'analyze', recording, '--rate', '200')
    assert analyzed(recording, '--rate', '200', '--clock', 'none')[
        'timeline']['sample_rate_hz'] == 200


def test_motion_can_be_kept_and_the_clock_be_chosen(tmp_path, model, analyzed):
    [block] = simulated_blocks(model, 100.0, 30_000, start_ns=START_NS, block_samples=30_000)
    block.samples[12_000:12_500] += np.sin(np.arange(500))[:, None]
    path, density = write_recording(tmp_path / 'shaken', iter([block])), {}
    for choice, clock in (('exclude', 'header'), ('keep', 'receive')):
        result = analyzed(path, '--motion', choice, '--clock', clock)
        density[choice] = result['axes']['gyro_x']['curve']['adev'][0]
        assert bool(result['timeline']['motion']) == (choice == 'exclude')
        assert result['source']['clock'] == clock
    assert density['keep'] > 2 * density['exclude']


def on_a_terminal(arguments):
    """Return what the command writes to a stderr that is a terminal."""
    master, slave = pty.openpty()
    with subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=slave,
                          env={**os.environ, 'TERM': 'xterm', 'COLUMNS': '300'}) as process:
        os.close(slave)
        seen = b''
        # Linux tells by an error that nobody writes any more.
        with contextlib.suppress(OSError):
            while more := os.read(master, 65536):
                seen += more
    os.close(master)
    assert process.returncode == 0
    return seen


def test_progress_is_shown_on_a_terminal_only_and_can_be_switched_off(recording, tmp_path):
    # A name in brackets is no markup of the terminal.
    (link := tmp_path / '[b]').symlink_to(recording)
    seen = on_a_terminal([*COMMAND, str(link)])
    assert b'100%' in seen
    assert b'[b]' in seen
    assert on_a_terminal([*COMMAND, str(recording), '--no-progress']) == b''


def test_an_unwritable_output_is_reported_first(recording, tmp_path, monkeypatch, fails_with):
    file, deep = tmp_path / 'file', tmp_path / 'file' / 'deep'
    file.write_text('')
    monkeypatch.setattr(workers, 'characterize', pytest.fail)
    for option, path, named, reason in (
            *(('--output', path, path, 'Not a directory') for path in (file, deep)),
            ('--json', deep, file, 'Not a directory')):
        fails_with(f'{named}: cannot be written ({reason}); choose a folder that may be written '
                   'to', 'analyze', recording, option, path)


def test_what_fails_leaves_no_empty_folder(tmp_path, fails_with):
    (tmp_path / 'a.csv').write_text('time_s,gyro_x\n')
    fails_with(f'{tmp_path}/a.csv: no line of samples below the names of the columns',
               'analyze', tmp_path / 'a.csv', '--output', tmp_path / 'with' / 'parents')
    assert [path.name for path in tmp_path.iterdir()] == ['a.csv']


def test_a_result_that_cannot_be_saved_is_shown_all_the_same(recording, tmp_path, fails_with):
    # A folder in the place of the file: found out by writing alone, as a full disk is.
    assert 'angle random walk' in fails_with(
        f'{tmp_path}: cannot be written (is a directory); choose a folder that exists on a disk '
        'with room and may be written to', 'analyze', recording, '--json', tmp_path)


@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ,
                    reason='IMU_ALLAN_DATA names no folder of real recordings')
def test_a_real_recording_is_characterized_in_well_under_a_minute(tmp_path):
    recording = Path(os.environ['IMU_ALLAN_DATA']) / 'adis16405_imu2'
    before = os.times()
    subprocess.run([*COMMAND, str(recording), '--output', str(tmp_path)], check=True,
                   stdout=subprocess.DEVNULL)
    after = os.times()
    # Of the processor, which others may use meanwhile.
    assert sum(after[2:4]) - sum(before[2:4]) < 30
    axes = json.loads((tmp_path / 'result.json').read_text())['axes']
    for axis, density in (('gyro_x', 7.0e-4), ('gyro_y', 7.4e-4), ('gyro_z', 6.7e-4)):
        assert axes[axis]['coefficients']['noise_density']['value'] == pytest.approx(
            density, rel=0.03)
