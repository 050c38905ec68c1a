# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The account of what could not be read of a file made of chunks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from imu_allan.errors import printable
from imu_allan.recordings.recording import Recording
from imu_allan.recordings.topic_readings import NO_CHUNK, TopicReading, TopicReadings

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

    def chunk_of(self, readings: Iterable[TopicReading] | None, at: int, reason: str) -> None:
        """Note it of the topics that it holds messages of; None where it may be any."""
        if readings is None:
            self.chunk(at, reason)
            self.first_place = min(self.first_place, at)
            return
        for reading in readings:
            reading.broken_chunks += 1
            reading.first_broken = min(
                reading.first_broken, (at, f'at byte {at}: {printable(reason)}'))

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
            return (f'{self.broken_chunks} of {self.chunks} chunks are damaged '
                    f'(the first {self.first_broken})')
        return self.first_hole if self.holes else self.end if self.end != _UNWRITTEN else ''

    def report(self, recording: Recording, topic: str, lost: int, expected: int) -> None:
        """Add remarks to `recording`; `lost` of `expected` messages were not read."""
        messages = (f'; {lost} of {expected} messages of {printable(topic)} are lost'
                    if lost > 0 else '')
        if self.end:
            recording.remark(
                'truncated_recording',
                f'the recording breaks off (was the recorder killed?): {self.end}; '
                f'{self.chunks} whole chunks were found')
        if self.broken_chunks:
            recording.remark(
                'damaged_recording',
                f'{self.broken_chunks} of {self.chunks} chunks are damaged and were left out '
                f'(the first {self.first_broken}){messages}')
        elif self.holes:
            recording.remark(
                'damaged_recording',
                f'{self.holes} stretches are not records and were left out '
                f'(the first: {self.first_hole}){messages}')
        elif messages and not self.end:
            recording.remark('damaged_recording', f'not all of it could be read{messages}')

    def report_each(self, recording: Recording, readings: TopicReadings,
                    expected: Mapping[str, int]) -> None:
        """Tell each of several topics what its own reading would have; `expected` by name."""
        readings.decode()
        for reading in readings.present:
            name = reading.imu.name
            with recording.remarks_apart() as own:
                reading.malformed.report(reading.imu, recording.remark)
                _, first = min((self.first_place, self.first_broken), reading.first_broken)
                replace(self, broken_chunks=self.broken_chunks + reading.broken_chunks,
                        first_broken=first).report(
                    recording, name, expected.get(name, 0) - reading.messages
                    - reading.malformed.count, expected.get(name, 0))
            readings.tell(own, reading)
