# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Opening by what a file is, and the choice of a topic."""

from contextlib import closing
from dataclasses import replace
import os
from pathlib import Path
import tempfile

import bags
from bags import assert_same, block, read, refusal, write_db3, write_mcap
from imu_allan.errors import printable
from imu_allan.recordings import open_recording, read_blocks, RecordingOptions, recordings_in
from imu_messages import encode_imu
import numpy as np
from processes import python
import pytest
from whole_lines import refused
import zstandard

BOTH = 'time,gyro_x,accel_x\n1,2,3\n'
BARE = encode_imu(1, np.zeros(6), 'imu')
NOISE = replace(block(600), samples=np.random.default_rng(1).normal(0, 0.01, (600, 6)))


@pytest.mark.parametrize(('name', 'content', 'reason'), [
    ('a.mcap', b'', 'the file is empty'),
    ('a.mcap', b'version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12\n',
     'a git-LFS pointer, not the recording itself; fetch it with: git lfs pull'),
    ('a.mcap', b'\x89PNG\r\n\x1a\n' + bytes(100),
     'neither a rosbag2 directory nor a .mcap, .db3, ROS 1 .bag, PX4 .ulg, ArduPilot .bin or CSV '
     'file'),
    ('a.mcap', b'\x89MCAP', 'not an MCAP file'),
    ('a.db3', b'SQLite format 3\0' + bytes(200),
     'not a readable rosbag2 database (file is not a database)'),
    ('a.bag', b'#ROSBAG V1.2\nsomething else',
     'ROS bag version 1.2 is not supported; convert it to 2.0 with: rosbag fix'),
    ('a.bag', b'#ROSBAG V2.0', 'cut short within its first line; copy it again'),
    ('a.bag', b'#ROSBAG V2.0\n' + bags.ros1_record(
        op=b'\3', encryptor=b'rosbag/AesCbcEncryptor'),
     'encrypted; decrypt it with: rosbag decrypt'),
    ('metadata.yaml', b'rosbag2_bagfile_information:\n',
     'describes the recording in its folder; name the folder'),
])
def test_what_is_no_recording_is_named_for_what_it_is(tmp_path, name, content, reason):
    assert refusal(tmp_path / name, content) == reason


def test_content_counts_not_the_name_nor_a_link_and_a_pipe_is_not_waited_for(tmp_path):
    assert_same(block(10), read(write_mcap(tmp_path / 'a.db3', block(10)))[0])
    bags.write_db3(tmp_path / 'a.mcap', block(10))
    (tmp_path / 'link').symlink_to(tmp_path / 'a.mcap')
    assert_same(block(10), read(tmp_path / 'link')[0])
    os.mkfifo(tmp_path / 'pipe')
    assert refusal(tmp_path / 'pipe') == 'not a file'
    for name in ('none.mcap', 'a\0b'):
        assert refusal(tmp_path / name) == 'no such file or directory'


