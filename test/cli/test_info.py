# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan.recordings.write import write_recording
from imu_allan.sensor.simulated_imu import simulated_blocks
import numpy as np
from other_types import full_definition, imu, store_with, write_mcap
from whole_lines import Varying


def test_clean_recording_is_described(imu_recording, recording, output_of):
    assert output_of('info', imu_recording).splitlines() == [
        Varying(f'{imu_recording}  <number> MB'), '', '/imu/data_raw', '  messages    30,000',
        '  frame_id    imu_link', '  start       2023-11-14T22:13:20Z', '  duration    5 min',
        '  rate        100 Hz, jitter below 1 us',
        '  clock       header stamps: each stamp shows its place, single missing samples are seen',
        '  faults      none']
    assert '  absent      accel x, y and z' in output_of('info', recording).splitlines()


def test_gaps_and_faults_are_counted(tmp_path, model, output_of):
    [block] = simulated_blocks(model, 100.0, 20_000, start_ns=10**18, block_samples=20_000)
    stamps, keep = block.header_ns.copy(), np.ones(20_000, dtype=bool)
    stamps[500] = stamps[499]
    keep[1000:1003] = keep[5000:6000] = False
    path = write_recording(tmp_path / 'faulty', [replace(block, header_ns=stamps).part(keep)])
    shown = output_of('info', path).splitlines()
    assert '  faults      1,004 missing, 1 duplicate, 1 repeated header stamp' in shown
    assert '  gaps        1, 10 s in all: 10 s at 50 s' in shown


def test_a_field_that_no_message_has_is_one_line(tmp_path, output_of, fails_with):
    store = store_with({})
    path = write_mcap(tmp_path / 'a.mcap', 'sensor_msgs/msg/Imu',
                      full_definition(store, 'sensor_msgs/msg/Imu'),
                      [store.serialize_cdr(imu(store, number), 'sensor_msgs/msg/Imu')
                       for number in range(20)], topic='/imu')
    fails_with(f'{path}: no topic of type sensor_msgs/msg/Imu; it holds /imu '
               '(sensor_msgs/msg/Imu); --gyro rate: sensor_msgs/msg/Imu has no field rate; it has '
               'header, orientation, orientation_covariance, angular_velocity, '
               'angular_velocity_covariance, linear_acceleration, '
               'linear_acceleration_covariance', 'info', path, '--gyro', 'rate')
    output_of('info', path, '--gyro', 'rate', '--gyro-topic', '/other')


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
    monkeypatch.setattr('sys.stdout.isatty', lambda: True)
    monkeypatch.setenv('COLUMNS', '50')
    shown = output_of('info', path, '--rate', '100Hz').splitlines()
    assert '  constant    gyro y: every sample is the same' in shown
    clock = shown.index('  clock       none: samples are counted at the')
    assert shown[clock + 1] == '              stated rate'
    assert max(map(len, shown[1:])) <= 50
