# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs that write a recording and that describe one: simulate and info."""

import os
from pathlib import Path
from threading import Thread

from bags import block, read
import imu_allan
from imu_allan.recordings.write import write_recording
import numpy as np
from other_types import full_definition, imu, store_with, write_mcap
import pytest
from repeated import slow
from whole_lines import Varying

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize('storage', ['mcap', slow('sqlite3')])
def test_analysis_of_a_simulated_recording_finds_the_model(storage, tmp_path, output_of):
    output = tmp_path / 'simulated'
    assert output_of('simulate', CONFIG / 'consumer_mems.yaml', '--storage', storage, '--rate',
                     '200', '--duration', '10min', '--output', output) == f'{output}\n'
    assert any(output.glob(f'*.{"mcap" if storage == "mcap" else "db3"}'))
    result = imu_allan.analyze(output)
    assert result.timeline.samples == 120_000
    assert result.timeline.sample_rate_hz == pytest.approx(200, rel=1e-9)
    for axis, density in (('gyro_x', np.deg2rad(0.008)), ('accel_y', 150e-6 * 9.80665)):
        low, high = result.axes[axis].coefficients['noise_density'].ci95
        assert low * 0.99 < density < high * 1.01


def test_the_same_seed_gives_the_same_samples_and_another_others(tmp_path, output_of):
    samples = []
    for name, seed in (('a', '7'), ('b', '7'), ('c', '8')):
        output_of('simulate', 'tactical_mems', '--duration', '20s', '--seed', seed, '--output',
                  tmp_path / name)
        samples.append(read(tmp_path / name)[0].samples)
    np.testing.assert_array_equal(samples[0], samples[1])
    assert np.all(samples[0] != samples[2])


def test_without_output_the_recording_is_named_after_the_model_and_replaces_nothing(
        tmp_path, monkeypatch, output_of, fails_with):
    monkeypatch.chdir(tmp_path)
    for model in (CONFIG / 'tactical_mems.yaml', 'consumer_mems'):
        output_of('simulate', model, '--duration', '1s')
        assert (tmp_path / Path(model).stem / 'metadata.yaml').is_file()
    (tmp_path / 'mine').mkdir()
    fails_with('mine: exists already; name another folder with --output',
               'simulate', 'tactical_mems', '--duration', '1s', '--output', 'mine')
    assert list((tmp_path / 'mine').iterdir()) == []
    # The recording beside it is no datasheet, whatever its name.
    assert 'the DATASHEET consumer_mems' in output_of(
        'export', '--spec', 'consumer_mems', '--for', 'plain', '--rate', '100')


def test_a_model_may_come_through_a_pipe(tmp_path, output_of):
    os.mkfifo(tmp_path / 'pipe')
    Thread(target=(tmp_path / 'pipe').write_bytes, args=(
        (CONFIG / 'consumer_mems.yaml').read_bytes(),), daemon=True).start()
    output_of('simulate', tmp_path / 'pipe', '--duration', '1s', '--output', tmp_path / 'out')
    assert len(read(tmp_path / 'out')[0]) == 100


@pytest.mark.parametrize(('model', 'options', 'line'), [
    ('{path}', '', "{path}: gyro.noise_density: '5' has no unit; write a number with its unit, "
     "such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'"),
    ('consumer_mems', '--rate 1 --duration 0.1', '--duration 0.1: shorter than one sample at '
     '--rate 1; simulate for longer')])
