# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ROS 1 bags, format 2.0, chunk by chunk, in one module because nothing else reads the format.

The messages of a topic are gathered from a decompressed chunk as arrays, like in an MCAP file. The
per-message index, which grows with the length of a bag, is not loaded; the `rosbags` library loads
it, and offers no part of its reader that does not.

References
----------
ROS wiki, Bags/Format/2.0

"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.damage import Damage, Part
from imu_allan.recordings.formats.decompress import DamagedData, decompress
from imu_allan.recordings.formats.effort import Effort
from imu_allan.recordings.formats.gather import collect, in_batches
from imu_allan.recordings.formats.ros1_header import DamagedHeader, Operation, Ros1Header
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.definitions import Definition, normal_name
from imu_allan.recordings.messages.piece import Piece
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np
from numpy.typing import NDArray

MAGIC = b'#ROSBAG V2.0\n'

_UINT = Struct('<I')
_LARGEST_HEADER = 1 << 20
"""It holds a topic and a few numbers; more is damage, and not allocated."""
_LARGEST_DEFINITION = 1 << 22
"""As in MCAP, far more than any definition has."""
_MOST_CONNECTIONS = 1 << 16
"""One to each publisher of each topic; a hostile bag may have one to each 50 bytes."""
_LARGEST_CHUNK = 1 << 28
"""rosbag writes 768 kB unless told otherwise; one number shall not fill the memory."""
_REMEMBERED_HEADS = 16
"""Connections whose messages are known by a comparison; they are tried in turn."""
_STEPS_AT_LEAST, _BYTES_PER_STEP = 20_000, 4
"""Records of a chunk that are stepped through whatever its size, and bytes for one more.

A step takes 10 to 20 us; a chunk of 768 kB, as rosbag writes them, holds 13,000 records at most.
"""
_TIME = np.dtype([('sec', '<u4'), ('nsec', '<u4')])


