# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Many topics of one recording: each as if it were read by itself, and the file opened once."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from random import Random
import sqlite3
import sys
import tempfile

from bags import block, COMPRESSIONS, IMU, joined, ROS1_STORE, START_NS
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.recordings import open_recording, read_blocks, RecordingOptions
from imu_allan.recordings.formats import compressed_file, effort, mcap_file
from imu_allan.recordings.formats.mcap_file import McapRecording
from imu_allan.recordings.many_topics import HELD_BYTES, ManyTopics
from imu_allan.recordings.recording import Recording
from mcap.writer import Writer
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
import zstandard

Message = tuple[str, int, bytes]
"""Topic, stamp, and what is in it."""

_opened: list[str] = []
_counting = False


def _count(event: str, args: tuple[object, ...]) -> None:
    if _counting and event in ('open', 'sqlite3.connect'):
        _opened.append(str(args[0]))


sys.addaudithook(_count)


@contextmanager
def opened(name: str) -> Iterator[list[str]]:
    """List how often a file is opened meanwhile, whoever does it in this process."""
    global _counting
    found: list[str] = []
    _opened.clear()
    _counting = True
    try:
        yield found
    finally:
        _counting = False
        found += [path for path in _opened if name in path]


def messages(topics: int, each: int) -> list[Message]:
    """Interleave topics at random; some change their frame_id, some messages are none."""
    choice = Random(topics)
    order = [number for number in range(topics) for _ in range(each)]
    choice.shuffle(order)
    found = []
    for place, number in enumerate(order):
        stamp = START_NS + place * 1_000_000
        frame = 'other_link' if number % 5 == 0 and place % 3 == 0 else 'imu_link'
        data = encode_imu(stamp, block(1, first=place).samples[0], frame)
        if number % 7 == 0 and place % 11 == 0:
            data = data[:50]
        found.append((f'/imu_{number}', stamp, data))
    return found


def write_mcap(path: Path, recorded: Sequence[Message], **options: object) -> Path:
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=20_000, compression=COMPRESSIONS['zstd'], **options)
        writer.start('ros2')
        schema = writer.register_schema(IMU, 'ros2msg', b'float64 x')
        # Two publishers of a topic have a channel each.
        numbers: dict[tuple[str, bool], int] = {}
        for place, (topic, stamp, data) in enumerate(recorded):
            second = place % 13 == 0
            if (topic, second) not in numbers:
                numbers[topic, second] = writer.register_channel(
                    topic, 'cdr', schema, {'of': str(second)})
            writer.add_message(numbers[topic, second], stamp, data, stamp)
        writer.finish()
    return path


def write_mcap_without_index(path: Path, recorded: Sequence[Message]) -> Path:
    from mcap.writer import IndexType

    return write_mcap(path, recorded, index_types=IndexType.NONE, use_statistics=False,
                      use_summary_offsets=False)


def write_damaged_mcap(path: Path, recorded: Sequence[Message]) -> Path:
    data = bytearray(write_mcap(path, recorded).read_bytes())
    for place in (len(data) // 3, len(data) // 2):
        data[place] ^= 255
    path.write_bytes(data)
    return path


def write_db3(path: Path, recorded: Sequence[Message]) -> Path:
    topics = list(dict.fromkeys(topic for topic, *_ in recorded))
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
            'serialization_format TEXT);'
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
            'data BLOB);')
        database.executemany("INSERT INTO topics VALUES (?, ?, ?, 'cdr')", [
            (number, topic, IMU) for number, topic in enumerate(topics)])
        database.executemany('INSERT INTO messages VALUES (NULL, ?, ?, ?)', [
            (topics.index(topic), stamp, data) for topic, stamp, data in recorded])
        database.commit()
    return path


def write_bag(path: Path, recorded: Sequence[Message]) -> Path:
    writer = Ros1Writer(path)
    writer.chunk_threshold = 20_000
    with writer:
        connections = {topic: writer.add_connection(topic, IMU, typestore=ROS1_STORE)
                       for topic in dict.fromkeys(topic for topic, *_ in recorded)}
        for topic, stamp, data in recorded:
            # A sequence number before the stamp, and no padding behind the frame_id.
            start = data.find(b'_link\0')
            whole = data[4:start + 6 - 1] if start > 0 else data[4:]
            rest = data[-296:] if start > 0 else b''
            length = len(whole) - 12
            writer.write(connections[topic], stamp, b'\0\0\0\0' + whole[:8]
                         + length.to_bytes(4, 'little') + whole[12:] + rest)
    return path


