# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of real sensors, and files of rosbag2 and MCAP themselves, where they are there."""

import os
from pathlib import Path
import shutil

from bags import refusal
from imu_allan.recordings import choose_topic, open_recording, read_blocks, recordings_in
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from whole_lines import refused, Varying

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
    {path for file in (*DATA.glob('rosbag2_*/**/*.db3'), *DATA.glob('rosbag2_*/**/*.mcap'),
                       *DATA.glob('rosbag2_*/**/*.zstd'))
     for path in recordings_in(file.parent)}), ids=lambda path: path.name)
def test_bags_of_rosbag2_itself_are_refused_for_what_they_are(path):
    line = Varying(f'{path}: no topic of type sensor_msgs/msg/Imu; it holds <words>')
    with open_recording(path) as recording, refused(line):
        choose_topic(recording)


@pytest.mark.parametrize('path', sorted(DATA.glob('mcap_fixtures/*.mcap')),
                         ids=lambda path: path.name[:8])
def test_fixtures_of_mcap_itself_are_named_for_what_they_are(path):
    assert refusal(path) in (
        'it holds no topics at all: the recording is empty',
        'a git-LFS pointer, not the recording itself; fetch it with: git lfs pull')
