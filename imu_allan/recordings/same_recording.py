# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether two recordings hold the same messages, as a copy, another container or a part of it does.

Given twice, the same data would count as new: intervals become narrower than they are.
"""

from collections.abc import Iterable, Iterator
import hashlib
from pathlib import Path
from stat import S_ISDIR

from imu_allan.block import ImuBlock
import numpy as np
from numpy.typing import NDArray

_MOST = 1 << 15
"""Messages that are kept before only half of them are, 1.8 MB: of an hour at 200 Hz one in 32, so
that 1.3 s in common are seen."""
_FEWEST = 8
"""Messages in common from which on it is no chance: coarse steps make one value come again."""


def files_digest(path: str | Path) -> str | None:
    """
    Return 16 hexadecimal digits that another recording under the same name does not have.

    Of names, sizes and times of change: a copy that keeps the times has the same. None where the
    files cannot be looked at; whoever opens the recording says why.

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
    Some of the messages of a recording, chosen by their stamps: of a copy they are the same.

    Attributes
    ----------
    kept : int
        How many.

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
        """Hand on blocks and keep what is needed of them."""
        for block in blocks:
            # A driver that stamps nothing leaves what the recorder knows.
            stamps = np.where(block.header_ns > 0, block.header_ns, block.receive_ns)
            # At most 15 MB: stamps that are all equal are chosen all or none.
            if self.kept < 1 << 18:
                chosen = is_kept(stamps, self._bits)
                self._stamps.append(stamps[chosen])
                self._samples.append(block.samples[chosen])
                self.kept += len(self._stamps[-1])
            # One message of 2^10 is kept at least: 5 MB of 100 million.
            while self.kept > _MOST and self._bits < 10:
                self._thin()
            yield block

    def _thin(self) -> None:
        """Keep half as many."""
        self._bits += 1
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        chosen = is_kept(stamps, self._bits)
        self._stamps, self._samples = [stamps[chosen]], [samples[chosen]]
        self.kept = len(self._stamps[0])

    def shares_messages_with(self, other: 'Fingerprint') -> bool:
        """Whether both hold the same values at nearly all times that both have."""
        if not (self.kept and other.kept):
            return False
        times, mine = self._rows()
        other_times, others = other._rows()
        both = np.intersect1d(times, other_times)
        mine, others = mine[np.isin(times, both)], others[np.isin(other_times, both)]
        common = int(np.count_nonzero(np.isin(mine, others)))
        # A part may begin within a batch, or have lost some.
        return (common >= min(_FEWEST, self.kept, other.kept)
                and common >= 0.9 * min(len(mine), len(others)))

    def _rows(self) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        """Give times, without those that too many messages share, and times and values."""
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        _, which, count = np.unique(stamps, return_inverse=True, return_counts=True)
        # Among many messages of one time one of coarse values is found by chance.
        few = count[which] <= 8
        stamps, samples = stamps[few], samples[few]
        rows = np.column_stack((stamps, (samples + 0.0).view(np.int64)))
        return stamps, rows.view(f'V{rows.strides[0]}')[:, 0]


def is_kept(stamps: NDArray[np.int64], bits: int) -> NDArray[np.bool_]:
    """Choose one message of 2^bits by its stamp; those of more bits are among those of fewer."""
    if bits == 0:
        return np.ones(len(stamps), np.bool_)
    # 2^64 over the golden ratio (Knuth, volume 3, section 6.4): even stamps are spread evenly.
    spread = stamps.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    kept: NDArray[np.bool_] = spread >> np.uint64(64 - bits) == 0
    return kept
