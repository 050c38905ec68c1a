# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The account of what could not be read of a file made of chunks."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from imu_allan.errors import printable
from imu_allan.recordings.recording import Recording
from imu_allan.recordings.topic_readings import NO_CHUNK, TopicReading, TopicReadings
from imu_allan.wording import counted

Carried = Mapping[int, Sequence[TopicReading]]
"""Those that want the messages of a channel, by its number."""
_UNWRITTEN = 'what was not yet written is missing'


@dataclass
class Part:
    """
    A chunk, or a stretch of records outside of chunks.

    Attributes
    ----------
    start, length : int
        Place of its body in the file.
    is_chunk : bool
        Which of the two.
    counts : dict of int to int
        Messages by channel, as the index behind a chunk tells; empty without an index.
    indexes : list of (int, int)
        Place and length of the entries of each index behind a chunk.

    """

    start: int
    length: int
    is_chunk: bool
    counts: dict[int, int] = field(default_factory=dict)
    indexes: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class Damage:
    """What was found wrong in one reading of a file."""

    chunks: int = 0
    broken_chunks: int = 0
    first_broken: str = ''
    holes: int = 0
    first_hole: str = ''
    end: str = ''
    first_place: int = NO_CHUNK[0]

    def chunk(self, at: int, reason: str) -> None:
        """Note a whole chunk whose content is damaged."""
        self.broken_chunks += 1
        self.first_broken = self.first_broken or f'at byte {at}: {printable(reason)}'

    def chunk_for(self, carried: Carried, part: Part, reason: str) -> None:
        """Note it for the topics of which it holds messages; for all where it may be any."""
        if not part.counts:
            self.chunk(part.start, reason)
            self.first_place = min(self.first_place, part.start)
        for reading in {reading for number in part.counts for reading in carried.get(number, ())}:
            reading.broken_chunks += 1
            reading.first_broken = min(reading.first_broken, (
                part.start, f'at byte {part.start}: {printable(reason)}'))

    def hole(self, at: int, length: int) -> None:
        """Note bytes between chunks that are no records."""
        self.holes += 1
        self.first_hole = self.first_hole or f'{length} bytes from byte {at} on'

    def ending(self, at: int, left: int, in_chunk: bool) -> None:
        """Note where the file breaks off."""
        if left == 0:
            self.end = _UNWRITTEN
        elif in_chunk:
            self.end = f'the chunk at byte {at}, of which {left} bytes are there, is lost'
        else:
            self.end = f'{left} bytes from byte {at} on are not whole records and are lost'

    def summary(self) -> str:
        """Tell what is wrong, in short; nothing where nothing is."""
        if self.broken_chunks:
            return self._broken()
        return self.first_hole if self.holes else self.end if self.end != _UNWRITTEN else ''

    def _broken(self) -> str:
        return (f'{counted(self.broken_chunks, "damaged chunk")} of {self.chunks} '
                f'(the first {self.first_broken})')

    def report(self, recording: Recording, topic: str, lost: int, expected: int) -> None:
        """Add remarks to `recording`; `lost` of `expected` messages were not read."""
        messages: dict[str, Any] = (
            {'lost': lost, 'of': expected, 'topic': printable(topic)} if lost > 0 else {})
        if self.end:
            recording.remark(
                'truncated_recording', fault='ends', end=self.end, whole_chunks=self.chunks)
        if self.broken_chunks:
            recording.remark(
                'damaged_recording', fault='chunks', broken=self.broken_chunks,
                chunks=self.chunks, first=self.first_broken, **messages)
        elif self.holes:
            recording.remark(
                'damaged_recording', fault='holes', holes=self.holes, first=self.first_hole,
                **messages)
        elif messages and not self.end:
            recording.remark('damaged_recording', fault='unread', **messages)

    def report_each(self, recording: Recording, readings: TopicReadings, carried: Carried,
                    counts: Mapping[int, int]) -> None:
        """Tell each of several topics what its own reading would have; `counts` by channel."""
        expected: Counter[str] = Counter()
        for number, found in carried.items():
            for reading in found:
                expected[reading.imu.name] += counts.get(number, 0)
        readings.decode()
        for reading in readings.present:
            name = reading.imu.name
            with recording.remarks_apart() as own:
                reading.malformed.report(reading.imu, recording.remark)
                _, first = min((self.first_place, self.first_broken), reading.first_broken)
                replace(self, broken_chunks=self.broken_chunks + reading.broken_chunks,
                        first_broken=first).report(
                    recording, name, expected[name] - reading.messages
                    - reading.malformed.count, expected[name])
            readings.tell(own, reading)
