# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection of messages that come twice, in one recording or in several.

The same data given twice would count as new data and make the intervals too narrow.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
import hashlib
from itertools import pairwise
from pathlib import Path
from stat import S_ISDIR

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import ImuBlock
from imu_allan.finding import Finding, finding
from imu_allan.state import Record
import numpy as np
from numpy.typing import NDArray

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


class Fingerprint:
    """
    A sample of a recording's messages, chosen by stamp so that a copy yields the same ones.

    Attributes
    ----------
    kept : int
        Number of messages kept.

    Examples
    --------
    >>> block = ImuBlock(np.arange(1, 100), np.arange(1, 100), np.random.rand(99, 6),
    ...                  np.zeros((99, 2), dtype=bool), 'imu')
    >>> one, copy = Fingerprint(), Fingerprint()
    >>> _ = list(one.watch([block])), list(copy.watch([block]))
    >>> one.shares_messages_with(copy)
    True

    """

    def __init__(self) -> None:
        self.kept = 0
        self._bits = 0
        self._stamps: list[Ints] = []
        self._samples: list[Array] = []

    def watch(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Pass blocks through and keep the chosen messages."""
        for block in blocks:
            # If the driver sets no stamps, use the receive stamps of the recorder.
            stamps = np.where(block.header_ns > 0, block.header_ns, block.receive_ns)
            # Limit the memory to 15 MB: equal stamps are all kept or all dropped.
            if self.kept < 1 << 18:
                chosen = is_kept(stamps, self._bits)
                self._stamps.append(stamps[chosen])
                self._samples.append(block.samples[chosen])
                self.kept += len(self._stamps[-1])
            # Keep at least one message in 2^10: 5 MB for 100 million messages. Of an hour at
            # 200 Hz one in 32 is kept, which reveals a common part of 1.3 s.
            while self.kept > 1 << 15 and self._bits < 10:
                self._thin()
            yield block

    def _thin(self) -> None:
        """Drop about half of the kept messages."""
        self._bits += 1
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        chosen = is_kept(stamps, self._bits)
        self._stamps, self._samples = [stamps[chosen]], [samples[chosen]]
        self.kept = len(self._stamps[0])

    def shares_messages_with(self, other: 'Fingerprint') -> bool:
        """Return whether nearly all messages at common stamps have equal values."""
        if not (self.kept and other.kept):
            return False
        times, mine = self._rows()
        other_times, others = other._rows()
        both = np.intersect1d(times, other_times)
        mine, others = mine[np.isin(times, both)], others[np.isin(other_times, both)]
        common = int(np.count_nonzero(np.isin(mine, others)))
        # A part may begin within messages of one stamp, or have lost some. With coarse
        # resolution, single values can coincide.
        return (common >= min(8, self.kept, other.kept)
                and common >= 0.9 * min(len(mine), len(others)))

    def _rows(self) -> tuple[Ints, NDArray[np.void]]:
        """Return stamps and (stamp, sample) rows, without stamps of more than 8 messages."""
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        _, which, count = np.unique(stamps, return_inverse=True, return_counts=True)
        # Where many messages share one stamp, coarse values coincide by chance.
        few = count[which] <= 8
        stamps, samples = stamps[few], samples[few]
        rows = np.column_stack((stamps, (samples + 0.0).view(np.int64)))
        return stamps, rows.view(f'V{rows.strides[0]}')[:, 0]


def is_kept(stamps: Ints, bits: int) -> Bools:
    """Choose one message in 2^bits by stamp; more bits choose a subset of what fewer choose."""
    if bits == 0:
        return np.ones(len(stamps), np.bool_)
    # One product leaves out thousands of stamps in a row at some regular steps; two mix them all
    # (Stafford's variant 13 of the mixer of MurmurHash3).
    mixed = stamps.astype(np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ mixed >> np.uint64(shift)) * np.uint64(factor)
    kept: Bools = mixed >> np.uint64(64 - bits) == 0
    return kept


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
        if len(self.stamps) and block.header_ns[0] < self.stamps[0]:
            self.stamps = np.concatenate((block.header_ns[:first], self.stamps))
            self.samples = np.concatenate((block.samples[:first], self.samples))
        else:
            rows = np.arange(-self.count % self.every, len(block), self.every)
            rows = rows[block.header_ns[rows] > self.last_ns]
            self.stamps = np.concatenate((self.stamps, block.header_ns[rows]))
            self.samples = np.concatenate((self.samples, block.samples[rows]))
        self.count += len(block)
        while len(self.stamps) > _MOST:
            self.every *= 2
            self.stamps = np.concatenate((self.stamps[:first], self.stamps[first::2]))
            self.samples = np.concatenate((self.samples[:first], self.samples[first::2]))

    def _begins_again(self, block: ImuBlock) -> int | None:
        """Return the row of the first sample if earlier ones are repeated, or None."""
        back = block.header_ns <= self.last_ns - _SHORTEST_NS
        if not back.any():
            return None
        rows = np.flatnonzero(back & np.isin(block.header_ns, self.stamps)).tolist()
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
