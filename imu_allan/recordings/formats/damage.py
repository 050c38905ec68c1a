# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The account of what could not be read of a file made of chunks."""

from dataclasses import dataclass, field
from typing import Any

from imu_allan.errors import printable
from imu_allan.recordings.recording import Recording
from imu_allan.wording import counted

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

    def chunk(self, at: int, reason: str) -> None:
        """Note a whole chunk whose content is damaged."""
        self.broken_chunks += 1
        self.first_broken = self.first_broken or f'at byte {at}: {printable(reason)}'

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
