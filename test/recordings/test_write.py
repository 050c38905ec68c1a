# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings that imu_allan writes, read by itself and by others."""

from dataclasses import replace
import sqlite3

from bags import assert_same, block, read
from imu_allan.recordings import open_recording
from imu_allan.recordings.write import write_recording
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from whole_lines import refused
import yaml

MESSAGES = replace(block(17_000), absent=np.arange(34_000).reshape(17_000, 2) % 3 == 0)


@pytest.mark.parametrize(('storage', 'compression'), [
    ('mcap', 'zstd'), ('mcap', ''), ('sqlite3', '')])
@pytest.mark.parametrize('size', [1, 17_000])
def test_every_bit_comes_back_and_rosbags_reads_the_same(tmp_path, storage, compression, size):
    messages = MESSAGES.part(slice(min(1000 * size, len(MESSAGES))))
    parts = [messages.part(slice(start, start + size)) for start in range(0, len(messages), size)]
    bag = write_recording(tmp_path / 'bag', parts, topic='/a', storage=storage,
                          compression=compression)
    with open_recording(bag) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/a', len(messages))]
    after, remarks = read(bag)
    assert_same(messages, after)
    assert remarks == []
    [file] = (path for path in bag.iterdir() if path.suffix != '.yaml')
    assert_same(messages, read(file)[0])
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert reader.message_count == len(messages)
        assert reader.topics['/a'].msgtype == 'sensor_msgs/msg/Imu'
        assert reader.start_time == messages.receive_ns.min()
        for number, (connection, stamp, raw) in zip(range(300), reader.messages(), strict=False):
            message = reader.deserialize(raw, connection.msgtype)
            header = message.header.stamp
            assert (stamp, header.sec * 10**9 + header.nanosec, message.linear_acceleration.y) == (
                messages.receive_ns[number], messages.header_ns[number],
                messages.samples[number, 4])


def test_metadata_and_database_are_of_jazzys_version(tmp_path):
    bag = tmp_path / 'my bag'
    assert write_recording(str(bag), [block(10)], storage='sqlite3') == bag
    information = yaml.safe_load((bag / 'metadata.yaml').read_text())[
        'rosbag2_bagfile_information']
    assert [information[key] for key in (
        'version', 'storage_identifier', 'relative_file_paths', 'message_count')] == [
        9, 'sqlite3', ['my bag.db3'], 10]
    with sqlite3.connect(bag / 'my bag.db3') as database:
        assert database.execute('PRAGMA integrity_check').fetchall() == [('ok',)]
        assert {name for [name] in database.execute('SELECT name FROM sqlite_master')} == {
            'schema', 'metadata', 'topics', 'message_definitions', 'messages', 'timestamp_idx'}
        assert database.execute('SELECT * FROM schema').fetchall() == [(4, 'rosbags')]
    database.close()


def test_what_is_interrupted_leaves_nothing(tmp_path):
    def interrupted():
        yield block(5000)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_recording(tmp_path / 'bag', interrupted())
    assert list(tmp_path.iterdir()) == []


def test_what_exists_is_not_overwritten_and_a_place_must_be_writable(tmp_path):
    bag = write_recording(tmp_path / 'bag', [block(10)])
    with refused(f'{bag}: exists already; choose another name or remove it'):
        write_recording(bag, [block(20)])
    assert len(read(bag)[0]) == 10
    (tmp_path / 'file').touch()
    with refused(
            f'{tmp_path}/file/bag: cannot be created (File exists: {tmp_path}/file); choose a '
            'folder that may be written to'):
        write_recording(tmp_path / 'file' / 'bag', [block(10)])
    for name in 'a?b', 'a#b', 'a%20b':
        with refused(f'{tmp_path}/{name}: choose a name without ?, # and %'):
            write_recording(tmp_path / name, [block(10)], storage='sqlite3')
    assert {path.name for path in tmp_path.iterdir()} == {'bag', 'file'}
