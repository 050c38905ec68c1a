# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing of Imu samples as a rosbag2 directory, block by block in constant memory."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from functools import cache
from pathlib import Path
import shutil
import sqlite3
from typing import Any, Literal

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows, IMU_TYPE
from imu_allan.errors import ImuAllanError, printable
from mcap.writer import CompressionType, Writer
import yaml

Storage = Literal['mcap', 'sqlite3']
Compression = Literal['', 'lz4', 'zstd']


def write_recording(
    path: Path | str,
    blocks: Iterable[ImuBlock],
    *,
    topic: str = '/imu/data_raw',
    storage: Storage = 'mcap',
    compression: Compression = 'zstd',
) -> Path:
    """
    Write a rosbag2 directory.

    The directory appears under its name only when complete; an exception or Ctrl-C leaves nothing.

    Parameters
    ----------
    path : path-like
        The directory to create.
    blocks : iterable of ImuBlock
        Messages to write.
    topic : str
        Topic name of the messages.
    storage : {'mcap', 'sqlite3'}
        Storage format.
    compression : {'', 'lz4', 'zstd'}
        Compression of MCAP chunks.

    Returns
    -------
    Path
        The directory.

    Raises
    ------
    ImuAllanError
        If `path` exists already, or cannot be created or written, for example because the disk is
        full.

    """
    path = Path(path)
    if path.exists() or path.is_symlink():
        raise ImuAllanError(f'{printable(path)}: exists already; choose another name or remove it')
    writers = {'mcap': (_write_mcap, 'mcap'), 'sqlite3': (_write_sqlite, 'db3')}
    if storage not in writers:
        raise ImuAllanError(
            f'storage {printable(storage)}: not one of {", ".join(writers)}')
    unfinished = path.with_name(f'.{path.name}.unfinished')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
    except OSError as error:
        raise ImuAllanError(
            f'{printable(path)}: cannot be created ({error.strerror}: '
            f'{printable(error.filename)}); choose a folder that may be written to') from error
    try:
        write, suffix = writers[storage]
        file = unfinished / f'{path.name}_0.{suffix}'
        extent = write(file, blocks, topic, compression)
        (unfinished / 'metadata.yaml').write_text(
            _metadata(file.name, topic, storage, extent), encoding='utf-8')
        unfinished.rename(path)
    except BaseException as error:
        shutil.rmtree(unfinished, ignore_errors=True)
        if isinstance(error, (OSError, sqlite3.OperationalError)):
            raise ImuAllanError(
                f'{printable(path)}: cannot be written '
                f'({getattr(error, "strerror", None) or error}); '
                'choose a folder on a disk with more room') from error
        raise
    return path


class _Extent:
    """Message count and time span of what was written."""

    count = start = end = 0

    def add(self, stamps: Ints) -> None:
        low, high = int(stamps.min()), int(stamps.max())
        self.start = min(self.start, low) if self.count else low
        self.end = max(self.end, high) if self.count else high
        self.count += len(stamps)


def _metadata(file: str, topic: str, storage: Storage, extent: _Extent) -> str:
    def span() -> dict[str, Any]:
        # Create a new object for each place: YAML would write a shared one as an alias.
        return {
            'duration': {'nanoseconds': extent.end - extent.start},
            'starting_time': {'nanoseconds_since_epoch': extent.start},
            'message_count': extent.count,
        }

    return yaml.safe_dump({'rosbag2_bagfile_information': {
        'version': 9,
        'storage_identifier': storage,
        **span(),
        'topics_with_message_count': [{
            'topic_metadata': {
                'name': topic,
                'type': IMU_TYPE,
                'serialization_format': 'cdr',
                'offered_qos_profiles': [],
                'type_description_hash': _imu_type()[1],
            },
            'message_count': extent.count,
        }],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file],
        'files': [{'path': file, **span()}],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }}, sort_keys=False, allow_unicode=True)


@cache
def _imu_type() -> tuple[str, str]:
    """Return the message definition and RIHS01 hash of sensor_msgs/msg/Imu."""
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = store.generate_msgdef(IMU_TYPE, ros_version=2)
    return definition, store.hash_rihs01(IMU_TYPE)


def _messages(blocks: Iterable[ImuBlock], extent: _Extent) -> Iterator[tuple[int, bytes]]:
    """Yield receive stamps and serialized messages, encoding some thousand at a time."""
    for block in blocks:
        for start in range(0, len(block), 1 << 14):
            part = block.part(slice(start, start + (1 << 14)))
            extent.add(part.receive_ns)
            yield from zip(part.receive_ns.tolist(), map(bytes, encode_imu_rows(part)),
                           strict=True)


def _write_sqlite(
    file: Path, blocks: Iterable[ImuBlock], topic: str, _compression: Compression,
) -> _Extent:
    extent = _Extent()
    definition, digest = _imu_type()
    with closing(sqlite3.connect(file)) as database:
        # Durability is not needed: the directory counts as unfinished until it is renamed.
        database.execute('PRAGMA journal_mode = OFF')
        database.execute('PRAGMA synchronous = OFF')
        database.executescript(_SQLITE_SCHEMA)
        database.execute(
            'INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition, '
            'type_description_hash) VALUES (?, ?, ?, ?)',
            (IMU_TYPE, 'ros2msg', definition, digest))
        database.execute(
            "INSERT INTO topics VALUES (1, ?, ?, 'cdr', '', ?)", (topic, IMU_TYPE, digest))
        database.executemany('INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)',
                             _messages(blocks, extent))
        database.execute(
            'INSERT INTO metadata(metadata_version, metadata) VALUES (9, ?)',
            (_metadata(file.name, topic, 'sqlite3', extent),))
        database.commit()
    return extent


def _write_mcap(
    file: Path, blocks: Iterable[ImuBlock], topic: str, compression: Compression,
) -> _Extent:
    extent = _Extent()
    definition, digest = _imu_type()
    with file.open('wb') as out:
        kind = CompressionType[compression.upper() or 'NONE']
        # The chunk size of rosbag2's own MCAP storage.
        writer = Writer(out, chunk_size=786_432, compression=kind)
        writer.start('ros2', 'imu_allan')
        schema = writer.register_schema(IMU_TYPE, 'ros2msg', definition.encode())
        channel = writer.register_channel(
            topic, 'cdr', schema, {'offered_qos_profiles': '', 'topic_type_hash': digest})
        for number, (stamp, message) in enumerate(_messages(blocks, extent)):
            writer.add_message(channel, stamp, message, stamp, number)
        writer.finish()  # type: ignore[no-untyped-call]
    return extent


_SQLITE_SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(
  id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(
  id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
  serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
  type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(
  id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
  encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(
  id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
  data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""
