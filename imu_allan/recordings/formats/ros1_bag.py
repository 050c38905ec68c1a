# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ROS 1 bags, format 2.0, read chunk by chunk.

The index after each chunk locates its messages, which are gathered as arrays. It is trusted only
if they and the records of connections fill the chunk. The reader of the `rosbags` library always
loads the indexes of all chunks, so it is not used here.

References
----------
ROS wiki, Bags/Format/2.0

"""

from collections import Counter
from collections.abc import Container, Iterable, Iterator
from contextlib import suppress
from io import BytesIO
from typing import BinaryIO, ClassVar, NamedTuple

from imu_allan.arrays import Ints, runs
from imu_allan.cdr import anywhere, collect, MessageBatch
from imu_allan.errors import error_about, printable
from imu_allan.recordings.formats.chunked_file import Channel, ChunkedRecording, Part, Reading
from imu_allan.recordings.formats.decompress import DamagedData, expanded, ReadingLimits
from imu_allan.recordings.messages.definitions import Definition
import numpy as np

_CHUNK_INFO, _CONNECTION = b'\x06', b'\x07'
_ENTRY = np.dtype([('sec', '<u4'), ('nanosec', '<u4'), ('place', '<u4')])
"""An entry of the index after a chunk: receive stamp, and offset of a message."""

_Fields = dict[str, bytes]


class Ros1Recording(ChunkedRecording):
    """A ROS 1 bag; raises ImuAllanError if it is encrypted or of another version."""

    _magic = b'#ROSBAG V2.0\n'
    _kinds: ClassVar = {b'\x04': 'index', b'\x05': 'chunk', _CHUNK_INFO: 'end', _CONNECTION: 'end'}

    def _batches(self, reading: Reading, part: Part) -> tuple[Iterable[MessageBatch], str]:
        buffer = _chunk_data(reading.file, part, reading.limits)
        connections, times, places = _indexed(reading.file, part)
        bodies = places + 4 + _lengths(buffer, places)
        sizes = _lengths(buffer, bodies)
        starts, stops = np.append(places, len(buffer)), np.append(0, bodies + 4 + sizes)
        gaps = np.flatnonzero(starts != stops)
        for stop, start in zip(stops[gaps].tolist(), starts[gaps].tolist(), strict=True):
            self._read_connections(BytesIO(buffer), stop, start)
        chosen = np.isin(connections, [*reading.wanted & part.indexes.keys()])
        bodies, sizes, times = bodies[chosen], sizes[chosen], times[chosen]
        return (MessageBatch(collect(buffer, bodies[first:last], 4 + int(sizes[first]))[:, 4:],
                             times[first:last])
                for first, last in runs(np.diff(sizes) != 0, len(sizes))), ''

    def _read_index(self, file: BinaryIO) -> bool:
        """Read connections and counts from the end of the bag; return False if it lacks them."""
        magic = file.read(len(self._magic))
        if self._magic.startswith(magic) and magic != self._magic:
            raise error_about(self.path, 'cut short within its first line; copy it again')
        if magic != self._magic:
            version = magic[9:12].decode('ascii', 'replace').strip()
            raise error_about(self.path, f'ROS bag version {printable(version)} is not supported; '
                              'convert it to 2.0 with: rosbag fix')
        bag_header = _record(file, len(self._magic), self.size_bytes)
        if bag_header is None:
            return False
        if bag_header.fields.get('encryptor'):
            raise error_about(self.path, 'encrypted; decrypt it with: rosbag decrypt')
        counts: Counter[int] = Counter()
        try:
            index = _number(bag_header.fields, 'index_pos', 8)
            for fields, length in _records(file, index, self.size_bytes,
                                           {_CONNECTION, _CHUNK_INFO}):
                if fields['op'] == _CONNECTION:
                    self._describe(fields, file.read(min(length, self._largest_description)))
                else:
                    place = _number(fields, 'chunk_pos', 8)
                    if place < self.size_bytes:
                        self._chunk_starts.append(place)
                    pairs = np.frombuffer(file.read(length // 8 * 8), '<u4').reshape(-1, 2)
                    for number, count in pairs.tolist():
                        counts[number] += count
        except DamagedData:
            return False
        self._chunk_starts.sort()
        self._counts = dict(counts) or None
        return True

    def _describe(self, fields: _Fields, data: bytes) -> None:
        """Store a connection record, the first of its number, unless damaged."""
        with suppress(DamagedData):
            number, topic = _number(fields, 'conn', 4), _text(fields, 'topic')
            if number in self._channels or len(self._channels) >= self._most_channels:
                return
            described = _fields_of(data)
            text = described.get('message_definition', b'').decode('utf-8', 'replace')
            self._channels[number] = Channel(
                topic, _text(described, 'type'), 'ros1',
                Definition(text) if text.strip() else None)

    def _head(self, file: BinaryIO, at: int) -> Part:
        record = _record(file, at, self.size_bytes)
        if record is None:
            return Part(None)
        kind = self._kinds.get(record.fields['op'], 'other')
        entries = {}
        if kind == 'index':
            with suppress(DamagedData):
                entries[_number(record.fields, 'conn', 4)] = (
                    record.start, (record.stop - record.start) // _ENTRY.itemsize)
        return Part(kind, at, record.stop, entries)

    def _read_connections(self, file: BinaryIO, at: int, stop: int) -> None:
        """Store the connections of the records between two messages of a chunk."""
        for number, (fields, length) in enumerate(_records(file, at, stop, {_CONNECTION})):
            # A robot has a few hundred topics.
            if number == 10_000:
                raise DamagedData('more connections than a bag has')
            if length <= self._largest_description:
                self._describe(fields, file.read(length))


class _Record(NamedTuple):
    """A record in the file: its header, and the location of its data."""

    fields: _Fields
    start: int
    stop: int


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
            return _Record(fields, start, start + length)
    return None


def _records(file: BinaryIO, at: int, stop: int, kinds: Container[bytes],
             ) -> Iterator[tuple[_Fields, int]]:
    """Yield fields and data length of records; raise DamagedData unless they fill the space."""
    while at != stop:
        record = _record(file, at, stop)
        if record is None or record.fields['op'] not in kinds:
            raise DamagedData(f'at byte {at} of it is neither a message of its index nor the '
                              'record of a connection')
        yield record.fields, record.stop - record.start
        at = record.stop


def _chunk_data(file: BinaryIO, part: Part, limits: ReadingLimits) -> bytes:
    """Decompress a chunk within `limits`; raise DamagedData if damaged."""
    record = _record(file, part.start, part.stop)
    if record is None:
        raise DamagedData('no header')
    size = _number(record.fields, 'size', 4)
    return expanded(file, _text(record.fields, 'compression'), record.stop - record.start, size,
                    limits)


def _indexed(file: BinaryIO, part: Part) -> tuple[Ints, Ints, Ints]:
    """Return connection, receive stamp and place of the messages in a chunk, by its index."""
    held = part.entries(file, _ENTRY)
    entries = np.concatenate(held)
    order = np.argsort(entries['place'], kind='stable')
    connections = np.repeat(np.array([*part.indexes], np.int64), [*map(len, held[1:])])
    # With numpy 1, 32-bit numbers times a scalar would stay of 32 bits.
    times = entries['sec'].astype(np.int64) * 1_000_000_000 + entries['nanosec']
    return connections[order], times[order], entries['place'][order].astype(np.int64)


def _lengths(buffer: bytes, places: Ints) -> Ints:
    """Read a length at each place; raise DamagedData if one is beyond the end."""
    if len(places) and places.max() > len(buffer) - 4:
        raise DamagedData('its index names places beyond its end')
    return anywhere(buffer, '<u4')[places].astype(np.int64)
