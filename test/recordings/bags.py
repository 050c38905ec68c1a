# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as other programs write them, and what is read from a recording."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import re
import sqlite3
import struct
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows, Serialization
from imu_allan.errors import ImuAllanError, printable
from imu_allan.finding import Finding, finding
from imu_allan.recordings import choose_topic, open_recording, read_blocks, Recording
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
import numpy as np
import pytest
from rosbags.rosbag1 import Reader as Ros1Reader, Writer as Ros1Writer
from rosbags.typesys import get_typestore, Stores

START_NS = 1_700_000_000_000_000_000
IMU = 'sensor_msgs/msg/Imu'
COMPRESSIONS = {'none': CompressionType.NONE, 'lz4': CompressionType.LZ4,
                'zstd': CompressionType.ZSTD}

ROS1_STORE = get_typestore(Stores.ROS1_NOETIC)
ROS1_COMPRESSIONS = {'none': None, 'lz4': Ros1Writer.CompressionFormat.LZ4,
                     'bz2': Ros1Writer.CompressionFormat.BZ2}
NO_TIME = ('no time_s column; give the sample rate with --rate, or say which column is the time: '
           "--columns 'time=NAME ms'")


def block(count: int, frame_id: str = 'imu_link', first: int = 0) -> ImuBlock:
    """Return messages number `first` to ``first + count`` of an endless 1 kHz recording."""
    index = np.arange(first, first + count, dtype=np.int64)
    header = START_NS + index * 1_000_000
    samples = np.sin(index[:, np.newaxis] * np.arange(1., 7.))
    return ImuBlock(header, header + 250_000 + index % 977, samples,
                    np.zeros((count, 2), np.bool_), frame_id)


def joined(blocks: Iterable[ImuBlock]) -> ImuBlock:
    """Return the messages of `blocks` as one, under the first frame_id."""
    held = list(blocks)
    return ImuBlock(*(np.concatenate([getattr(item, name) for item in held])
                      for name in ('header_ns', 'receive_ns', 'samples', 'absent')),
                    held[0].frame_id)


def read(path: Path, topic: str | None = None, **options: float) -> tuple[ImuBlock, list[Finding]]:
    with open_recording(path, **options) as recording:
        messages = joined(read_blocks(recording, choose_topic(recording, topic)))
        return messages, recording.remarks


def refusal(path: Path, content: str | bytes | None = None, **options: Any) -> str:
    """Return the error that reading a file gives, with this content if it has none yet."""
    if content is not None:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ImuAllanError) as error:
        read(path, **options)
    file, _, reason = str(error.value).partition(': ')
    assert file == printable(path)
    return reason


def said(path: Path, code: str, **values: object) -> Finding:
    return finding(code, recording=str(path), **values)


def files_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def figures(reason: str) -> list[int]:
    return [int(number) for number in re.findall(r'\d+', reason)]


def raise_malformed(_count: int, error: Exception) -> None:
    """Take a malformed message for an error of the test."""
    raise error


def assert_same(first: ImuBlock, second: ImuBlock) -> None:
    assert first.frame_id == second.frame_id
    for field in ('header_ns', 'receive_ns', 'samples', 'absent'):
        one, other = getattr(first, field), getattr(second, field)
        assert (len(one), one.dtype) == (len(other), other.dtype), field
        assert one.tobytes() == other.tobytes(), field


@contextmanager
def mcap_written(path: Path, profile: str = 'ros2', **options: Any,
                 ) -> Iterator[Callable[..., None]]:
    """Give what writes a message of a topic, or a topic alone, into an MCAP file."""
    with path.open('wb') as file:
        writer = Writer(file, **options)
        writer.start(profile)
        channels: dict[tuple[str, int], int] = {}

        def write(topic: str, stamp: int | None = None, data: bytes = b'none', kind: str = IMU,
                  definition: str = '', encodings: tuple[str, str] = ('cdr', 'ros2msg'),
                  number: int = 0) -> None:
            if (topic, number) not in channels:
                schema = kind and writer.register_schema(kind, encodings[1], definition.encode())
                channels[topic, number] = writer.register_channel(topic, encodings[0], schema or 0)
            if stamp is not None:
                writer.add_message(channels[topic, number], stamp, bytes(data), stamp)

        yield write
        writer.finish()


def _as_ros1(row: bytes) -> bytes:
    """Pack the fields, without a null byte after the text, and begin with a number."""
    length = int.from_bytes(row[12:16], 'little') - 1
    return bytes(4) + row[4:12] + struct.pack('<I', length) + row[16:16 + length] + row[-8 * 37:]


def serialized(messages: ImuBlock, serialization: Serialization = 'cdr',
               ) -> Iterator[tuple[int, bytes]]:
    """Give the receive stamp and the bytes of each message."""
    rows: Iterable[bytes] = map(bytes, encode_imu_rows(messages))
    if serialization == 'ros1':
        rows = map(_as_ros1, rows)
    return zip(messages.receive_ns.tolist(), rows, strict=True)


