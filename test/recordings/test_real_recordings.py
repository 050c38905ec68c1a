# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of real sensors, and files of rosbag2 and MCAP themselves, where they are there."""

import os
from pathlib import Path
import shutil

from bags import refusal
from imu_allan.recordings import open_recording, read_blocks, recordings_in
from imu_messages import codes, run
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from whole_lines import Varying

DATA = Path(os.environ.get('IMU_ALLAN_DATA', 'IMU_ALLAN_DATA is not set'))
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason='IMU_ALLAN_DATA is not set')


@pytest.mark.parametrize(('name', 'topic', 'count'), [
    ('adis16405_imu2', '/imu/data_raw', 1_000_000), ('nested_imu_mcap', '/imu', 2983),
    ('robot_localization_test1_2imu_xsens', '/xsens/imu_data', 13_334)])
def test_a_recording_agrees_with_rosbags(name, topic, count):
    path = DATA / name
    with open_recording(path) as recording:
        assert {each.name: each.count for each in recording.topics}[topic] == count
        ours = next(iter(read_blocks(recording, topic)))
        assert recording.remarks == []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        messages = reader.messages([each for each in reader.connections if each.topic == topic])
        for number, (connection, stamp, raw) in zip(
                range(min(len(ours), 3000)), messages, strict=False):
            message = reader.deserialize(raw, connection.msgtype)
            their = getattr(message, 'imu', message)
            gyro, accel = their.angular_velocity, their.linear_acceleration
            assert ours.samples[number].tolist() == [
                gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z]
            assert ours.receive_ns[number] == stamp
            assert ours.header_ns[number] == (
                their.header.stamp.sec * 10**9 + their.header.stamp.nanosec)
            assert ours.frame_id == their.header.frame_id


@pytest.mark.parametrize('path', sorted(DATA.glob('metadata_versions/*.yaml')),
                         ids=lambda path: path.name[:2])
def test_metadata_of_every_version_is_understood(tmp_path, path):
    shutil.copy(path, tmp_path / 'metadata.yaml')
    assert refusal(tmp_path) == Varying(
        'missing <words>: no file that metadata.yaml lists is there; copy them beside it')


@pytest.mark.parametrize('path', sorted(
    {*DATA.glob('mcap_fixtures/*.mcap')} | {
        path for kind in ('db3', 'mcap', 'zstd') for file in DATA.glob(f'rosbag2_*/**/*.{kind}')
        for path in recordings_in(file.parent)}), ids=lambda path: path.name[:20])
def test_bags_of_rosbag2_and_of_mcap_itself_are_refused_for_what_they_are(path):
    assert refusal(path) in (
        Varying('no topic of type sensor_msgs/msg/Imu; it holds <words>'),
        'it holds no topics at all: the recording is empty',
        'a git-LFS pointer, not the recording itself; fetch it with: git lfs pull')


def test_repeated_and_backward_header_stamps_of_a_real_driver_are_counted():
    with open_recording(DATA / 'robot_localization_test1_2imu_xsens') as recording:
        summary, _ = run(read_blocks(recording, '/my_odometry2imu/imu_data'))
    assert summary.messages == 13_333
    assert (summary.counts.header.repeats, summary.counts.header.backward) == (347, 31)
    # At the end more are out of order, and receive stamps are used, as is reported.
    assert (summary.timeline.duplicates, summary.timeline.out_of_order) == (342, 24)
    assert 'clock_changed' in codes(summary)
    assert summary.timeline.sample_rate_hz == pytest.approx(100.0, rel=1e-4)
    assert not summary.mostly_motion
    # Its accelerometer is all zeros: the axes are constant, and nobody has removed gravity.
    assert 'gravity' not in codes(summary)


def test_a_real_sensor_at_rest_loses_nothing_but_one_knock_that_is_there():
    with open_recording(DATA / 'adis16405_imu2') as recording:
        summary, _ = run(read_blocks(recording, '/imu/data_raw'))
    assert summary.timeline.sample_rate_hz == 100.0
    assert summary.timeline.samples == 1_000_000
    assert summary.timeline.missing == summary.timeline.rejected == 0
    assert summary.timeline.gaps == ()
    # Between 99.3 and 100.2 s all three accelerometers ring with eight times their usual power.
    (knock,) = summary.timeline.motion
    assert knock.start_s < 99.3
    assert knock.start_s + knock.duration_s > 100.2
    assert knock.duration_s <= 3.0
    assert not summary.mostly_motion
