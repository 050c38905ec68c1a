# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection of recordings that hold the same messages: copies, conversions or parts of each other.

The same data given twice would count as new data and make the intervals too narrow.
"""

from collections.abc import Iterable, Iterator
import hashlib
from pathlib import Path
from stat import S_ISDIR

from imu_allan.block import ImuBlock
import numpy as np
from numpy.typing import NDArray


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
        self._stamps: list[NDArray[np.int64]] = []
        self._samples: list[NDArray[np.float64]] = []

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

    def _rows(self) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        """Return stamps and (stamp, sample) rows, without stamps of more than 8 messages."""
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        _, which, count = np.unique(stamps, return_inverse=True, return_counts=True)
        # Where many messages share one stamp, coarse values coincide by chance.
        few = count[which] <= 8
        stamps, samples = stamps[few], samples[few]
        rows = np.column_stack((stamps, (samples + 0.0).view(np.int64)))
        return stamps, rows.view(f'V{rows.strides[0]}')[:, 0]


def is_kept(stamps: NDArray[np.int64], bits: int) -> NDArray[np.bool_]:
    """Choose one message in 2^bits by stamp; more bits choose a subset of what fewer choose."""
    if bits == 0:
        return np.ones(len(stamps), np.bool_)
    # Multiply by 2^64 over the golden ratio (Knuth, volume 3, section 6.4) to spread regular
    # stamps evenly.
    spread = stamps.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    kept: NDArray[np.bool_] = spread >> np.uint64(64 - bits) == 0
    return kept
