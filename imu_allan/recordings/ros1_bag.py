# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ROS 1 bags, format 2.0, chunk by chunk.

Record headers are read with the classes of the `rosbags` library, except those of messages, which
are gathered from a decompressed chunk as arrays like in an MCAP file. The per-message index, which
grows with the length of a bag, is not loaded.

References
----------
ROS wiki, Bags/Format/2.0

"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from struct import error as StructError, Struct
from typing import BinaryIO

from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu_rows
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.damage import Damage, Part
from imu_allan.recordings.decompress import DamagedData, decompress
from imu_allan.recordings.gather import collect, Piece
from imu_allan.recordings.recording import IMU_TYPES, ImuTopic, MalformedMessages, Recording
import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1.reader import Header, ReaderError, RecordType

MAGIC = b'#ROSBAG V2.0\n'

_UINT = Struct('<I')
_LARGEST_HEADER = 1 << 20
_LARGEST_DEFINITION = 1 << 22
_MOST_CONNECTIONS = 1 << 16
_LARGEST_CHUNK = 1 << 28
_REMEMBERED_HEADS = 16
_TIME = np.dtype([('sec', '<u4'), ('nsec', '<u4')])


class Ros1Recording(Recording):
    """
    A ROS 1 bag.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.

    Raises
    ------
    ImuAllanError
        If the bag is of another version or encrypted.

    """

    def __init__(self, path: Path, stored: Path) -> None:
        super().__init__(path)
        self._stored = stored
        self._connections: dict[int, _Connection] = {}
        self._counts: dict[int, int] = {}
        self._chunk_starts: list[int] = []
        with stored.open('rb') as file:
            self.size_bytes = file.seek(0, 2)
            file.seek(0)
            magic = file.read(len(MAGIC))
            if magic != MAGIC:
                version = magic[9:12].decode('ascii', 'replace').strip()
                raise ImuAllanError(
                    f'{printable(path)}: ROS bag version {printable(version)} is not supported; '
                    'convert it to 2.0 with: rosbag fix')
            record = _record(file, len(MAGIC), self.size_bytes)
            if record is not None and record.header.get('encryptor'):
                raise ImuAllanError(f'{printable(path)}: encrypted bags are not supported')
            if record is None or not self._read_index(file, record):
                self._scan(file)
        self._list_topics()

    def close(self) -> None:
        """Release nothing: each reading opens and closes the file itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks chunk by chunk, each with the bytes consumed so far."""
        malformed = MalformedMessages()
        damage = Damage()
        messages = 0
        with self._stored.open('rb') as file:
            for part in self._walk(file, damage):
                wanted = self._numbers(topic)
                if part.counts and not wanted & part.counts.keys():
                    continue
                try:
                    for piece in self._gather(_chunk_data(file, part), topic):
                        for block in decode_imu_rows(
                                piece.rows, piece.receive_ns, 'ros1', malformed):
                            messages += len(block)
                            yield block, part.start
                except DamagedData as error:
                    damage.chunk(part.start, str(error))
        malformed.report(self, topic)
        expected = sum(self._counts.get(number, 0) for number in self._numbers(topic))
        damage.report(self, topic, expected - messages - malformed.count, expected)

    # ---------------------------------------------------------------------------- what is there

    def _read_index(self, file: BinaryIO, bag_header: '_Record') -> bool:
        """Take connections and counts from the end of the bag; False where it has none."""
        with suppress(ReaderError):
            at = bag_header.header.get_uint64('index_pos')
            counts: Counter[int] = Counter()
            while 0 < at < self.size_bytes:
                record = _record(file, at, self.size_bytes)
                if record is None:
                    return False
                op = record.header.get_uint8('op')
                if op == RecordType.CONNECTION:
                    self._describe(record.header, file.read(
                        min(record.length, _LARGEST_DEFINITION)))
                elif op == RecordType.CHUNK_INFO:
                    place = record.header.get_uint64('chunk_pos')
                    if place < self.size_bytes:
                        self._chunk_starts.append(place)
                    pairs = np.frombuffer(file.read(record.length // 8 * 8), '<u4').reshape(-1, 2)
                    for number, count in pairs.tolist():
                        counts[number] += count
                else:
                    return False
                at = record.start + record.length
            self._chunk_starts.sort()
            self._counts = dict(counts)
        return bool(self._connections) and at == self.size_bytes

    def _scan(self, file: BinaryIO) -> None:
        """Learn the connections from the chunks themselves, for want of an index."""
        counts: Counter[int] = Counter()
        damage = Damage()
        for part in self._walk(file, damage):
            counts.update(part.counts)
            if not part.counts or part.counts.keys() - self._connections:
                try:
                    for _ in self._gather(_chunk_data(file, part), None):
                        pass
                except DamagedData as error:
                    damage.chunk(part.start, str(error))
        self._counts = dict(counts)
        if not self._connections and (reason := damage.summary()):
            raise ImuAllanError(
                f'{printable(self.path)}: damaged, no topic can be found in it: {reason}')

    def _describe(self, header: Header, data: bytes) -> None:
        """Remember a connection record."""
        if len(self._connections) > _MOST_CONNECTIONS:
            return
        with suppress(ReaderError, UnicodeDecodeError):
            number = header.get_uint32('conn')
            fields = Header.read(BytesIO(_UINT.pack(len(data)) + data))
            self._connections[number] = _Connection(
                header.get_string('topic'), fields.get_string('type'),
                b'sensor_msgs/Imu' in fields.get('message_definition', b''))

    def _list_topics(self) -> None:
        counts: Counter[str] = Counter()
        for number, connection in self._connections.items():
            if connection.type_name in IMU_TYPES:
                counts[connection.topic] += self._counts.get(number, 0)
            else:
                self.other_topics[connection.topic] = connection.type_name
                if connection.carries_imu:
                    self.carriers.add(connection.topic)
        self.topics = [ImuTopic(name, count if self._counts else None)
                       for name, count in counts.items()]

    def _numbers(self, topic: str | None) -> set[int]:
        return {number for number, connection in self._connections.items()
                if connection.topic == topic and connection.type_name in IMU_TYPES}

    # ------------------------------------------------------------------------------ going through

    def _walk(self, file: BinaryIO, damage: Damage) -> Iterator[Part]:
        """Step through the chunks."""
        at = len(MAGIC)
        part: Part | None = None
        while True:
            place = bisect_right(self._chunk_starts, at)
            limit = (self._chunk_starts[place] if place < len(self._chunk_starts)
                     else self.size_bytes)
            record = _record(file, at, limit)
            op = _operation(record)
            if record is not None and op == RecordType.IDXDATA and part is not None:
                with suppress(ReaderError):
                    part.counts[record.header.get_uint32('conn')] = (
                        record.header.get_uint32('count'))
            elif part is not None:
                yield part
                part = None
            if record is None or op is None:
                if place == len(self._chunk_starts):
                    damage.ending(at, self.size_bytes - at, in_chunk=False)
                    break
                damage.hole(at, limit - at)
                at = limit
                continue
            if op == RecordType.CHUNK:
                part = Part(at, record.start + record.length - at, is_chunk=True)
                damage.chunks += 1
            elif op in (RecordType.CONNECTION, RecordType.CHUNK_INFO):
                break
            at = record.start + record.length

    def _gather(self, buffer: bytes, topic: str | None) -> Iterator[Piece]:
        """
        Gather the messages of `topic` from a chunk, and remember its connections.

        Raises
        ------
        DamagedData
            Where the buffer does not consist of whole records, after the messages before.

        """
        wanted = self._numbers(topic)
        heads: list[_MessageHead] = []
        scattered: list[int] = []
        scattered_head: _MessageHead | None = None
        failure: DamagedData | None = None
        at, end = 0, len(buffer)
        while at < end:
            try:
                head = _head_at(buffer, at, heads)
                if head is None:
                    known = len(self._connections)
                    at = self._gather_connection(buffer, at)
                    if len(self._connections) > known:
                        wanted = self._numbers(topic)
                    continue
            except DamagedData as error:
                failure = error
                break
            count = _equal_records(buffer, at, head)
            if head.connection in wanted:
                if scattered_head is not None and (count > 1 or head is not scattered_head):
                    yield _piece(collect(
                        buffer, np.array(scattered), scattered_head.stride), scattered_head)
                    scattered, scattered_head = [], None
                if count > 1:
                    yield _piece(np.ndarray((count, head.stride), np.uint8, buffer, at), head)
                else:
                    scattered.append(at)
                    scattered_head = head
            at += count * head.stride
        if scattered_head is not None:
            yield _piece(collect(
                        buffer, np.array(scattered), scattered_head.stride), scattered_head)
        if failure is not None:
            raise failure

    def _gather_connection(self, buffer: bytes, at: int) -> int:
        """Remember the connection record at `at`; returns where it ends."""
        source = BytesIO(buffer)
        source.seek(at)
        try:
            header = Header.read(source)
            if header.get_uint8('op') not in tuple(RecordType):
                raise DamagedData(f'no record at byte {at} of it')
            [length] = _UINT.unpack(source.read(4))
        except (ReaderError, UnicodeDecodeError, StructError) as error:
            raise DamagedData(f'no record at byte {at} of it') from error
        start = source.tell()
        if start + length > len(buffer):
            raise DamagedData(f'the record at byte {at} of it is cut short')
        if header.get_uint8('op') == RecordType.CONNECTION and length <= _LARGEST_DEFINITION:
            self._describe(header, buffer[start:start + length])
        end: int = start + length
        return end


@dataclass(frozen=True)
class _Connection:
    topic: str
    type_name: str
    carries_imu: bool


@dataclass(frozen=True)
class _Record:
    """A record of the file: its header, and the place of its data."""

    header: Header
    start: int
    length: int


@dataclass(frozen=True)
class _MessageHead:
    """
    What stands before the data of a message in a chunk.

    Attributes
    ----------
    connection : int
        Connection number.
    before, after : bytes
        What it consists of, before and after the 8 bytes of the receive stamp.
    stride : int
        Bytes of the whole record.

    """

    connection: int
    before: bytes
    after: bytes
    stride: int

    @property
    def time_at(self) -> int:
        """Place of the receive stamp, from the start of the record."""
        return len(self.before)

    @property
    def size(self) -> int:
        """Bytes before the data."""
        return len(self.before) + 8 + len(self.after)

    def stands_at(self, buffer: bytes, at: int) -> bool:
        """Whether a whole record with this head stands at `at`."""
        return (buffer.startswith(self.before, at)
                and buffer.startswith(self.after, at + len(self.before) + 8)
                and at + self.stride <= len(buffer))


def _record(file: BinaryIO, at: int, end: int) -> _Record | None:
    """Read the header of the record at `at`; None where no whole record is there."""
    file.seek(at)
    head = file.read(4)
    size = _UINT.unpack(head)[0] if len(head) == 4 else _LARGEST_HEADER + 1
    if size > min(_LARGEST_HEADER, end - at - 8):
        return None
    try:
        header = Header.read(BytesIO(head + file.read(size)))
    except (ReaderError, UnicodeDecodeError):
        return None
    [length] = _UINT.unpack(file.read(4))
    start = at + 8 + size
    return _Record(header, start, length) if start + length <= end else None


def _operation(record: _Record | None) -> RecordType | None:
    """Tell what a record is; None where it is none."""
    try:
        return None if record is None else RecordType(record.header.get_uint8('op'))
    except (ReaderError, ValueError):
        return None


def _chunk_data(file: BinaryIO, part: Part) -> bytes:
    """
    Decompress a chunk.

    Raises
    ------
    DamagedData
        If it is not what its header declares.

    """
    record = _record(file, part.start, part.start + part.length)
    try:
        if record is None:
            raise DamagedData('no header')
        size = record.header.get_uint32('size')
        compression = record.header.get_string('compression')
    except (ReaderError, UnicodeDecodeError) as error:
        raise DamagedData(str(error)) from error
    if max(size, record.length) > _LARGEST_CHUNK:
        raise DamagedData(f'{max(size, record.length)} bytes are more than a chunk may have')
    return decompress(compression, file.read(record.length), size)


def _head_at(buffer: bytes, at: int, known: list[_MessageHead]) -> _MessageHead | None:
    """
    Read what stands before the data of a message; None where there is another record.

    Raises
    ------
    DamagedData
        If the record is cut short.

    """
    for head in known:
        if head.stands_at(buffer, at):
            return head
    header_end = at + 4 + int.from_bytes(buffer[at:at + 4], 'little')
    if not at + 8 <= header_end + 4 <= len(buffer) or header_end - at > 256:
        return None
    fields: dict[bytes, tuple[bytes, int]] = {}
    place = at + 4
    while place < header_end:
        stop = place + 4 + int.from_bytes(buffer[place:place + 4], 'little')
        if stop > header_end:
            return None
        name, _, value = buffer[place + 4:stop].partition(b'=')
        fields[name] = value, stop - len(value)
        place = stop
    operation, _ = fields.get(b'op', (b'', 0))
    connection, _ = fields.get(b'conn', (b'', 0))
    time, time_at = fields.get(b'time', (b'', 0))
    if operation != bytes([RecordType.MSGDATA]) or len(connection) != 4 or len(time) != 8:
        return None
    length = int.from_bytes(buffer[header_end:header_end + 4], 'little')
    head = _MessageHead(
        int.from_bytes(connection, 'little'), buffer[at:time_at],
        buffer[time_at + 8:header_end + 4], header_end + 4 + length - at)
    if not head.stands_at(buffer, at):
        raise DamagedData(f'the message at byte {at} of it is cut short')
    if len(known) < _REMEMBERED_HEADS:
        known.append(head)
    return head


def _equal_records(buffer: bytes, at: int, head: _MessageHead) -> int:
    """Count the records from `at` on that differ in time and data only."""
    # Two probes ahead are cheap; the comparison of a whole run is not.
    if not (head.stands_at(buffer, at + head.stride)
            and head.stands_at(buffer, at + 8 * head.stride)):
        return 1
    most = (len(buffer) - at) // head.stride
    count, span = 1, 64
    while count < most:
        span = min(span, most - count)
        heads = np.ndarray(
            (span, head.size), np.uint8, buffer, at + count * head.stride, (head.stride, 1))
        same = (heads[:, :head.time_at] == np.frombuffer(head.before, np.uint8)).all(axis=1)
        same &= (heads[:, head.time_at + 8:] == np.frombuffer(head.after, np.uint8)).all(axis=1)
        if not same.all():
            return count + int(np.argmin(same))
        count += span
        span *= 16
    return count


def _piece(records: NDArray[np.uint8], head: _MessageHead) -> Piece:
    time = records[:, head.time_at:head.time_at + 8].view(_TIME)[:, 0]
    return Piece(records[:, head.size:],
                 time['sec'].astype(np.int64) * 1_000_000_000 + time['nsec'])
