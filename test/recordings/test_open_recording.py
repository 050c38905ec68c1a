# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Opening by what a file is, and the choice of a topic."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing
from functools import partial
import os
from pathlib import Path
from random import Random
import subprocess
import sys
import tempfile

import bags
from bags import assert_same, block, read, refusal, write_db3, write_mcap
from imu_allan.block import ImuBlock
from imu_allan.errors import printable
from imu_allan.finding import Finding
from imu_allan.recordings import (
    choose_topic,
    ImuTopic,
    open_recording,
    read_blocks,
    Recording,
    recordings_in,
)
from imu_allan.recordings.formats import compressed_file
from imu_messages import encode_imu
import pytest
from whole_lines import refused
import zstandard


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


@pytest.mark.parametrize('name', ['ä日.mcap', 'line\nbreak \x1b[31m.mcap'])
def test_any_name_is_read_and_no_name_breaks_a_line(tmp_path, name):
    path = write_mcap(tmp_path / name, block(10))
    assert_same(block(10), read(path)[0])
    path.write_bytes(path.read_bytes()[:-60])
    assert printable(path).isprintable()
    assert refusal(path, topic='/n\none') == (
        'no topic /n\\none; its Imu topics are /imu (10 messages)')


class Listed(Recording):
    """A recording with given topics and nothing to read."""

    def __init__(self, topics: dict[str, int | None], others: dict[str, str]) -> None:
        super().__init__(Path('bag'))
        self.topics = [ImuTopic(name, count) for name, count in topics.items()]
        self.other_topics = others

    def decoded(self, topic):
        del topic
        return iter([])


@pytest.mark.parametrize(('topics', 'others', 'topic', 'reason'), [
    ({}, {}, None, 'it holds no topics at all: the recording is empty'),
    ({'/b': 3, '/a': None}, {}, None,
     '2 Imu topics; choose one with --topic: /a, /b (3 messages)'),
    ({'/a': 3}, {}, '/c', 'no topic /c; its Imu topics are /a (3 messages)'),
    ({'/a': 3}, {'/c': 'x/msg/Y'}, 'c',
     'topic /c is of type x/msg/Y, not sensor_msgs/msg/Imu'),
    ({'/a': 0}, {}, None, 'topic /a has no messages; record it while the IMU driver runs'),
])
def test_a_topic_that_is_not_clear_is_one_line(topics, others, topic, reason):
    with refused(f'bag: {reason}'):
        choose_topic(Listed(topics, others), topic)


def test_the_only_topic_need_not_be_named_and_is_reported_if_it_holds_nothing_readable():
    recording = Listed({'/imu': None}, {'/b': 'std_msgs/msg/String'})
    for name in (None, '/imu', 'imu'):
        assert choose_topic(recording, name) == '/imu'
    with refused('bag: topic /imu holds no readable message; --topic names another'):
        list(read_blocks(recording, '/imu'))


def test_an_imu_in_another_encoding_is_named_with_it(tmp_path):
    path = tmp_path / 'a.mcap'
    with bags.mcap_written(path) as message:
        message('/json', 1, b'{}', encodings=('json', 'jsonschema'))
    assert refusal(path) == ('no topic of type sensor_msgs/msg/Imu; it holds /json '
                             '(sensor_msgs/msg/Imu encoded as json)')


@pytest.mark.usefixtures('children_unmeasured')
def test_importing_recordings_loads_no_container_library():
    loaded = subprocess.run(
        [sys.executable, '-c', 'import sys, imu_allan.recordings; print(*sys.modules)'],
        check=True, capture_output=True, text=True).stdout.split()
    assert not {'mcap', 'sqlite3', 'rosbags', 'yaml', 'zstandard', 'pint', 'scipy'} & set(loaded)


def test_a_folder_of_several_recordings_is_listed_by_growing_numbers(tmp_path):
    for name in ('run_10', 'run_9', '.hidden', 'notes'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'readme.txt').touch()
    write_mcap(tmp_path / 'run_10' / 'a.mcap', block(10))
    (tmp_path / 'run_9' / 'metadata.yaml').touch()
    (tmp_path / 'run_100.bag').touch()
    assert [path.name for path in recordings_in(tmp_path)] == ['run_9', 'run_10', 'run_100.bag']
    for alone in (tmp_path / 'run_10', tmp_path / 'notes', tmp_path / 'none',
                  tmp_path / 'run_100.bag', Path('a\0b')):
        assert recordings_in(alone) == [alone]


