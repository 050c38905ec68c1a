# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Common parts of the chunked formats: MCAP and ROS 1 bags."""

from abc import abstractmethod
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, Literal

from imu_allan.block import ImuBlock
from imu_allan.cdr import MessageBatch, Serialization
from imu_allan.errors import error_about, printable
from imu_allan.recordings.formats.decompress import DamagedData, LARGEST_CHUNK, ReadingLimits
from imu_allan.recordings.messages.definitions import Definition, normal_name
from imu_allan.recordings.messages.type_names import IMU_TYPES
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording, ImuTopic, Recording, TopicDecoder
import numpy as np
from numpy.typing import NDArray

WINDOW = 1 << 22
"""Most bytes read at a time outside of chunks."""
_UNWRITTEN = 'what was not yet written is missing'

Kind = Literal['chunk', 'index', 'message', 'end', 'other']


@dataclass
class Part:
    """
    A record, such as a chunk, or a run of messages outside of chunks.

    Attributes
    ----------
    kind : Kind or None
        A message may be the description of one; nothing is read after the end. None if no record
        can be recognized.
    start, stop : int
        Position in the file.
    indexes : dict of int to (int, int)
        Position and number of entries of the index of each channel, in it or after it.

    """

    kind: Kind | None
    start: int = 0
    stop: int = 0
    indexes: dict[int, tuple[int, int]] = field(default_factory=dict)

    def entries(self, file: BinaryIO, kind: np.dtype[np.void]) -> list[NDArray[np.void]]:
        """Read the entries of the indexes; raise DamagedData if there are absurdly many."""
        if kind.itemsize * sum(count for _, count in self.indexes.values()) > LARGEST_CHUNK:
            raise DamagedData('its index is larger than a chunk may be')
        found = [np.empty(0, kind)]
        for start, count in self.indexes.values():
            file.seek(start)
            found.append(np.frombuffer(file.read(kind.itemsize * count), kind))
        return found


@dataclass(frozen=True)
class Channel:
    """The messages of one publisher, and their encoding."""

    topic: str
    type_name: str
    encoding: str
    definition: Definition | None

    def is_of(self, imu: ImuTopic) -> bool:
        """Return whether the channel carries the messages of an Imu topic."""
        return (self.topic == imu.topic and self.encoding == imu.messages.serialization
                and normal_name(self.type_name) == imu.messages.type_name)