def test_columns_are_named_of_tables_alone_and_fields_of_messages(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', block(10))
    with refused(f'{path}: --columns is for CSV files; --gyro and --accel name the fields of '
                 'messages'):
        open_recording(path, options=RecordingOptions(columns=(('gyro_x', 'w'),)))
    table = tmp_path / 'a.csv'
    table.write_text('time_s,gyro_x\n0,1\n0.01,2\n')
    with refused(f'{table}: --gyro and --accel name fields of messages, or a unit alone as '
                 ':deg/s; --columns names the columns of a CSV file'):
        open_recording(table, options=RecordingOptions(gyro='gyro_x deg/s'))


@pytest.mark.parametrize('name', ['ä日.mcap', 'line\nbreak \x1b[31m.mcap'])
def test_any_name_is_read_and_no_name_breaks_a_line(tmp_path, name):
    path = write_mcap(tmp_path / name, block(10))
    assert_same(block(10), read(path)[0])
    path.write_bytes(path.read_bytes()[:-60])
    assert printable(path).isprintable()
    assert refusal(path, topic='/n\none') == (
        'no topic /n\\none; its Imu topics are /imu (10 messages)')


@pytest.mark.parametrize(('topics', 'topic', 'reason'), [
    ([], None, 'it holds no topics at all: the recording is empty'),
    ([('/b', 1, BARE), ('/a', 1, BARE)], None,
     '2 Imu topics; choose one with --topic, or analyze each with --all-topics: '
     '/a (1 message), /b (1 message)'),
    ([('/a', 1, BARE)], '/c', 'no topic /c; its Imu topics are /a (1 message)'),
    ([('/a', 1, BARE), ('/c', 1, b'', 'std_msgs/msg/Bool')], 'c',
     'topic /c is of type std_msgs/msg/Bool, not sensor_msgs/msg/Imu'),
    ([('/a',)], 'a', 'topic /a has no messages; record it while the IMU driver runs'),
    ([('/a', 1, b'')], None, 'topic /a holds no readable message (0 bytes are too few for a '
     'message); --topic names another'),
    ([('/a', 1, b'{}', bags.IMU, '', ('json', 'jsonschema'))], None,
     'no topic of type sensor_msgs/msg/Imu; it holds /a (sensor_msgs/msg/Imu encoded as json)')])
def test_a_topic_that_is_not_clear_is_one_line(tmp_path, topics, topic, reason):
    with bags.mcap_written(tmp_path / 'a.mcap') as message:
        for each in topics:
            message(*each)
    assert refusal(tmp_path / 'a.mcap', topic=topic) == reason


@pytest.mark.usefixtures('children_unmeasured')
def test_importing_recordings_loads_no_container_library():
    loaded = python('-c', 'import sys, imu_allan.recordings; print(*sys.modules)', check=True)
    assert {'mcap', 'sqlite3', 'rosbags', 'yaml', 'zstandard', 'pint', 'scipy'}.isdisjoint(
        loaded.stdout.split())


def test_a_folder_of_several_recordings_is_listed_by_growing_numbers(tmp_path):
    for name in ('run_10', 'run_9', '.hidden', 'notes'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'readme.txt').touch()
    write_mcap(tmp_path / 'run_10' / 'a.mcap', block(10))
    (tmp_path / 'run_9' / 'metadata.yaml').touch()
    (tmp_path / 'run_100.bag').touch()
    for name, columns in (('gyro', 'time_s,gyro_z'), ('odd', '1,2,3'), ('gps', 'time_s,latitude')):
        (tmp_path / f'{name}.csv').write_text(f'{columns}\n1,2\n')
    # Phones: a table of each sensor, and others in a folder of their own.
    for name in 'phone/Gyroscope', 'phone/Accelerometer', 'phone/meta/device':
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f'{name}.csv').write_text('time_s,x,y,z\n1,2,3,4\n2,3,4,5\n')
    several = ['gyro.csv', 'odd.csv', 'phone', 'run_9', 'run_10', 'run_100.bag']
    assert [path.name for path in recordings_in(tmp_path)] == several
    with refused(f'{tmp_path}: holds 6 recordings, such as gyro.csv; name one'):
        open_recording(tmp_path)
    (tmp_path / 'night.mcap').touch()
    assert {*recordings_in(tmp_path)} == {tmp_path, *(tmp_path / name for name in several)}
    for alone in (tmp_path / 'run_10', tmp_path / 'notes', tmp_path / 'none',
                  tmp_path / 'run_100.bag', Path('a\0b')):
        assert recordings_in(alone) == [alone]


@pytest.mark.parametrize(('names', 'found'), [
    (['imu'], ['imu']), (['run_10', 'run_9'], ['run_9', 'run_10']),
    (map(str, range(70)), map(str, range(70)))], ids=['one', 'two', 'more than are looked into'])
def test_tables_with_both_sensors_are_recordings(tmp_path, names, found):
    (tmp_path / '0gps.csv').write_text('time,latitude\n1,2\n')
    for name in names:
        (tmp_path / f'{name}.csv').write_text(BOTH)
    assert recordings_in(tmp_path) == [tmp_path / f'{name}.csv' for name in found]