class Ros1Recording(FileRecording):
    """
    A ROS 1 bag.

    As any `FileRecording`.

    Raises
    ------
    ImuAllanError
        If the bag is of another version or encrypted.

    """

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._connections: dict[int, _Connection] = {}
        self._counts: dict[int, int] = {}
        self._chunk_starts: list[int] = []
        with stored.open('rb') as file:
            magic = file.read(len(MAGIC))
            if MAGIC.startswith(magic) and magic != MAGIC:
                raise ImuAllanError(f'{printable(path)}: cut short within its first line; copy it '
                                    'again')
            if magic != MAGIC:
                version = magic[9:12].decode('ascii', 'replace').strip()
                raise ImuAllanError(
                    f'{printable(path)}: ROS bag version {printable(version)} is not supported; '
                    'convert it to 2.0 with: rosbag fix')
            record = _record(file, len(MAGIC), self.size_bytes)
            if record is not None and record.header.get('encryptor'):
                raise ImuAllanError(f'{printable(path)}: encrypted; decrypt it with: '
                                    'rosbag decrypt')
            if record is None or not self._read_index(file, record):
                self._scan(file)
        self._list_topics()

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks chunk by chunk, each with the bytes consumed so far."""
        decode = self.imu(topic).messages.decoder()
        effort = Effort(self.path, _STEPS_AT_LEAST, _BYTES_PER_STEP)
        malformed = MalformedMessages()
        damage = Damage()
        messages = 0
        imu = self.imu(topic)
        wanted = {number for number, connection in self._connections.items()
                  if connection.is_of(imu)}

        def enter(number: int) -> None:
            if self._connections[number].is_of(imu):
                wanted.add(number)

        with self._stored.open('rb') as file:
            for part in self._walk(file, damage):
                if part.counts and not wanted & part.counts.keys():
                    continue
                try:
                    for pieces in in_batches(piece for _, piece in self._gather(
                            _chunk_data(file, part, effort), wanted, enter, effort)):
                        for block in decode(pieces, malformed):
                            messages += len(block)
                            yield block, part.start
                except DamagedData as error:
                    damage.chunk(part.start, str(error))
        malformed.report(self.imu(topic), self.remark)
        expected = sum(self._counts.get(number, 0) for number in wanted)
        damage.report(self, topic, expected - messages - malformed.count, expected)

    # ---------------------------------------------------------------------------- what is there

    def _read_index(self, file: BinaryIO, bag_header: '_Record') -> bool:
        """Take connections and counts from the end of the bag; False where it has none."""
        with suppress(DamagedHeader):
            at = bag_header.header.number('index_pos', 8)
            counts: Counter[int] = Counter()
            while 0 < at < self.size_bytes:
                record = _record(file, at, self.size_bytes)
                if record is None:
                    return False
                op = record.header.operation()
                if op == Operation.CONNECTION:
                    self._describe(record.header, file.read(
                        min(record.length, _LARGEST_DEFINITION)))
                elif op == Operation.CHUNK_INFO:
                    place = record.header.number('chunk_pos', 8)
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
        effort = Effort(self.path, _STEPS_AT_LEAST, _BYTES_PER_STEP)
        damage = Damage()
        for part in self._walk(file, damage):
            counts.update(part.counts)
            if not part.counts or part.counts.keys() - self._connections:
                try:
                    for _ in self._gather(
                            _chunk_data(file, part, effort), frozenset(), lambda _: None, effort):
                        pass
                except DamagedData as error:
                    damage.chunk(part.start, str(error))
        self._counts = dict(counts)
        if not self._connections and (reason := damage.summary()):
            raise ImuAllanError(
                f'{printable(self.path)}: damaged, no topic can be found in it: {reason}')

    def _describe(self, header: Ros1Header, data: bytes) -> int | None:
        """Remember a connection record; returns the number of a new one."""
        with suppress(DamagedHeader):
            number = header.number('conn', 4)
            if number in self._connections:
                return None
            topic = header.text('topic')
            if not self.keeps(len(topic) + len(data)):
                return None
            if len(self._connections) == _MOST_CONNECTIONS:
                self.remark('many_topics', what='connections', listed=_MOST_CONNECTIONS)
                return None
            fields = Ros1Header(data)
            self._connections[number] = _Connection(
                topic, fields.text('type'),
                fields.get('message_definition').decode('utf-8', 'replace'))
            return number
        return None

    def _list_topics(self) -> None:
        groups: dict[tuple[str, str], list[int]] = {}
        for number, connection in self._connections.items():
            groups.setdefault((connection.topic, connection.type_name), []).append(number)
        listed: set[str] = set()
        for (topic, kind), numbers in groups.items():
            if topic in listed:
                continue
            text = self._connections[numbers[0]].definition
            count = sum(self._counts.get(number, 0) for number in numbers)
            if self.list_topic(topic, kind, 'ros1', count if self._counts else None,
                               Definition(text) if text.strip() else None):
                listed.add(topic)

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
            if record is not None and op == Operation.INDEX and part is not None:
                with suppress(DamagedHeader):
                    part.counts[record.header.number('conn', 4)] = (
                        record.header.number('count', 4))
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
            if op == Operation.CHUNK:
                part = Part(at, record.start + record.length - at, is_chunk=True)
                damage.chunks += 1
            elif op in (Operation.CONNECTION, Operation.CHUNK_INFO):
                break
            at = record.start + record.length

    def _gather(self, buffer: bytes, wanted: AbstractSet[int], enter: Callable[[int], None],
                effort: Effort) -> Iterator[tuple[int, Piece]]:
        """
        Gather the messages of connections from a chunk, and remember the connections in it.

        Parameters
        ----------
        buffer : bytes
            The chunk.
        wanted : set of int
            Numbers of the connections; looked at anew after each call of `enter`.
        enter : callable
            Called with the number of each connection that was not known.
        effort : Effort
            How many records may be stepped through.

        Yields
        ------
        (int, Piece)
            With the number of their connection.

        Raises
        ------
        DamagedData
            Where the buffer does not consist of whole records, or of more than `effort` allows,
            after the messages before.

        """
        heads: list[_MessageHead] = []
        scattered: list[int] = []
        scattered_head: _MessageHead | None = None
        failure: DamagedData | None = None
        at, end = 0, len(buffer)
        while at < end:
            try:
                effort.step()
                head = _head_at(buffer, at, heads)
                if head is None:
                    at, number = self._gather_connection(buffer, at)
                    if number is not None:
                        enter(number)
                    continue
            except DamagedData as error:
                failure = error
                break
            count = _equal_records(buffer, at, head)
            if head.connection in wanted:
                if scattered_head is not None and (count > 1 or head is not scattered_head):
                    yield _scattered(buffer, scattered, scattered_head)
                    scattered, scattered_head = [], None
                if count > 1:
                    yield head.connection, _piece(
                        np.ndarray((count, head.stride), np.uint8, buffer, at), head)
                else:
                    scattered.append(at)
                    scattered_head = head
            at += count * head.stride
        if scattered_head is not None:
            yield _scattered(buffer, scattered, scattered_head)
        if failure is not None:
            raise failure

    def _gather_connection(self, buffer: bytes, at: int) -> tuple[int, int | None]:
        """Remember the connection record at `at`; returns its end, and its number if new."""
        start = at + 8 + int.from_bytes(buffer[at:at + 4], 'little')
        try:
            if start > len(buffer):
                raise DamagedHeader('cut short')
            header = Ros1Header(buffer[at + 4:start - 4])
            operation = header.operation()
        except DamagedHeader as error:
            raise DamagedData(f'no record at byte {at} of it') from error
        end = start + int.from_bytes(buffer[start - 4:start], 'little')
        if end > len(buffer):
            raise DamagedData(f'the record at byte {at} of it is cut short')
        if operation == Operation.CONNECTION and end - start <= _LARGEST_DEFINITION:
            return end, self._describe(header, buffer[start:end])
        return end, None


@dataclass(frozen=True)
class _Connection:
    topic: str
    type_name: str
    definition: str

    def is_of(self, imu: ImuTopic) -> bool:
        """Whether it carries the messages of an Imu topic."""
        return (self.topic == imu.topic
                and normal_name(self.type_name) == imu.messages.type_name)


@dataclass(frozen=True)
class _Record:
    """A record of the file: its header, and the place of its data."""

    header: Ros1Header
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
        header = Ros1Header(file.read(size))
    except DamagedHeader:
        return None
    [length] = _UINT.unpack(file.read(4))
    start = at + 8 + size
    return _Record(header, start, length) if start + length <= end else None


def _operation(record: _Record | None) -> Operation | None:
    """Tell what a record is; None where it is none."""
    try:
        return None if record is None else record.header.operation()
    except DamagedHeader:
        return None


def _chunk_data(file: BinaryIO, part: Part, effort: Effort) -> bytes:
    """
    Decompress a chunk, and begin the effort that it may take.

    Raises
    ------
    DamagedData
        If it is not what its header declares, or expands to more than `effort` allows.

    """
    effort.begin(part.length)
    record = _record(file, part.start, part.start + part.length)
    try:
        if record is None:
            raise DamagedData('no header')
        size = record.header.number('size', 4)
        compression = record.header.text('compression')
    except DamagedHeader as error:
        raise DamagedData(str(error)) from error
    if max(size, record.length) > _LARGEST_CHUNK:
        raise DamagedData(f'{max(size, record.length)} bytes are more than a chunk may have')
    if compression != 'none':
        effort.expand(size)
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
    try:
        header = Ros1Header(buffer[at + 4:header_end])
        if header.operation() != Operation.MESSAGE:
            return None
        connection = header.number('conn', 4)
        header.value('time', 8)
    except DamagedHeader:
        return None
    time_at = at + 4 + header.place('time')
    length = int.from_bytes(buffer[header_end:header_end + 4], 'little')
    head = _MessageHead(
        connection, buffer[at:time_at],
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


def _scattered(buffer: bytes, places: list[int], head: _MessageHead) -> tuple[int, Piece]:
    return head.connection, _piece(collect(buffer, np.array(places), head.stride), head)
