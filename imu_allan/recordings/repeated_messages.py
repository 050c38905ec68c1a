# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection of messages that come twice, in one recording or in several.

The same data given twice would count as new data and make the intervals too narrow.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
import hashlib
from itertools import pairwise
from pathlib import Path
from stat import S_ISDIR

from imu_allan.arrays import Array, Ints
from imu_allan.block import ImuBlock
from imu_allan.finding import Finding, finding
from imu_allan.state import Record
from imu_allan.timeline.values import repeated
import numpy as np

_MOST = 2048
"""Samples remembered in total (110 kB), one in so many. If the start of a repetition is lost, one
of the next few samples is among them; after a day at 100 Hz, one of some thousands."""
_SHORTEST_NS = 1_000_000_000
"""Recordings are longer than this; stamps that stand still are another fault."""


def files_digest(path: str | Path) -> str | None:
    """
    Return 16 hexadecimal digits that tell a recording from another one of the same name.

    They are a hash of file names, sizes and modification times; a copy that keeps the times has
    the same digits. Returns None if the files cannot be accessed; opening the recording reports
    why.

    Examples
    --------
    >>> files_digest('no such file') is None
    True

    """
    start = Path(path)
    digest = hashlib.blake2b(digest_size=8)
    try:
        for file in sorted(start.iterdir()) if start.is_dir() else [start]:
            found = file.stat()
            if not S_ISDIR(found.st_mode):
                digest.update(f'{file.name}\0{found.st_size}\0{found.st_mtime_ns}\n'.encode(
                    errors='surrogateescape'))
    except OSError:
        return None
    return digest.hexdigest()


def sampled(blocks: Iterable[ImuBlock], kept: dict[int, bytes]) -> Iterator[ImuBlock]:
    """
    Pass blocks through and keep the first message of every ten seconds, by the number of these.

    The stamps decide, so that a copy yields the same messages.

    Examples
    --------
    >>> block = ImuBlock(np.arange(1, 100), np.arange(1, 100), np.random.rand(99, 6),
    ...                  np.zeros((99, 2), dtype=bool), 'imu')
    >>> one, copy = {}, {}
    >>> _ = list(sampled([block], one)), list(sampled([block], copy))
    >>> share_messages(one, copy)
    True

    """
    for block in blocks:
        # If the driver sets no stamps, use the receive stamps of the recorder.
        stamps = np.where(block.header_ns > 0, block.header_ns, block.receive_ns)
        tens = stamps // 10_000_000_000
        for row in np.flatnonzero(np.diff(tens, prepend=-1)).tolist():
            # A month has this many; stamps that leap have more.
            if len(kept) < 1 << 18:
                message = stamps[row].tobytes() + block.samples[row].tobytes()
                kept.setdefault(int(tens[row]), message)
        yield block


def share_messages(one: Mapping[int, bytes], other: Mapping[int, bytes]) -> bool:
    """Return whether nearly all messages kept of the same ten seconds are equal."""
    common = one.keys() & other.keys()
    equal = sum(one[number] == other[number] for number in common)
    # A part may begin within ten seconds. With coarse resolution, single values can coincide.
    return equal > 0 and equal >= 0.9 * (len(common) - 1)


@dataclass
class Seen(Record):
    """
    Earlier samples, remembered so that what is played or written again counts once.

    Counting samples twice would make intervals narrower than the data allow.
    """

    stamps: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    samples: Array = field(default_factory=lambda: np.empty((0, 6)))
    every: int = 1  # one sample in so many is remembered
    count: int = 0  # samples so far
    last_ns: int = 0

    def __post_init__(self) -> None:
        # Whether the current samples repeat earlier ones.
        self.looping = False
        self._repeated = 0

    @property
    def remarks(self) -> list[Finding]:
        """Return the finding that the user should know; its code is `repeated_part`."""
        return [finding('repeated_part', messages=self._repeated)] if self._repeated else []

    def unseen(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Yield the samples of these blocks that are not repetitions."""
        # A short recording that is played fast may start several times in one block.
        for block in (part for whole in blocks for part in _passes(whole)):
            again = 0 if self.looping else self._begins_again(block)
            if again is not None:
                new = block.header_ns > self.last_ns
                self.looping = not new.any()
                # If the node joined in the middle, the beginning of the recording is new once.
                new[:again] = True
                self._repeated += int(np.count_nonzero(~new))
                block = block.part(new)
            if len(block):
                self._remember(block)
                self.last_ns = max(self.last_ns, int(block.header_ns.max()))
                yield block

    def _remember(self, block: ImuBlock) -> None:
        first = 8   # remembered from the start, so that a repetition is recognized at once
        # If the node joined in the middle, the beginning of the recording comes later.
        begins = len(self.stamps) > 0 and block.header_ns[0] < self.stamps[0]
        head = slice(first if begins else 0)
        # The player may be started anew at any place.
        rows = slice(-self.count % self.every, None, self.every)
        self.stamps = np.concatenate((block.header_ns[head], self.stamps, block.header_ns[rows]))
        self.samples = np.concatenate((block.samples[head], self.samples, block.samples[rows]))
        self.count += len(block)
        while len(self.stamps) > _MOST:
            self.every *= 2
            kept = np.r_[:first, first:len(self.stamps):2]
            self.stamps, self.samples = self.stamps[kept], self.samples[kept]

    def _begins_again(self, block: ImuBlock) -> int | None:
        """Return the row of the first sample if earlier ones are repeated, or None."""
        back = block.header_ns <= self.last_ns - _SHORTEST_NS
        if not back.any():
            return None
        # What a driver repeats before its sensor measures, such as zeros, tells nothing.
        compared = back & np.isin(block.header_ns, self.stamps)
        compared[:-1] &= ~repeated(block.samples)
        rows = np.flatnonzero(compared).tolist()
        # Absent axes are NaN, which have to compare as equal.
        same = [row for row in rows if any(
            np.array_equal(sample, block.samples[row], equal_nan=True)
            for sample in self.samples[self.stamps == block.header_ns[row]])]
        # A device that counts from its start has equal stamps again, where coarse values coincide.
        return same[0] if same and len(same) > 0.9 * len(rows) else None


def _passes(block: ImuBlock) -> Iterator[ImuBlock]:
    """Split messages where their stamps fall back by at least the length of a recording."""
    stamps = block.header_ns
    falls = np.flatnonzero(stamps[1:] - stamps[:-1] < -_SHORTEST_NS) + 1
    if len(falls) > 1 + len(block) // 16:
        # Too often for a recording: the stamps of two clocks alternate.
        falls = falls[:0]
    for first, last in pairwise([0, *falls.tolist(), len(block)]):
        yield block.part(slice(first, last))
