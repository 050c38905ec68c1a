# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from collections.abc import Iterator
import os
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.cli.main import main
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.simulated_imu import simulated_blocks
import numpy as np
from other_types import full_definition, imu, store_with, write_mcap
import pytest
from whole_lines import Varying

CLOCK = ('  clock       header stamps: each stamp shows its place, single missing samples are '
         'seen')
START_NS = 1_700_000_000 * 10**9


def test_clean_recording_is_described(
        imu_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['info', str(imu_recording)]) == 0
    shown = capsys.readouterr()
    assert shown.err == ''
    assert shown.out.splitlines() == [
        Varying(f'{imu_recording}  <number> MB'), '', '/imu/data_raw', '  messages    30,000',
        '  frame_id    imu_link', '  start       2023-11-14T22:13:20Z', '  duration    5 min',
        '  rate        100 Hz, jitter below 1 us', CLOCK, '  faults      none']


def faulty(model: NoiseModel) -> Iterator[ImuBlock]:
    for block in simulated_blocks(model, 100.0, 20_000, start_ns=START_NS,
                                  block_samples=20_000):
        stamps = block.header_ns.copy()
        stamps[500] = stamps[499]
        keep = np.ones(20_000, dtype=bool)
        keep[1000:1003] = keep[5000:6000] = False
        yield ImuBlock(stamps[keep], block.receive_ns[keep], block.samples[keep],
                       block.absent[keep], block.frame_id)


def test_gaps_and_faults_are_counted(
        tmp_path: Path, model: NoiseModel, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['info', str(write_recording(tmp_path / 'faulty', faulty(model)))]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert '  faults      1,004 missing, 1 duplicate, 1 repeated header stamp' in shown
    assert '  gaps        1, 10 s in all: 10 s at 50 s' in shown


def test_sensor_that_is_not_there_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from imu_allan.sensor.noise_model import parse_model
    gyro = parse_model('gyro: {noise_density: 0.005 deg/s/sqrt(Hz)}')
    path = write_recording(tmp_path / 'gyro', simulated_blocks(gyro, 100.0, 500))
    assert main(['info', str(path)]) == 0
    assert '  absent      accel_x, accel_y, accel_z' in capsys.readouterr().out.splitlines()


def test_recording_without_imu_says_what_it_holds(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / 'talk', version=9) as writer:
        connection = writer.add_connection('/chatter', 'std_msgs/msg/String', typestore=store)
        writer.write(connection, 1, b'\x00\x01\x00\x00\x02\x00\x00\x00a\x00')
    assert main(['info', str(tmp_path / 'talk')]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {tmp_path}/talk: no topic of type sensor_msgs/msg/Imu; it holds /chatter '
        '(std_msgs/msg/String)\n')


@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ,
                    reason='IMU_ALLAN_DATA names no folder of real recordings')
def test_clock_faults_of_a_real_recording_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(os.environ['IMU_ALLAN_DATA']) / 'robot_localization_test1_2imu_xsens'
    assert main(['info', str(path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line for line in shown if line.startswith('  faults')] == [
        '  faults      45 missing, 590 repeated receive stamps',
        '  faults      423 missing, 31 out of order, 347 duplicates, 347 repeated header stamps, '
        '31 backward header stamps, 9,658 repeated receive stamps']
    assert '  /stereo_odometer/odometry  nav_msgs/msg/Odometry' in shown


def test_an_imu_inside_another_message_is_named_with_how_it_is_read(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kind = 'my_driver/msg/Stamped'
    store = store_with({kind: 'string raw\nsensor_msgs/Imu imu\n'})
    for name in ('run_10', 'run_9'):
        (tmp_path / name).mkdir()
        write_mcap(tmp_path / name / 'a.mcap', kind, full_definition(store, kind),
                   [store.serialize_cdr(store.types[kind]('a', imu(store, number)), kind)
                    for number in range(20)])
    assert main(['info', str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert shown.index('run_9') < shown.index('run_10')
    assert shown.count('  read as     my_driver/msg/Stamped, its field imu '
                       '(sensor_msgs/msg/Imu)\n') == 2


def test_a_topic_that_might_hold_an_imu_is_listed_with_the_reason(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = store_with({})
    path = write_mcap(tmp_path / 'a.mcap', 'sensor_msgs/msg/Imu',
                      full_definition(store, 'sensor_msgs/msg/Imu'),
                      [store.serialize_cdr(imu(store, number), 'sensor_msgs/msg/Imu')
                       for number in range(20)], topic='/imu')
    assert main(['info', str(path), '--gyro', 'rate', '--gyro-topic', '/other']) == 0
    assert '/imu' in capsys.readouterr().out.splitlines()
    assert main(['info', str(path), '--gyro', 'rate']) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {path}: no topic of type sensor_msgs/msg/Imu; it holds /imu '
        '(sensor_msgs/msg/Imu); --gyro rate: sensor_msgs/msg/Imu has no field rate; it has '
        'header, orientation, orientation_covariance, angular_velocity, '
        'angular_velocity_covariance, linear_acceleration, linear_acceleration_covariance\n')


def test_a_folder_is_described_to_its_end_though_one_recording_cannot_be_read(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ('1', '3'):
        (tmp_path / name).symlink_to(recording)
    (tmp_path / '2').mkdir()
    (tmp_path / '2' / 'broken.mcap').write_bytes(b'nothing')
    assert main(['info', str(tmp_path)]) == 1
    shown = capsys.readouterr()
    assert shown.out.count('  messages    30,000\n') == 2
    assert shown.err == (
        f'imu_allan: {tmp_path}/2/broken.mcap: neither a rosbag2 directory nor a .mcap, .db3, '
        'ROS 1 .bag, PX4 .ulg, ArduPilot .bin or CSV file\n')


def constant_and_faulty(model: NoiseModel) -> Iterator[ImuBlock]:
    for block in simulated_blocks(model, 100.0, 40_000, start_ns=START_NS,
                                  block_samples=40_000):
        block.samples[:, 1] = block.samples[0, 1]
        keep = np.ones(40_000, dtype=bool)
        for first in range(5000, 35_000, 3123):
            keep[first:first + 777] = False
        yield ImuBlock(block.header_ns[keep], block.receive_ns[keep], block.samples[keep],
                       block.absent[keep], block.frame_id)


def test_a_constant_axis_is_named_and_no_line_is_longer_than_the_terminal(
        tmp_path: Path, model: NoiseModel, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_recording(tmp_path / 'bag', constant_and_faulty(model))
    monkeypatch.setattr('sys.stdout.isatty', lambda: True)
    monkeypatch.setenv('COLUMNS', '100')
    assert main(['info', str(path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert '  constant    gyro y: every sample is the same' in shown
    gaps = shown.index('  gaps        10, 78 s in all: 7.77 s at 50 s, 7.77 s at 81 s, 7.77 s at '
                       '112 s, 7.77 s at 2 min 24')
    assert shown[gaps + 1] == '              s, 7.77 s at 2 min 55 s and 5 more'
    assert max(map(len, shown[1:])) <= 100