def write_split(path: Path, recorded: Sequence[Message]) -> Path:
    folder = path.with_suffix('')
    folder.mkdir()
    for number in range(3):
        write_mcap(folder / f'a_{number}.mcap', recorded[number::3])
    data = (folder / 'a_1.mcap').read_bytes()
    (folder / 'a_1.mcap').write_bytes(data[:len(data) // 2])
    return folder


def write_packed_mcap(path: Path, recorded: Sequence[Message]) -> Path:
    path.write_bytes(zstandard.compress(
        write_mcap(path.with_suffix('.plain'), recorded).read_bytes()))
    return path


def write_packed_db3(path: Path, recorded: Sequence[Message]) -> Path:
    path.write_bytes(zstandard.compress(
        write_db3(path.with_suffix('.plain'), recorded).read_bytes()))
    return path


WRITERS = {'a.mcap': write_mcap, 'b.mcap': write_mcap_without_index, 'c.mcap': write_damaged_mcap,
           'd.db3': write_db3, 'e.bag': write_bag, 'f.split': write_split,
           'g.mcap.zstd': write_packed_mcap, 'h.db3.zstd': write_packed_db3}


def read(opening: Callable[[], Recording], topic: str
         ) -> tuple[ImuBlock | str, list[tuple[str, int]], list[Finding]]:
    """Return all messages, or the complaint, where the frame_id changes, and the remarks."""
    with opening() as recording:
        try:
            blocks = list(read_blocks(recording, topic))
        except ImuAllanError as error:
            return str(error), [], recording.remarks
        frames: list[tuple[str, int]] = []
        for each in blocks:
            if frames and frames[-1][0] == each.frame_id:
                frames[-1] = each.frame_id, frames[-1][1] + len(each)
            else:
                frames.append((each.frame_id, len(each)))
        return joined(blocks), frames, recording.remarks


def assert_read_alike(path: Path, topics: Sequence[str], many: ManyTopics) -> None:
    readable = 0
    for topic in topics:
        one, frames, remarks = read(partial(many.opening, topic), topic)
        other, other_frames, other_remarks = read(partial(open_recording, path), topic)
        assert frames == other_frames
        assert remarks == other_remarks
        if isinstance(one, str) or isinstance(other, str):
            assert one == other
        else:
            for field in ('header_ns', 'receive_ns', 'samples', 'absent'):
                assert getattr(one, field).tobytes() == getattr(other, field).tobytes()
            readable += len(one) > 5
    assert readable == len(topics)


@pytest.mark.parametrize('held_bytes', [HELD_BYTES, 100_000])
@pytest.mark.parametrize('name', WRITERS)
def test_each_of_many_topics_is_read_as_if_by_itself(tmp_path: Path, name: str,
                                                     held_bytes: int) -> None:
    path = WRITERS[name](tmp_path / name, messages(25, 40))
    topics = [f'/imu_{number}' for number in range(25)]
    with closing(ManyTopics(partial(open_recording, path), topics, held_bytes)) as many:
        assert_read_alike(path, topics, many)


@pytest.mark.parametrize('name', ['a.mcap', 'd.db3', 'e.bag', 'f.split'])
def test_hundreds_of_topics_do_not_open_the_recording_more_often_than_two(
        tmp_path: Path, name: str) -> None:
    times = []
    for count in (2, 400):
        path = WRITERS[name](tmp_path / f'{count}{name}', messages(count, 5))
        topics = [f'/imu_{number}' for number in range(count)]
        with opened(path.name) as found, closing(
                ManyTopics(partial(open_recording, path), topics)) as many:
            for topic in topics:
                read(partial(many.opening, topic), topic)
        times.append(len(found))
    assert times[1] == times[0] <= (25 if name == 'f.split' else 5)


def test_readings_grow_with_the_messages_over_the_memory_not_with_the_topics(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    readings = 0
    once = McapRecording.read_each

    def counted(self: McapRecording, readings_of: object) -> None:
        nonlocal readings
        readings += 1
        once(self, readings_of)

    monkeypatch.setattr(McapRecording, 'read_each', counted)
    path = write_mcap(tmp_path / 'a.mcap', [
        *messages(100, 20), *(('/large', stamp, data) for _, stamp, data in messages(1, 1000))])
    topics = ['/large', *(f'/imu_{number}' for number in range(100))]
    held_bytes = 100_000
    with closing(ManyTopics(partial(open_recording, path), topics, held_bytes)) as many:
        for topic in topics:
            read(partial(many.opening, topic), topic)
            assert many.holds_bytes <= held_bytes
    # Of 20 messages, 66 bytes each, in one or two blocks of 1 kB beside them.
    assert readings <= 3 * 100 * (20 * 66 + 2048) / held_bytes + 2


def test_a_decoder_that_fails_stops_no_other_topic(tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_mcap(tmp_path / 'a.mcap', messages(3, 20))
    topics = ['/imu_0', '/imu_1', '/imu_2']

    def reopen() -> Recording:
        recording = open_recording(path)
        broken = recording.imu('/imu_1').messages

        class Broken(type(broken)):
            def decoder(self) -> object:
                def decode(*_: object) -> list[ImuBlock]:
                    raise ImuAllanError('it cannot be read')
                return decode

        monkeypatch.setattr(recording, 'topics', [
            type(imu)(imu.name, imu.count, Broken('sensor_msgs/msg/Imu'))
            if imu.name == '/imu_1' else imu for imu in recording.topics])
        return recording

    with closing(ManyTopics(reopen, topics)) as many:
        found = [read(partial(many.opening, topic), topic)[0] for topic in topics]
    assert found[1] == 'it cannot be read'
    assert not isinstance(found[0], str)
    assert not isinstance(found[2], str)


def test_messages_in_memory_serve_the_options_of_the_reading(tmp_path: Path) -> None:
    path = write_db3(tmp_path / 'a.db3', messages(3, 20))
    options = RecordingOptions(accel_unit='g')
    topics = ['/imu_0', '/imu_1']
    with closing(ManyTopics(partial(open_recording, path, options=options), topics)) as many:
        one, *_ = read(partial(many.opening, '/imu_1'), '/imu_1')
    other, *_ = read(partial(open_recording, path, options=options), '/imu_1')
    assert one.samples.tobytes() == other.samples.tobytes()


@pytest.mark.parametrize('small', [0, 1, 20])
@pytest.mark.parametrize('large', [2, 3])
def test_large_topics_cost_no_more_readings_than_one_by_one(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, large: int, small: int) -> None:
    chunks = 0
    decoded = mcap_file.decoded_blocks

    def counted(*args: object) -> object:
        nonlocal chunks
        chunks += 1
        return decoded(*args)

    monkeypatch.setattr(mcap_file, 'decoded_blocks', counted)
    path = write_mcap(tmp_path / 'a.mcap', sorted(
        [*messages(large, 1600),
         *((f'/small{topic}', stamp, data) for topic, stamp, data in messages(small, 20))],
        key=lambda message: message[1]))
    topics = [*(f'/imu_{number}' for number in range(large)),
              *(f'/small/imu_{number}' for number in range(small))]

    def read_all(openings: Sequence[Callable[[], Recording]]) -> tuple[int, int]:
        nonlocal chunks
        chunks = 0
        with opened(path.name) as found:
            for topic, opening in zip(topics, openings, strict=True):
                read(opening, topic)
        return chunks, len(found)

    one_by_one = read_all([partial(open_recording, path)] * len(topics))
    with closing(ManyTopics(partial(open_recording, path), topics, 100_000)) as many:
        together = read_all([partial(many.opening, topic) for topic in topics])
    assert together <= one_by_one
    assert small < 2 or together[0] < one_by_one[0]


@pytest.mark.parametrize('name', ['g.mcap.zstd', 'h.db3.zstd'])
def test_one_copy_at_a_time_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                        name: str) -> None:
    unpacked = tmp_path / 'unpacked'
    unpacked.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(unpacked))
    copies = []
    make = compressed_file.make_folder

    def made() -> Path:
        folder = make()
        copies.append(len(list(unpacked.iterdir())))
        return folder

    path = WRITERS[name](tmp_path / name, [
        *messages(4, 20), *(('/large', stamp, data) for _, stamp, data in messages(1, 2000))])
    topics = ['/imu_1', '/large', '/imu_2', '/imu_3']
    with closing(ManyTopics(partial(open_recording, path), topics, 100_000)) as many:
        monkeypatch.setattr(compressed_file, 'make_folder', made)
        for topic in topics:
            read(partial(many.opening, topic), topic)
    assert copies == [1, 1]
    assert list(unpacked.iterdir()) == []


def test_want_of_memory_for_all_is_none_for_each(tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_mcap(tmp_path / 'a.mcap', messages(3, 20))
    topics = ['/imu_0', '/imu_1', '/imu_2']
    once = McapRecording.read_each

    def exhausted(self: McapRecording, readings: object) -> None:
        once(self, readings)
        raise MemoryError

    monkeypatch.setattr(McapRecording, 'read_each', exhausted)
    with closing(ManyTopics(partial(open_recording, path), topics)) as many:
        assert_read_alike(path, topics, many)


def test_a_budget_that_does_not_do_for_all_does_for_each(tmp_path: Path,
                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = sorted(messages(3, 200), key=lambda message: message[0])
    path = write_mcap(tmp_path / 'a.mcap', recorded)
    # The bytes of a topic are some 70,000, in chunks of 20,000.
    monkeypatch.setattr(effort, 'MOST_RATIO', 0)
    monkeypatch.setattr(effort, 'PLAIN_BYTES', 130_000)
    topics = ['/imu_0', '/imu_1', '/imu_2']
    with open_recording(path) as alone:
        assert sum(map(len, read_blocks(alone, '/imu_2'))) == 200
        assert alone.remarks == []
    with closing(ManyTopics(partial(open_recording, path), topics)) as many:
        assert_read_alike(path, topics, many)