def test_the_only_table_with_both_sensors_is_the_recording_of_its_folder(tmp_path):
    (tmp_path / 'data.csv').write_text(BOTH)
    with open_recording(tmp_path) as recording:
        assert recording.path == tmp_path / 'data.csv'
    (tmp_path / 'other.csv').write_text(BOTH)
    with refused(f'{tmp_path}: holds 2 recordings, such as data.csv; name one'):
        open_recording(tmp_path)
    # A folder with a result is that result, which check reads.
    (tmp_path / 'result.json').touch()
    assert recordings_in(tmp_path) == [tmp_path]


@pytest.mark.parametrize(('names', 'together'), [
    (['night_0.mcap', 'night_1.mcap'], True), (['night_0.db3', 'night_1.db3'], True),
    (['a_0.mcap', 'night_1.mcap'], False), (['unit_1.mcap', 'unit_2.mcap'], False),
    (['unit_0.db3', 'unit_1.db3'], False), (['night_0.mcap', 'other_0.db3.zstd'], False)])
def test_bag_files_without_metadata_are_one_recording_if_they_follow(tmp_path, names, together):
    for number, name in enumerate(names):
        (write_db3 if name.endswith('.db3') else write_mcap)(
            tmp_path / name, block(200, first=200 * number if name.startswith('night') else 0))
    assert recordings_in(tmp_path) == (
        [tmp_path] if together else [tmp_path / name for name in names])
    if not together:
        with refused(f'{tmp_path}: holds 2 recordings, such as {names[0]}; name one'):
            open_recording(tmp_path)


def test_whether_compressed_files_follow_is_seen_without_unpacking_them(tmp_path, monkeypatch):
    for name in 'night_0.db3.zstd', 'night_1.db3.zstd':
        write_packed_db3(tmp_path / name)
    monkeypatch.setattr('imu_allan.recordings.formats.decompress.open_compressed', None)
    assert recordings_in(tmp_path) == [tmp_path]
    (tmp_path / 'night_0.db3.zstd').rename(tmp_path / 'night_2.db3.zstd')
    assert len(recordings_in(tmp_path)) == 2


def write_packed_db3(path):
    """Write three topics in turn, of which the first has messages that are none."""
    plain = path.with_suffix('.plain')
    with closing(bags.database(plain, [(f'/imu_{n}', bags.IMU) for n in range(3)])) as opened:
        for row, (stamp, data) in enumerate(bags.serialized(NOISE)):
            bags.insert(opened, [(stamp, data if row % 33 else data[:50])], row % 3 + 1)
        opened.commit()
    path.write_bytes(zstandard.compress(plain.read_bytes()))
    return path


def test_each_of_several_topics_is_read_as_if_by_itself(tmp_path):
    path, rows = write_packed_db3(tmp_path / 'a'), np.arange(600)
    assert refusal(path) == ('3 Imu topics; choose one with --topic, or analyze each with '
                             '--all-topics: /imu_0, /imu_1, /imu_2')
    with open_recording(path) as recording:
        for topic, malformed in ((0, [19]), (1, []), (2, [])):
            reader = recording.for_another_topic()
            assert_same(NOISE.part(rows[(rows % 3 == topic) & (rows % 33 > 0)]),
                        bags.joined(read_blocks(reader, f'/imu_{topic}')))
            assert [remark.values['count'] for remark in reader.remarks] == malformed


def test_of_a_compressed_file_of_several_topics_no_unpacked_copy_is_left(
        tmp_path, monkeypatch, output_of):
    unpacked = tmp_path / 'unpacked'
    unpacked.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(unpacked))
    path = write_packed_db3(tmp_path / 'h.db3.zstd')
    shown = output_of('analyze', path, '--all-topics', '--no-progress')
    assert all(f'/imu_{number}' in shown for number in range(3))
    assert list(unpacked.iterdir()) == []
