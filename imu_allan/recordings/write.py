# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing Imu samples as a rosbag2 directory, block by block in constant memory."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from functools import cache
from pathlib import Path
import shutil
import sqlite3
from struct import Struct
from typing import Any, BinaryIO, Literal
import zlib

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.errors import ImuAllanError, printable
import lz4.frame  # type: ignore[import-untyped]
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)
import numpy as np
from numpy.typing import NDArray
import yaml
import zstandard

Storage = Literal['mcap', 'sqlite3']
Compression = Literal['', 'lz4', 'zstd']

_IMU_TYPE = 'sensor_msgs/msg/Imu'
_MAGIC = b'\x89MCAP0\r\n'
_CHUNK_BYTES = 786_432
"""The chunk size of rosbag2's own MCAP storage."""


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

    It appears under its name only when it is complete: an exception or Ctrl-C leaves nothing.

    Parameters
    ----------
    path : path-like
        The directory to create.
    blocks : iterable of ImuBlock
        The messages.
    topic : str
        The topic they are recorded from.
    storage : {'mcap', 'sqlite3'}
        Container.
    compression : {'', 'lz4', 'zstd'}
        Compression of MCAP chunks.

    Returns
    -------
    Path
        The directory.

    Raises
    ------
    ImuAllanError
        If `path` exists already, or cannot be created or written, as on a full disk.

    """
    path = Path(path)
    if path.exists() or path.is_symlink():
        raise ImuAllanError(f'{printable(path)}: exists already; choose another name or remove it')
    if storage not in _WRITERS:
        raise ImuAllanError(
            f'storage {printable(storage)}: not one of {", ".join(_WRITERS)}')
    unfinished = path.with_name(f'.{path.name}.unfinished')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
    except OSError as error:
        raise ImuAllanError(
            f'{printable(path)}: cannot be created ({error.strerror}: '
            f'{printable(error.filename)})') from error
    try:
        file = unfinished / f'{path.name}_0.{_SUFFIXES[storage]}'
        extent = _WRITERS[storage](file, blocks, topic, compression)
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
    """Count and time span of what was written."""

    def __init__(self) -> None:
        self.count = 0
        self.start = 0
        self.end = 0

    def add(self, stamps: NDArray[np.int64]) -> None:
        if len(stamps) == 0:
            return
        low, high = int(stamps.min()), int(stamps.max())
        self.start = low if self.count == 0 else min(self.start, low)
        self.end = high if self.count == 0 else max(self.end, high)
        self.count += len(stamps)


def _metadata(file: str, topic: str, storage: Storage, extent: _Extent) -> str:
    def span() -> dict[str, Any]:
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
                'type': _IMU_TYPE,
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
    """Message definition and RIHS01 hash of sensor_msgs/msg/Imu."""
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    definition, _ = store.generate_msgdef(_IMU_TYPE, ros_version=2)
    return definition, store.hash_rihs01(_IMU_TYPE)


def _parts(blocks: Iterable[ImuBlock], size: int) -> Iterator[ImuBlock]:
    """Cut blocks to at most `size` messages."""
    for block in blocks:
        for start in range(0, len(block), size):
            part = slice(start, start + size)
            yield ImuBlock(block.header_ns[part], block.receive_ns[part], block.samples[part],
                           block.absent[part], block.frame_id)


def _write_sqlite(
    file: Path, blocks: Iterable[ImuBlock], topic: str, _compression: Compression,
) -> _Extent:
    extent = _Extent()
    definition, digest = _imu_type()
    with closing(sqlite3.connect(file)) as database:
        # Nothing needs to survive a crash: the directory is unfinished until it is renamed.
        database.execute('PRAGMA journal_mode = OFF')
        database.execute('PRAGMA synchronous = OFF')
        database.executescript(_SQLITE_SCHEMA)
        database.execute(
            'INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition, '
            'type_description_hash) VALUES (?, ?, ?, ?)',
            (_IMU_TYPE, 'ros2msg', definition, digest))
        database.execute(
            "INSERT INTO topics VALUES (1, ?, ?, 'cdr', '', ?)", (topic, _IMU_TYPE, digest))
        for block in _parts(blocks, 1 << 14):
            extent.add(block.receive_ns)
            database.executemany(
                'INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)',
                zip(block.receive_ns.tolist(), map(bytes, encode_imu_rows(block)), strict=True))
        database.execute(
            'INSERT INTO metadata(metadata_version, metadata) VALUES (9, ?)',
            (_metadata(file.name, topic, 'sqlite3', extent),))
        database.commit()
    return extent


def _write_mcap(
    file: Path, blocks: Iterable[ImuBlock], topic: str, compression: Compression,
) -> _Extent:
    extent = _Extent()
    schema = Schema(id=1, name=_IMU_TYPE, encoding='ros2msg', data=_imu_type()[0].encode())
    channel = Channel(
        id=1, topic=topic, message_encoding='cdr', schema_id=1,
        metadata={'offered_qos_profiles': '', 'topic_type_hash': _imu_type()[1]})
    indexes: list[ChunkIndex] = []
    with file.open('wb') as out:
        out.write(_MAGIC + _record(Header('ros2', 'imu_allan')))
        head = _record(schema) + _record(channel)
        for rows, stamps in _chunks(blocks):
            sequence = np.arange(extent.count, extent.count + len(rows), dtype=np.uint32)
            extent.add(stamps)
            indexes.append(_write_chunk(out, head, rows, stamps, sequence, compression))
            head = b''
        if head:
            out.write(head)
        out.write(_record(DataEnd(0)))
        _write_summary(out, schema, channel, indexes, extent)
        out.write(_MAGIC)
    return extent


def _chunks(
    blocks: Iterable[ImuBlock],
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.int64]]]:
    """Encode messages of equal size a chunk at a time, with their receive stamps."""
    rows: list[NDArray[np.uint8]] = []
    stamps: list[NDArray[np.int64]] = []
    held = 0
    for block in _parts(blocks, _CHUNK_BYTES // 512):
        encoded = encode_imu_rows(block)
        if rows and (rows[0].shape[1] != encoded.shape[1] or held >= _CHUNK_BYTES):
            yield np.concatenate(rows), np.concatenate(stamps)
            rows, stamps, held = [], [], 0
        rows.append(encoded)
        stamps.append(block.receive_ns)
        held += encoded.size
    if held:
        yield np.concatenate(rows), np.concatenate(stamps)


def _write_chunk(
    out: BinaryIO, head: bytes, rows: NDArray[np.uint8], stamps: NDArray[np.int64],
    sequence: NDArray[np.uint32], compression: Compression,
) -> ChunkIndex:
    messages = np.zeros(len(rows), np.dtype(
        [('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('sequence', '<u4'),
         ('log_time', '<u8'), ('publish_time', '<u8'), ('data', f'V{rows.shape[1]}')]))
    messages['opcode'] = Opcode.MESSAGE
    messages['length'] = 22 + rows.shape[1]
    messages['channel'] = 1
    messages['sequence'] = sequence
    messages['log_time'] = messages['publish_time'] = stamps
    messages['data'] = rows.view(f'V{rows.shape[1]}')[:, 0]
    plain = head + messages.tobytes()
    data = _COMPRESSORS[compression](plain)
    chunk = Chunk(
        compression=compression, data=data, message_start_time=int(stamps.min()),
        message_end_time=int(stamps.max()), uncompressed_crc=zlib.crc32(plain),
        uncompressed_size=len(plain))
    start = out.tell()
    out.write(_record(chunk))
    index_at = out.tell()
    entries = np.empty((len(rows), 2), '<u8')
    entries[:, 0] = stamps
    entries[:, 1] = len(head) + messages.itemsize * np.arange(len(rows))
    out.write(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + entries.nbytes, 1, entries.nbytes))
    out.write(entries.tobytes())
    return ChunkIndex(
        chunk_length=index_at - start, chunk_start_offset=start, compression=compression,
        compressed_size=len(data), message_end_time=chunk.message_end_time,
        message_index_length=out.tell() - index_at, message_index_offsets={1: index_at},
        message_start_time=chunk.message_start_time, uncompressed_size=len(plain))


def _write_summary(
    out: BinaryIO, schema: Schema, channel: Channel, indexes: list[ChunkIndex], extent: _Extent,
) -> None:
    start = at = out.tell()
    summary = offsets = b''
    statistics = Statistics(
        attachment_count=0, channel_count=1, channel_message_counts={1: extent.count},
        chunk_count=len(indexes), message_count=extent.count, message_end_time=extent.end,
        message_start_time=extent.start, metadata_count=0, schema_count=1)
    groups: list[tuple[Opcode, list[Any]]] = [
        (Opcode.SCHEMA, [schema]), (Opcode.CHANNEL, [channel]),
        (Opcode.STATISTICS, [statistics]), (Opcode.CHUNK_INDEX, indexes)]
    for opcode, records in groups:
        group = b''.join(map(_record, records))
        if group:
            offsets += _record(SummaryOffset(
                group_opcode=opcode, group_start=at, group_length=len(group)))
        summary += group
        at += len(group)
    footer = _record(Footer(summary_start=start, summary_offset_start=at, summary_crc=0))
    crc = zlib.crc32(footer[:-4], zlib.crc32(summary + offsets))
    out.write(summary + offsets + footer[:-4] + crc.to_bytes(4, 'little'))


def _record(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


_INDEX_HEAD = Struct('<BQHI')
_COMPRESSORS = {
    '': bytes,
    'lz4': lz4.frame.compress,
    'zstd': lambda data: zstandard.ZstdCompressor(level=1).compress(data),
}
_WRITERS = {'mcap': _write_mcap, 'sqlite3': _write_sqlite}
_SUFFIXES = {'mcap': 'mcap', 'sqlite3': 'db3'}
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
