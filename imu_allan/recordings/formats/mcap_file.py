# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
MCAP files, read chunk by chunk, whether complete or damaged.

Records are parsed by the `mcap` library, except messages and message indexes: a chunk is
decompressed as a whole, and the messages of the topic are gathered from it as arrays. The file is
read from its start, so that a missing end makes no difference. The summary at its end is used to
list topics, to count messages, and to find the next chunk after a damaged place.

Records of an Imu topic nearly always have equal size and equal spacing in the buffer. Runs of
equal records are therefore detected, verified in one comparison, and returned as a view of the
buffer. Where topics alternate, the message index locates the records; it is trusted only if they
fill the buffer without a gap. Without an index, records are read one by one. Opcode, length and
channel of every record are always checked.

References
----------
MCAP format specification, https://mcap.dev/spec

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Set as AbstractSet
from contextlib import suppress
from io import BytesIO
from itertools import chain
from pathlib import Path
from struct import error as StructError, Struct, unpack_from
from typing import BinaryIO, ClassVar, TypeVar

from imu_allan.arrays import Ints, runs
from imu_allan.cdr import anywhere, collect, MessageBatch, rows_like_first
from imu_allan.errors import error_about
from imu_allan.recordings.formats.chunked_file import Channel, ChunkedRecording, Part, Reading
from imu_allan.recordings.formats.decompress import DamagedData, expanded, ReadingLimits, unpacked
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.options import RecordingOptions
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord, Schema, Statistics
import numpy as np
from numpy.typing import NDArray

try:
    # An order of magnitude faster, if installed.
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

Record = TypeVar('Record')
Describe = Callable[[int, bytes], object]
"""Called with opcode and body of each record that is no message."""
_LONGEST_NAME = 4096
"""DDS allows 255 characters; a much longer name is damage and is not kept in memory."""
_INDEX_ENTRY = np.dtype([('time', '<u8'), ('place', '<u8')])
"""An entry of the index after a chunk: receive stamp, and offset of a message."""
_RECORD_HEAD = 9
"""Bytes of opcode and length before each record."""