class ChunkedRecording(FileRecording):
    """A chunked file whose channels are described in an index at its end or in the chunks."""

    _magic: ClassVar[bytes]
    _kinds: ClassVar[Mapping[Any, Kind | None]]
    """Kinds of records, by what marks them."""
    _largest_description: ClassVar = 1 << 22
    """Bytes of a record that describes a channel; far more than any definition has."""
    _most_channels: ClassVar = 1 << 16
    """As many as the numbers of an MCAP file."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._channels: dict[int, Channel] = {}
        # Messages of each channel; None if the file has no counts at all.
        self._counts: dict[int, int] | None = None
        self._chunk_starts: list[int] = []
        with stored.open('rb') as file:
            # If messages are counted of a channel that is not described, descriptions are lost.
            if (not self._read_index(file) or not self._channels
                    or (self._counts or {}).keys() - self._channels.keys()):
                self._scan(file)
        self._list_topics()

    @abstractmethod
    def _read_index(self, file: BinaryIO) -> bool:
        """Read channels, counts and chunk offsets from the end; return False if damaged."""

    @abstractmethod
    def _head(self, file: BinaryIO, at: int) -> Part:
        """Read the head of the record at `at`."""

    @abstractmethod
    def _batches(self, reading: 'Reading', part: Part) -> tuple[Iterable[MessageBatch], str]:
        """
        Gather the messages of the channels wanted in a part; also return what is damaged.

        Channels that it describes are stored. Raises DamagedData if nothing of it can be read.
        """

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks chunk by chunk, each with the number of bytes consumed so far."""
        decode = TopicDecoder(self.imu(topic))
        wanted = {number for number, channel in self._channels.items()
                  if channel.is_of(decode.imu)}
        with self._stored.open('rb') as file:
            reading = Reading(file, ReadingLimits(self.path), wanted)

            def blocks_of(part: Part) -> list[ImuBlock]:
                batches = self._intact(reading, part)
                return [block for held in in_lists(batches) for block in decode(held)]

            for part in self._parts(reading):
                if part.indexes and not wanted & part.indexes.keys():
                    continue
                # Hold no buffer while the caller works. Memory freed before the next buffer is
                # allocated is reused, which saves a quarter of the decompression time.
                for block in blocks_of(part):
                    yield block, part.start
        decode.report(self.remark)
        expected = self._count(wanted) or 0
        reading.report(self, topic, expected - decode.samples - decode.malformed, expected)

    def _intact(self, reading: 'Reading', part: Part) -> Iterable[MessageBatch]:
        """Gather the messages of a part as far as it is intact, and note its damage."""
        batches: Iterable[MessageBatch] = ()
        reading.file.seek(part.start)
        try:
            batches, fault = self._batches(reading, part)
        except DamagedData as error:
            fault = str(error)
        if fault:
            reading.broken_chunks += 1
            reading.note_damage(part.start, fault)
        return batches

    def _scan(self, file: BinaryIO) -> None:
        """
        Collect the channels from the data itself if there is no index at the end.

        The indexes after chunks list channels and message counts. Only chunks with a channel that
        is not described yet are decompressed.
        """
        counts: Counter[int] = Counter()
        reading = Reading(file, ReadingLimits(self.path))
        for part in self._parts(reading):
            counts.update({number: count for number, (_, count) in part.indexes.items()})
            if not part.indexes or part.indexes.keys() - self._channels:
                self._intact(reading, part)
        self._counts = self._counts or dict(counts) or None
        reason = reading.first_damage or (reading.end if reading.end != _UNWRITTEN else '')
        if reason and not self._channels:
            raise error_about(self.path, f'damaged, no topic can be found in it: {reason}')

    def _parts(self, reading: 'Reading') -> Iterator[Part]:
        """Yield the chunks, and runs of records outside of chunks, in order."""
        at = len(self._magic)
        ends = [*self._chunk_starts, self.size_bytes]
        part: Part | None = None
        while True:
            # The next chunk known from the index, or the end of the file.
            end = ends[bisect_right(self._chunk_starts, at)]
            found = self._head(reading.file, at)
            whole = found.kind is not None and found.stop <= end
            if part is not None:
                if whole and found.kind == 'index' and part.kind == 'chunk':
                    part.indexes.update(found.indexes)
                elif (whole and found.kind == part.kind == 'message'
                        and found.stop - part.start <= WINDOW):
                    part.stop = found.stop
                else:
                    yield part
                    part = None
            if not whole:
                self._note_lost(reading, at, end, found.kind == 'chunk')
                if end == self.size_bytes:
                    return
                at = end
                continue
            if found.kind == 'end':
                return
            # A record that is too large for an Imu message is an image or a point cloud.
            if part is None and (found.kind == 'chunk' or (
                    found.kind == 'message' and found.stop - found.start <= WINDOW)):
                part = found
                reading.chunks += found.kind == 'chunk'
            at = found.stop

    def _count(self, channels: Iterable[int]) -> int | None:
        """Return the number of messages of some channels, None if it is unknown."""
        counts = self._counts
        return None if counts is None else sum(counts.get(number, 0) for number in channels)

    def _list_topics(self) -> None:
        groups: dict[tuple[str, str, str], list[int]] = {}
        for number, channel in self._channels.items():
            key = channel.topic, channel.type_name, channel.encoding
            groups.setdefault(key, []).append(number)
        listed: set[str] = set()
        serializations: dict[str, Serialization] = {'cdr': 'cdr', 'ros1': 'ros1'}
        for (topic, kind, encoding), numbers in groups.items():
            serialization = serializations.get(encoding)
            if serialization is None or not kind:
                self.other_topics[topic] = (f'{kind} encoded as {encoding}' if kind in IMU_TYPES
                                            else kind or 'no type')
            elif topic not in listed and self.list_topic(
                    topic, kind, serialization, self._count(numbers),
                    self._channels[numbers[0]].definition):
                listed.add(topic)

    def _note_lost(self, reading: 'Reading', at: int, end: int, in_chunk: bool) -> None:
        """Note that what is between two places, up to a chunk or the end, is not a record."""
        left = end - at
        reading.lost_bytes += left
        if end < self.size_bytes:
            reading.note_damage(at, f'{left} bytes are no records')
        elif left == 0:
            reading.end = _UNWRITTEN
        elif in_chunk:
            reading.end = f'the chunk at byte {at}, of which {left} bytes are there, is lost'
        else:
            reading.end = f'{left} bytes from byte {at} on are not whole records and are lost'


@dataclass
class Reading:
    """One reading of a file: the channels wanted, and the damage found so far."""

    file: BinaryIO
    limits: ReadingLimits
    wanted: AbstractSet[int] = frozenset()
    chunks: int = 0
    broken_chunks: int = 0
    damaged: int = 0
    first_damage: str = ''
    end: str = ''
    lost_bytes: int = 0

    def note_damage(self, at: int, reason: str) -> None:
        """Note a place that is passed over."""
        self.damaged += 1
        self.first_damage = self.first_damage or f'at byte {at}: {printable(reason)}'

    def report(self, recording: Recording, topic: str, lost: int, expected: int) -> None:
        """Add remarks to `recording`; `lost` of `expected` messages could not be read."""
        messages: dict[str, Any] = (
            {'lost': lost, 'of': expected, 'topic': printable(topic)} if lost > 0 else {})
        of_bytes = self.lost_bytes / recording.size_bytes
        share = max(lost / max(expected, 1), self.broken_chunks / max(self.chunks, 1),
                    0.0 if self.end else of_bytes)
        if self.end:
            recording.remark('truncated_recording', fault='ends', end=self.end,
                             whole_chunks=self.chunks, lost_share=of_bytes)
        if self.damaged:
            recording.remark(
                'damaged_recording', fault='places', places=self.damaged, first=self.first_damage,
                lost_share=share, **messages)
        elif messages and not self.end:
            recording.remark('damaged_recording', fault='unread', lost_share=share, **messages)


def in_lists(batches: Iterable[MessageBatch]) -> Iterator[list[MessageBatch]]:
    """Group batches into lists of 16 MiB, as there may be millions of batches."""
    held: list[MessageBatch] = []
    # 20 chunks of rosbag2, as one chunk may be far larger
    batch_bytes = 1 << 24
    left = batch_bytes
    for batch in batches:
        held.append(batch)
        # Allow 1 kB for the overhead of a batch.
        left -= batch.rows.nbytes + 1024
        if left < 0:
            yield held
            held, left = [], batch_bytes
    yield held