def test_what_cannot_be_simulated_is_one_line(model, options, line, tmp_path, fails_with):
    path = tmp_path / 'model.yaml'
    path.write_text('gyro: {noise_density: 5}')
    fails_with(line.format(path=path), 'simulate', model.format(path=path), *options.split(),
               '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def test_clean_recording_is_described(imu_recording, recording, output_of):
    assert output_of('info', imu_recording).splitlines() == [
        Varying(f'{imu_recording}  <number> MB'), '', '/imu/data_raw', '  messages    30,000',
        '  frame_id    imu_link', '  start       2023-11-14T22:13:20Z', '  duration    5 min',
        '  rate        100 Hz, jitter below 1 us',
        '  clock       header stamps', '  faults      none']
    assert '  absent      accel x, y and z' in output_of('info', recording).splitlines()


def test_gaps_and_faults_are_counted(tmp_path, output_of):
    messages, keep = block(20_000), np.ones(20_000, dtype=bool)
    messages.header_ns[500] = messages.header_ns[499]
    keep[1000:1003] = keep[5000:6000] = False
    path = write_recording(tmp_path / 'faulty', [messages.part(keep)])
    shown = output_of('info', path).splitlines()
    assert '  faults      1,004 missing, 1 duplicate, 1 repeated header stamp' in shown
    assert '  gaps        1, 1 s in all: 1 s at 5 s' in shown


def test_a_field_that_no_message_has_is_one_line(recording, tmp_path, output_of, fails_with):
    store = store_with({})
    path = write_mcap(tmp_path / 'a.mcap', 'sensor_msgs/msg/Imu',
                      full_definition(store, 'sensor_msgs/msg/Imu'),
                      [store.serialize_cdr(imu(store, number), 'sensor_msgs/msg/Imu')
                       for number in range(20)], topic='/imu')
    for source, topic in ((path, '/imu'), (recording, '/imu/data_raw')):
        fails_with(f'{source}: no topic of type sensor_msgs/msg/Imu; it holds {topic} '
                   '(sensor_msgs/msg/Imu); --gyro rate: sensor_msgs/msg/Imu has no field rate; it '
                   'has header, orientation, orientation_covariance, angular_velocity, '
                   'angular_velocity_covariance, linear_acceleration, '
                   'linear_acceleration_covariance', 'info', source, '--gyro', 'rate')
    output_of('info', path, '--gyro', 'rate', '--gyro-topic', '/other')


@pytest.mark.parametrize(('option', 'line'), [
    ('--stamp', '--stamp is for messages whose fields are named: give --gyro or --accel, too'),
    ('--accel-rate', '{recording}: --accel-rate is for an accelerometer on a topic of its own; '
                     '--rate is for both')])
def test_an_option_that_would_change_nothing_is_refused(recording, option, line, fails_with):
    fails_with(line.format(recording=recording), 'analyze', recording, option, '5')


def test_an_imu_inside_another_message_is_named_with_how_it_is_read(tmp_path, output_of):
    kind = 'my_driver/msg/Stamped'
    store = store_with({kind: 'string raw\nsensor_msgs/Imu imu\n'})
    for name in ('run_10', 'run_9'):
        (tmp_path / name).mkdir()
        write_mcap(tmp_path / name / 'a.mcap', kind, full_definition(store, kind),
                   [store.serialize_cdr(store.types[kind]('a', imu(store, number)), kind)
                    for number in range(20)])
    shown = output_of('info', tmp_path)
    assert shown.index('run_9') < shown.index('run_10')
    assert shown.count('  read as     my_driver/msg/Stamped, its field imu '
                       '(sensor_msgs/msg/Imu)\n') == 2


def test_a_table_without_times_is_counted_in_short_lines(tmp_path, output_of, monkeypatch):
    path = tmp_path / 'untimed.csv'
    path.write_text('gyro_x,gyro_y\n' + ''.join(f'{number % 7},1\n' for number in range(500)))
    monkeypatch.setenv('COLUMNS', '50')
    shown = output_of('info', path, '--rate', '100Hz').splitlines()
    assert '  constant    gyro y: every sample is the same' in shown
    assert 'gyro z: left out: the table has no such' in '\n'.join(shown)
    assert 'NaN' not in '\n'.join(shown)
    clock = shown.index('  clock       none: samples are counted at the')
    assert shown[clock + 1] == '              stated rate'
    assert max(map(len, shown[1:])) <= 50