_HEAD = np.dtype([('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('number', '<u4'),
                  ('log_ns', '<i8'), ('publish_ns', '<i8')])
"""What precedes the data of a message (MCAP, op 0x05)."""
_KEY = _RECORD_HEAD + 2
"""Bytes of opcode, length and channel, which equal records share."""
_OPCODE_LENGTH = Struct('<BQ')
_MESSAGE = int(Opcode.MESSAGE)
_DESCRIPTIONS = frozenset({int(Opcode.SCHEMA), int(Opcode.CHANNEL), *range(0x80, 0x100)})
"""Records beside messages: descriptions, and private ones of a program, to be passed over."""


class McapRecording(ChunkedRecording):
    """An MCAP file."""

    _magic = b'\x89MCAP0\r\n'
    _kinds: ClassVar = {
        0: None, Opcode.CHUNK: 'chunk', Opcode.MESSAGE_INDEX: 'index',
        **dict.fromkeys((Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL), 'message'),
        **dict.fromkeys((Opcode.DATA_END, Opcode.FOOTER), 'end')}

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        self._schemas: dict[int, tuple[str, Definition | None]] = {}
        super().__init__(path, stored, options)

    def _batches(self, reading: Reading, part: Part) -> tuple[Iterable[MessageBatch], str]:
        file, size = reading.file, part.stop - part.start
        data = (_chunk_data(file, size, reading.limits) if part.kind == 'chunk'
                else file.read(size))
        batches, consumed = gather(data, reading.wanted, self._describe,
                                   lambda: _message_places(file, part))
        rest = len(data) - consumed
        return (unpacked(batches, reading.limits),
                f'{rest} bytes at its end are not whole records' if rest else '')

    def _read_index(self, file: BinaryIO) -> bool:
        """Read channels, counts and chunk offsets from the summary; return False without one."""
        if file.read(len(self._magic)) != self._magic:
            raise error_about(self.path, 'not an MCAP file')
        footer_size = _RECORD_HEAD + 20   # two offsets and a checksum: 8 + 8 + 4 (MCAP, op 0x02)
        footer_at = self.size_bytes - footer_size - len(self._magic)
        if footer_at < len(self._magic):
            return False
        file.seek(footer_at)
        tail = file.read(footer_size + len(self._magic))
        opcode, length = _OPCODE_LENGTH.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != 20 or tail[-len(self._magic):] != self._magic:
            return False
        summary_start, _, crc = unpack_from('<QQI', tail, _RECORD_HEAD)
        # Two million indexes of 100 bytes. A larger summary is not loaded; the file is scanned
        # instead.
        if not max(len(self._magic), footer_at - (1 << 28)) <= summary_start < footer_at:
            return False
        file.seek(summary_start)
        summary = file.read(footer_at - summary_start)
        if crc and crc != crc32(tail[:footer_size - 4], crc32(summary)):
            return False
        at = 0
        while len(summary) - at >= _RECORD_HEAD:
            opcode, length = _OPCODE_LENGTH.unpack_from(summary, at)
            body = summary[at + _RECORD_HEAD:at + _RECORD_HEAD + length]
            at += _RECORD_HEAD + length
            if opcode == Opcode.STATISTICS and len(body) <= self._largest_description:
                statistics = _parsed(Statistics.read, body)
                if statistics is not None:
                    counts = statistics.channel_message_counts
                    self._counts = counts if counts or statistics.message_count == 0 else None
                    self.ends_ns = [statistics.message_start_time, statistics.message_end_time]
            elif opcode == Opcode.CHUNK_INDEX and len(body) >= 24:
                # Only the offset, after two times, is needed; the library would parse the whole
                # ChunkIndex entry by entry.
                chunk_start = int.from_bytes(body[16:24], 'little')
                if chunk_start < self.size_bytes:
                    self._chunk_starts.append(chunk_start)
            else:
                self._describe(opcode, body)
        self._chunk_starts.sort()
        return True

    def _describe(self, opcode: int, body: bytes) -> None:
        """Store a schema or channel record, the first of its number."""
        number = int.from_bytes(body[:2], 'little')
        known = self._schemas if opcode == Opcode.SCHEMA else self._channels
        if (opcode not in (Opcode.SCHEMA, Opcode.CHANNEL) or number in known
                or len(body) > self._largest_description):
            return
        if opcode == Opcode.SCHEMA:
            schema = _parsed(Schema.read, body)
            if schema is not None and len(schema.name) <= _LONGEST_NAME:
                form = FORMS.get(schema.encoding)
                self._schemas[number] = schema.name, (
                    None if form is None or not schema.data.strip()
                    else Definition(schema.data.decode('utf-8', 'replace'), form))
        else:
            channel = _parsed(ChannelRecord.read, body)
            if channel is not None and len(channel.topic) <= _LONGEST_NAME:
                name, definition = self._schemas.get(channel.schema_id, ('', None))
                self._channels[number] = Channel(
                    channel.topic, name, channel.message_encoding[:_LONGEST_NAME], definition)

    def _head(self, file: BinaryIO, at: int) -> Part:
        file.seek(at)
        head = file.read(_RECORD_HEAD)
        opcode, length = _OPCODE_LENGTH.unpack(head) if len(head) == _RECORD_HEAD else (0, 0)
        kind, start = self._kinds.get(opcode, 'other'), at + _RECORD_HEAD
        stop = start + length
        if kind == 'index':
            number = int.from_bytes(file.read(2), 'little')
            # The length of the entries in bytes comes before them.
            return Part(kind, at, stop, {
                number: (start + 6, max(0, length - 6) // _INDEX_ENTRY.itemsize)})
        return Part(kind, start if kind == 'chunk' else at, at if kind == 'end' else stop)


def _chunk_data(file: BinaryIO, length: int, limits: ReadingLimits) -> bytes:
    """Decompress a chunk; raise DamagedData if damaged."""
    chunk_head = Struct('<QQQII')
    head = file.read(min(chunk_head.size, length))
    if len(head) < chunk_head.size:
        raise DamagedData('a chunk record without a header')
    _, _, size, crc, text = chunk_head.unpack(head)
    rest = length - chunk_head.size
    if text > min(rest - 8, _LONGEST_NAME):
        raise DamagedData(f'a compression name of {text} bytes')
    compression = file.read(text).decode('utf-8', 'replace')
    stored = int.from_bytes(file.read(8), 'little')
    if stored > rest - 8 - text:
        raise DamagedData(f'{stored} bytes declared in a record of {length}')
    data = expanded(file, compression, stored, size, limits)
    if crc and crc32(data) != crc:
        raise DamagedData('its checksum does not match')
    return data


def _message_places(file: BinaryIO, part: Part) -> Ints:
    """Read the message offsets declared by the indexes after a chunk, unless absurdly many."""
    with suppress(DamagedData):
        return np.concatenate(part.entries(file, _INDEX_ENTRY))['place'].astype(np.int64)
    return np.empty(0, np.int64)


def _parsed(read: Callable[[ReadDataStream], Record], body: bytes) -> Record | None:
    """Parse one record; return None if its content is damaged."""
    try:
        return read(ReadDataStream(BytesIO(body)))
    except (McapError, StructError, UnicodeDecodeError):
        return None


# -------------------------------------------------------------- the messages of a topic, as arrays

def gather(buffer: bytes, wanted: AbstractSet[int], describe: Describe,
           index: Callable[[], Ints] | None) -> tuple[Iterator[MessageBatch], int]:
    """
    Gather the messages of the channels `wanted`; also return the bytes of complete records.

    `describe` may add to `wanted`. `index` returns the offsets of all messages, as the file
    declares them, in any order. Messages are copied only when a batch is requested.
    """
    batches: list[Iterable[MessageBatch]] = []
    scattered: list[int] = []
    at, end = 0, len(buffer)
    # Use the message index after this many records that are not in a run.
    steps_left = 32
    while end - at >= _RECORD_HEAD:
        opcode, length = _OPCODE_LENGTH.unpack_from(buffer, at)
        stride = _RECORD_HEAD + length
        if stride > end - at:
            break
        if opcode == _MESSAGE:
            if stride < _HEAD.itemsize:
                break
            key = buffer[at:at + _KEY]
            # Two probes are cheap; comparing a whole run is not.
            run = (buffer[at + stride:at + stride + _KEY] == key
                   and buffer[at + 8 * stride:at + 8 * stride + _KEY] == key)
            count = _equal_records(buffer, at, stride) if run else 1
            if not run and index is not None:
                steps_left -= 1
                if steps_left == 0:
                    places = _verified(buffer, at, index(), describe)
                    if places is not None:
                        channels = anywhere(buffer, _HEAD)['channel'][places]
                        # All 65,536 may be wanted, but a chunk contains only a few.
                        chosen = np.isin(channels, [*wanted & {*np.unique(channels).tolist()}])
                        batches += [_collected(buffer, scattered),
                                    _collected(buffer, places[chosen])]
                        return chain.from_iterable(batches), end
            if int.from_bytes(key[_RECORD_HEAD:], 'little') in wanted:
                if run:
                    records = np.ndarray((count, stride), np.uint8, buffer, at, (stride, 1))
                    batches += [_collected(buffer, scattered), [_batch(records)]]
                    scattered = []
                else:
                    scattered.append(at)
            at += count * stride
        elif opcode in _DESCRIPTIONS:
            describe(opcode, buffer[at + _RECORD_HEAD:at + stride])
            at += stride
        else:
            break
    batches.append(_collected(buffer, scattered))
    return chain.from_iterable(batches), at


def _equal_records(buffer: bytes, at: int, stride: int) -> int:
    """Count records from `at` on, spaced by `stride`, of equal opcode, length and channel."""
    most = (len(buffer) - at) // stride
    end = at + (most - 1) * stride
    # If the last one is equal, most likely all are.
    count, more = 1, most if buffer[end:end + _KEY] == buffer[at:at + _KEY] else 64
    while count < most:
        more = min(more, most - count)
        last = at + (count - 1) * stride
        rows = np.ndarray((more + 1, stride), np.uint8, buffer, last)
        like = rows_like_first(rows, [(0, _KEY)])
        if like is not None:
            return count - 1 + int(np.argmin(like))
        count += more
        more *= 16
    return count


def _verified(buffer: bytes, at: int, places: Ints, describe: Describe) -> Ints | None:
    """Sort `places` from `at` on; return None unless their records fill the rest of the buffer."""
    places = np.unique(places[places >= at])
    heads = anywhere(buffer, _HEAD)
    if len(places) == 0 or places[-1] >= len(heads):
        return None
    lengths = heads['length'][places].astype(np.int64)
    if ((heads['opcode'][places] != _MESSAGE).any()
            or lengths.min() < _HEAD.itemsize - _RECORD_HEAD or lengths.max() > len(buffer)):
        return None
    starts, stops = np.append(places, len(buffer)), np.append(at, places + _RECORD_HEAD + lengths)
    gaps = np.flatnonzero(starts != stops)
    if all(_only_descriptions(buffer, stop, start, describe)
           for stop, start in zip(stops[gaps].tolist(), starts[gaps].tolist(), strict=True)):
        return places
    return None


def _only_descriptions(buffer: bytes, at: int, stop: int, describe: Describe) -> bool:
    """Return whether only whole records lie between two messages."""
    while at < stop:
        opcode, length = _OPCODE_LENGTH.unpack_from(buffer, at) if stop - at > 8 else (0, 0)
        if opcode not in _DESCRIPTIONS:
            return False
        describe(opcode, buffer[at + _RECORD_HEAD:at + _RECORD_HEAD + length])
        at += _RECORD_HEAD + length
    return at == stop


def _collected(buffer: bytes, offsets: list[int] | Ints) -> Iterator[MessageBatch]:
    """Copy the message records at `offsets`, in order, into arrays of equal record size."""
    places = np.array(offsets, np.int64)
    lengths = anywhere(buffer, _HEAD)['length'][places]
    for start, stop in runs(np.diff(lengths) != 0, len(places)):
        yield _batch(collect(buffer, places[start:stop], _RECORD_HEAD + int(lengths[start])))


def _batch(records: NDArray[np.uint8]) -> MessageBatch:
    heads = records[:, :_HEAD.itemsize].view(_HEAD)[:, 0]
    return MessageBatch(records[:, _HEAD.itemsize:], heads['log_ns'])