def write_mcap(
    path: Path, messages: ImuBlock, *, compression: str = 'zstd', chunk_size: int = 50_000,
    others: Callable[[int], int] = lambda _: 0, **options: object,
) -> Path:
    """Write topic /imu, and `others` messages of /other, of varying size, before each."""
    with mcap_written(path, compression=COMPRESSIONS[compression], chunk_size=chunk_size,
                      **options) as message:
        message('/imu', definition='float64 x')
        message('/other', kind='a_msgs/msg/B', definition='string s')
        for number, (stamp, row) in enumerate(serialized(messages)):
            for _ in range(others(number)):
                message('/other', stamp, b'\0\1\0\0' + bytes(number % 7 + 300))
            message('/imu', stamp, row)
    return path


def database(path: Path, topics: Iterable[tuple[str, str]]) -> sqlite3.Connection:
    """Begin a database, with names and types of topics, in rosbag2's schema before Foxy."""
    opened = sqlite3.connect(path)
    opened.executescript(
        'CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, '
        'serialization_format TEXT NOT NULL);'
        'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, '
        'timestamp INTEGER NOT NULL, data BLOB NOT NULL);'
        'CREATE INDEX timestamp_idx ON messages (timestamp ASC);')
    opened.executemany(
        "INSERT INTO topics(name, type, serialization_format) VALUES (?, ?, 'cdr')", topics)
    return opened


def write_db3(path: Path, messages: ImuBlock, topics: Iterable[tuple[str, str]] = ()) -> Path:
    """Write topic /imu, and enter others."""
    with closing(database(path, [('/imu', IMU), *topics])) as opened:
        insert(opened, serialized(messages))
        opened.commit()
    return path


def insert(opened: sqlite3.Connection, messages: Iterable[tuple[int, bytes]], topic: int = 1,
           ) -> None:
    """Add stamps and messages of a topic to a database of rosbag2."""
    opened.executemany(f'INSERT INTO messages(topic_id, timestamp, data) VALUES ({topic}, ?, ?)',
                       messages)


def write_bag(path: Path, messages: ImuBlock, compression: str = 'none',
              others: Callable[[int], int] = lambda _: 0) -> Path:
    """Write topic /imu, and `others` messages of /chatter before each, in chunks of 50 kB."""
    path.unlink(missing_ok=True)
    writer = Ros1Writer(path)
    writer.chunk_threshold = 50_000
    if ROS1_COMPRESSIONS[compression] is not None:
        writer.set_compression(ROS1_COMPRESSIONS[compression])
    with writer:
        imu = writer.add_connection('/imu', 'sensor_msgs/msg/Imu', typestore=ROS1_STORE)
        chatter = writer.add_connection('/chatter', 'std_msgs/msg/String', typestore=ROS1_STORE)
        for number, (stamp, row) in enumerate(serialized(messages, 'ros1')):
            for _ in range(others(number)):
                writer.write(chatter, stamp, b'\5\0\0\0hello')
            writer.write(imu, stamp, row)
    return path


def chunk_starts(path: Path) -> list[int]:
    """Return where the chunks of an MCAP file or a bag begin, by its index."""
    if path.read_bytes().startswith(b'#ROSBAG'):
        with Ros1Reader(path) as reader:
            return [info.pos for info in reader.chunk_infos]
    with path.open('rb') as file:
        return [index.chunk_start_offset
                for index in make_reader(file).get_summary().chunk_indexes]


def ros1_record(data: bytes = b'', **fields: bytes) -> bytes:
    header = b''.join(struct.pack('<I', len(name) + 1 + len(value)) + name.encode() + b'=' + value
                      for name, value in fields.items())
    return struct.pack('<I', len(header)) + header + struct.pack('<I', len(data)) + data


def write_metadata(folder: Path, files: list[str], topics: Iterable[tuple[str, str, int]],
                   **more: object) -> Path:
    lines = ['rosbag2_bagfile_information:', '  version: 5', '  storage_identifier: any',
             '  relative_file_paths:', *(f'    - {name}' for name in files),
             '  topics_with_message_count:']
    for name, kind, count in topics:
        lines += ['    - topic_metadata:', f'        name: {name}', f'        type: {kind}',
                  '        serialization_format: cdr', f'      message_count: {count}']
    lines += [f'  {key}: {value}' for key, value in more.items()]
    path = folder / 'metadata.yaml'
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return path


class FailingRecording(Recording):
    """A recording whose reading fails after one block."""

    def __init__(self, messages: ImuBlock, error: Exception) -> None:
        super().__init__(Path('failing'))
        self._messages = messages
        self._error = error

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Yield the block, whatever the topic, then raise."""
        del topic
        yield self._messages, 1
        raise self._error


def no_axes(header: str) -> str:
    """Return what is reported of a header line without an axis."""
    return (
        'the header line names none of the axes gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z '
        f'({header[:80]}). A CSV recording begins with a line such as '
        'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z, with units as in gyro_x [deg/s]. '
        '--columns gyro_x=NAME,accel_z=NAME,time=NAME says what others are, by name or number '
        'from 1')
