# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ROS 1 bags, format 2.0, read chunk by chunk.

The messages of a topic are gathered from a decompressed chunk as arrays, as in MCAP files. The
per-message index grows with the length of a bag and is not loaded. The reader of the `rosbags`
library always loads it, so it is not used here.

References
----------
ROS wiki, Bags/Format/2.0

"""

from collections import Counter
from collections.abc import Callable, Iterator, Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

from imu_allan.block import ImuBlock
from imu_allan.cdr import MessageBatch
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.chunked_file import (
    Channel,
    ChunkedRecording,
    Damage,
    Decode,
    LARGEST_CHUNK,
    LARGEST_DESCRIPTION,
    Part,
)
from imu_allan.recordings.formats.decompress import DamagedData, decompress, ReadingLimits
from imu_allan.recordings.formats.gather import collect, equal_records, in_lists
from imu_allan.recordings.messages.definitions import Definition
import numpy as np
from numpy.typing import NDArray

MAGIC = b'#ROSBAG V2.0\n'

_MESSAGE, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = (bytes([op]) for op in (2, 4, 5, 6, 7))
"""Record types, the values of the field `op`."""

_Fields = dict[str, bytes]


class Ros1Recording(ChunkedRecording):
    """A ROS 1 bag; raises ImuAllanError if it is encrypted or of another version."""

    # Records that may be read one by one in any chunk, and bytes that allow one more. A step takes
    # 10 to 20 us; a chunk of 768 kB, as rosbag writes them, has at most 13,000 records.
    _limits = (20_000, 4)

    def _blocks(self, file: BinaryIO, part: Part, wanted: AbstractSet[int],
                enter: Callable[[int], None], decode: Decode, limits: ReadingLimits,
                ) -> Iterator[list[ImuBlock]]:
        for batches in in_lists(self._gather(
                _chunk_data(file, part, limits), wanted, enter, limits)):
            yield decode(batches)

    def _read_index(self, file: BinaryIO) -> bool:
        """Read connections and counts from the end of the bag; return False if it lacks them."""
        magic = file.read(len(MAGIC))
        if MAGIC.startswith(magic) and magic != MAGIC:
            raise ImuAllanError(f'{printable(self.path)}: cut short within its first line; copy '
                                'it again')
        if magic != MAGIC:
            version = magic[9:12].decode('ascii', 'replace').strip()
            raise ImuAllanError(
                f'{printable(self.path)}: ROS bag version {printable(version)} is not supported; '
                'convert it to 2.0 with: rosbag fix')
        bag_header = _record(file, len(MAGIC), self.size_bytes)
        if bag_header is None:
            return False
        if bag_header.fields.get('encryptor'):
            raise ImuAllanError(f'{printable(self.path)}: encrypted; decrypt it with: '
                                'rosbag decrypt')
        at = 0
        with suppress(DamagedData):
            at = _number(bag_header.fields, 'index_pos', 8)
            counts: Counter[int] = Counter()
            while 0 < at < self.size_bytes:
                record = _record(file, at, self.size_bytes)
                if record is None:
                    return False
                if record.fields['op'] == _CONNECTION:
                    self._describe(record.fields, file.read(
                        min(record.length, LARGEST_DESCRIPTION)))
                elif record.fields['op'] == _CHUNK_INFO:
                    place = _number(record.fields, 'chunk_pos', 8)
                    if place < self.size_bytes:
                        self._chunk_starts.append(place)
                    pairs = np.frombuffer(file.read(record.length // 8 * 8), '<u4').reshape(-1, 2)
                    for number, count in pairs.tolist():
                        counts[number] += count
                else:
                    return False
                at = record.start + record.length
            self._chunk_starts.sort()
            self._counts, self._counted = dict(counts), bool(counts)
        return bool(self._channels) and at == self.size_bytes

    def _describe(self, fields: _Fields, data: bytes) -> int | None:
        """Store a connection record; return its number if it is new."""
        # Each publisher of each topic has one; a hostile bag may have one every 50 bytes.
        most = 1 << 16
        with suppress(DamagedData):
            number = _number(fields, 'conn', 4)
            if number in self._channels:
                return None
            topic = _text(fields, 'topic')
            if not self.reserve_bytes(len(topic) + len(data)):
                return None
            if len(self._channels) == most:
                self.remark('many_topics', what='connections', listed=most)
                return None
            described = _fields_of(data)
            text = described.get('message_definition', b'').decode('utf-8', 'replace')
            self._channels[number] = Channel(
                topic, _text(described, 'type'), 'ros1',
                Definition(text) if text.strip() else None)
            return number
        return None

    def _parts(self, file: BinaryIO, damage: Damage) -> Iterator[Part]:
        """Yield the chunks."""
        at = len(MAGIC)
        part: Part | None = None
        while True:
            record = _record(file, at, self._next_chunk(at) or self.size_bytes)
            if record is not None and record.fields['op'] == _INDEX and part is not None:
                with suppress(DamagedData):
                    part.counts[_number(record.fields, 'conn', 4)] = _number(
                        record.fields, 'count', 4)
            elif part is not None:
                yield part
                part = None
            if record is None:
                known = self._skip_to_chunk(at, damage)
                if known is None:
                    break
                at = known
                continue
            if record.fields['op'] == _CHUNK:
                part = Part(at, record.start + record.length - at, is_chunk=True)
                damage.chunks += 1
            elif record.fields['op'] in (_CONNECTION, _CHUNK_INFO):
                break
            at = record.start + record.length

    def _gather(self, buffer: bytes, wanted: AbstractSet[int], enter: Callable[[int], None],
                limits: ReadingLimits) -> Iterator[MessageBatch]:
        """
        Gather the messages of the connections `wanted` from a chunk, and store new connections.

        Raises DamagedData, after the messages before it, at an incomplete record or when `limits`
        is exhausted.
        """
        heads: list[_MessageHead] = []
        scattered: list[int] = []
        scattered_head: _MessageHead | None = None

        def collected() -> Iterator[MessageBatch]:
            if scattered_head is not None:
                yield scattered_head.batch(
                    collect(buffer, np.array(scattered), scattered_head.stride))

        at = 0
        try:
            while at < len(buffer):
                limits.step()
                head = _head_at(buffer, at, heads)
                if head is None:
                    at, number = self._gather_connection(buffer, at)
                    if number is not None:
                        enter(number)
                    continue
                # Two probes are cheap; comparing a whole run is not.
                count = 1
                if (head.stands_at(buffer, at + head.stride)
                        and head.stands_at(buffer, at + 8 * head.stride)):
                    time_at = len(head.before)
                    count = equal_records(buffer, at, head.stride, [
                        (0, time_at), (time_at + 8, time_at + 8 + len(head.after))])
                if head.connection in wanted:
                    if count > 1 or head is not scattered_head:
                        yield from collected()
                        scattered, scattered_head = [], None
                    if count > 1:
                        yield head.batch(np.ndarray((count, head.stride), np.uint8, buffer, at))
                    else:
                        scattered.append(at)
                        scattered_head = head
                at += count * head.stride
        except DamagedData:
            yield from collected()
            raise
        yield from collected()

    def _gather_connection(self, buffer: bytes, at: int) -> tuple[int, int | None]:
        """Store the connection record at `at`; return its end, and its number if it is new."""
        start = at + 8 + int.from_bytes(buffer[at:at + 4], 'little')
        if start > len(buffer):
            raise DamagedData(f'no record at byte {at} of it')
        fields = _fields_of(buffer[at + 4:start - 4])
        end = start + int.from_bytes(buffer[start - 4:start], 'little')
        if end > len(buffer):
            raise DamagedData(f'the record at byte {at} of it is cut short')
        if fields.get('op') == _CONNECTION and end - start <= LARGEST_DESCRIPTION:
            return end, self._describe(fields, buffer[start:end])
        return end, None


class _Record(NamedTuple):
    """A record in the file: its header, and the location of its data."""

    fields: _Fields
    start: int
    length: int


@dataclass(frozen=True)
class _MessageHead:
    """
    The bytes that precede the data of a message in a chunk.

    Attributes
    ----------
    connection : int
        Connection number.
    before, after : bytes
        The bytes before and after the 8 bytes of the receive stamp.
    stride : int
        Size of the whole record in bytes.

    """

    connection: int
    before: bytes
    after: bytes
    stride: int

    def stands_at(self, buffer: bytes, at: int) -> bool:
        """Return whether a complete record with this head starts at `at`."""
        return (buffer.startswith(self.before, at)
                and buffer.startswith(self.after, at + len(self.before) + 8)
                and at + self.stride <= len(buffer))

    def batch(self, records: NDArray[np.uint8]) -> MessageBatch:
        """Extract receive stamps and data of records that have this head."""
        time_at = len(self.before)
        time = records[:, time_at:time_at + 8].view('<u4').astype(np.int64)
        return MessageBatch(records[:, time_at + 8 + len(self.after):],
                            time[:, 0] * 1_000_000_000 + time[:, 1])


def _fields_of(header: bytes) -> _Fields:
    """Parse a record header, fields of ``name=value``; raise DamagedData if malformed."""
    fields: _Fields = {}
    at = 0
    while at < len(header):
        stop = at + 4 + int.from_bytes(header[at:at + 4], 'little')
        name, equals, value = header[at + 4:stop].partition(b'=')
        if stop > len(header) or not equals or not name.isascii():
            raise DamagedData(f'no field at byte {at} of a record header')
        fields[name.decode()] = value
        at = stop
    return fields


def _number(fields: _Fields, name: str, size: int) -> int:
    """Return a field of `size` bytes as an unsigned number; raise DamagedData if there is none."""
    value = fields.get(name, b'')
    if len(value) != size:
        raise DamagedData(f'no field {name} of that size in the record header')
    return int.from_bytes(value, 'little')


def _text(fields: _Fields, name: str) -> str:
    """Return a field as text; raise DamagedData if there is none."""
    try:
        return fields[name].decode()
    except (KeyError, UnicodeDecodeError) as error:
        raise DamagedData(f'no text in field {name} of the record header') from error


def _record(file: BinaryIO, at: int, end: int) -> _Record | None:
    """Read the record header at `at`; return None if there is no complete record."""
    file.seek(at)
    size = int.from_bytes(file.read(4), 'little')
    # A header holds a topic and a few numbers. More is damage and is not allocated.
    if size > min(1 << 20, end - at - 8):
        return None
    with suppress(DamagedData):
        fields = _fields_of(file.read(size))
        length = int.from_bytes(file.read(4), 'little')
        start = at + 8 + size
        if 'op' in fields and start + length <= end:
            return _Record(fields, start, length)
    return None


def _chunk_data(file: BinaryIO, part: Part, limits: ReadingLimits) -> bytes:
    """Decompress a chunk within `limits`; raise DamagedData if damaged."""
    limits.begin(part.length)
    record = _record(file, part.start, part.start + part.length)
    if record is None:
        raise DamagedData('no header')
    size = _number(record.fields, 'size', 4)
    compression = _text(record.fields, 'compression')
    if max(size, record.length) > LARGEST_CHUNK:
        raise DamagedData(f'{max(size, record.length)} bytes are more than a chunk may have')
    if compression != 'none':
        limits.expand(size)
    return decompress(compression, file.read(record.length), size)


def _head_at(buffer: bytes, at: int, known: list[_MessageHead]) -> _MessageHead | None:
    """Read the head of the message at `at`; return None if it is another kind of record."""
    for head in known:
        if head.stands_at(buffer, at):
            return head
    header_end = at + 4 + int.from_bytes(buffer[at:at + 4], 'little')
    if not at + 8 <= header_end + 4 <= len(buffer) or header_end - at > 256:
        return None
    try:
        fields = _fields_of(buffer[at + 4:header_end])
        connection = _number(fields, 'conn', 4)
    except DamagedData:
        return None
    # The field length, 13, precedes name and value.
    time_field = buffer.find(b'\x0d\0\0\0time=', at, header_end)
    if fields.get('op') != _MESSAGE or time_field < 0:
        return None
    time_at = time_field + 9
    length = int.from_bytes(buffer[header_end:header_end + 4], 'little')
    head = _MessageHead(
        connection, buffer[at:time_at],
        buffer[time_at + 8:header_end + 4], header_end + 4 + length - at)
    if not head.stands_at(buffer, at):
        raise DamagedData(f'the message at byte {at} of it is cut short')
    # Known heads are compared in turn, so only a few are kept.
    if len(known) < 16:
        known.append(head)
    return head