@pytest.mark.parametrize(('names', 'together'), [
    (['night_0.mcap', 'night_1.mcap'], True), (['night_0.db3', 'night_1.db3'], True),
    (['a_0.mcap', 'night_1.mcap'], False), (['unit_1.mcap', 'unit_2.mcap'], False),
    (['unit_0.db3', 'unit_1.db3'], False), (['night_0.mcap', 'other_0.db3.zstd'], False)])
def test_bag_files_without_metadata_are_one_recording_if_their_numbers_follow_in_time(
        tmp_path, names, together):
    for number, name in enumerate(names):
        (write_db3 if name.endswith('.db3') else write_mcap)(
            tmp_path / name, block(200, first=200 * number if name.startswith('night') else 0))
    assert recordings_in(tmp_path) == (
        [tmp_path] if together else [tmp_path / name for name in names])
    if not together:
        with refused(f'{tmp_path}: each of 2 files, such as {names[0]}, is a recording; name '
                     'one'):
            open_recording(tmp_path)


Message = tuple[str, int, bytes]
"""Topic, stamp, and what is in it."""


def messages(topics: int, each: int) -> list[Message]:
    """Interleave topics at random; some change their frame_id, some messages are none."""
    choice = Random(topics)
    order = [number for number in range(topics) for _ in range(each)]
    choice.shuffle(order)
    found = []
    for place, number in enumerate(order):
        stamp = bags.START_NS + place * 1_000_000
        frame = 'other_link' if number % 5 == 0 and place % 3 == 0 else 'imu_link'
        data = encode_imu(stamp, block(1, first=place).samples[0], frame)
        if number % 7 == 0 and place % 11 == 0:
            data = data[:50]
        found.append((f'/imu_{number}', stamp, data))
    return found


def write_packed_db3(path: Path, recorded: Sequence[Message]) -> Path:
    plain = path.with_suffix('.plain')
    topics = list(dict.fromkeys(topic for topic, *_ in recorded))
    with closing(bags.database(plain, [(topic, bags.IMU) for topic in topics])) as opened:
        for topic, *message in recorded:
            bags.insert(opened, [message], topics.index(topic) + 1)
        opened.commit()
    path.write_bytes(zstandard.compress(plain.read_bytes()))
    return path


def read_whole(opening: Callable[[], AbstractContextManager[Recording]], topic: str
               ) -> tuple[ImuBlock, list[str], list[Finding]]:
    """Return all messages, the frame_id of each, and the remarks."""
    with opening() as recording:
        blocks = list(read_blocks(recording, topic))
        return (bags.joined(blocks), [part.frame_id for part in blocks for _ in range(len(part))],
                recording.remarks)


def test_each_of_many_topics_is_read_as_if_by_itself(tmp_path):
    path = write_packed_db3(tmp_path / 'a', messages(8, 40))
    with open_recording(path) as recording:
        for topic in [f'/imu_{number}' for number in range(8)]:
            one, *more = read_whole(recording.for_another_topic, topic)
            other, *expected = read_whole(partial(open_recording, path), topic)
            assert_same(one, other)
            assert more == expected
            assert len(one) > 5


def test_all_topics_of_a_compressed_file_have_one_copy_that_is_unpacked_once(
        tmp_path, monkeypatch, output_of):
    unpacked = tmp_path / 'unpacked'
    unpacked.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(unpacked))
    made: list[int] = []
    once = compressed_file.make_folder

    def counted() -> Path:
        made.append(len(list(unpacked.iterdir())))
        return once()

    monkeypatch.setattr(compressed_file, 'make_folder', counted)
    path = write_packed_db3(tmp_path / 'h.db3.zstd', [
        message for message in messages(3, 200) if message[0] != '/imu_0'])
    output_of('analyze', path, '--all-topics', '--no-progress', '--output', tmp_path / 'out')
    assert len(list((tmp_path / 'out').glob('*/result.json'))) == 2
    # One lists the topics, one serves them all.
    assert made == [0, 0]
    assert list(unpacked.iterdir()) == []
