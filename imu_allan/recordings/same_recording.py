# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether two recordings hold the same messages, as a copy, another container or a part of it does.

Given twice, the same data would count as new: intervals become narrower than they are.
"""

from collections.abc import Iterable, Iterator

from imu_allan.block import ImuBlock
import numpy as np
from numpy.typing import NDArray

_MOST = 1 << 15
"""Messages that are kept before only half of them are, 1.8 MB: of an hour at 200 Hz one in 32, so
that 1.3 s in common are seen."""
_LEAST_BITS = 10
"""One message of 2^10 is kept at least: 5 MB of 100 million."""
_FEWEST = 8
"""Messages in common from which on it is no chance: coarse steps make one value come again."""
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio (Knuth, volume 3, section 6.4): even stamps are spread evenly."""


class Fingerprint:
    """
    Some of the messages of a recording, chosen by their stamps: of a copy they are the same.

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
        self._kept = 0
        self._bits = 0
        self._stamps: list[NDArray[np.int64]] = []
        self._samples: list[NDArray[np.float64]] = []

    def watch(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Hand on blocks and keep what is needed of them."""
        for block in blocks:
            # A driver that stamps nothing leaves what the recorder knows.
            stamps = np.where(block.header_ns > 0, block.header_ns, block.receive_ns)
            chosen = _is_kept(stamps, self._bits)
            self._stamps.append(stamps[chosen])
            self._samples.append(block.samples[chosen])
            self._kept += len(self._stamps[-1])
            while self._kept > _MOST and self._bits < _LEAST_BITS:
                self._thin()
            yield block

    def _thin(self) -> None:
        """Keep half as many."""
        self._bits += 1
        stamps, samples = np.concatenate(self._stamps), np.concatenate(self._samples)
        chosen = _is_kept(stamps, self._bits)
        self._stamps, self._samples = [stamps[chosen]], [samples[chosen]]
        self._kept = len(self._stamps[0])

    def shares_messages_with(self, other: 'Fingerprint') -> bool:
        """Whether both hold the same values wherever both have a message of the same time."""
        if not (self._kept and other._kept):
            return False
        _, here, there = np.intersect1d(
            np.concatenate(self._stamps), np.concatenate(other._stamps), return_indices=True)
        enough = min(_FEWEST, self._kept, other._kept)
        return len(here) >= enough and np.array_equal(
            np.concatenate(self._samples)[here], np.concatenate(other._samples)[there],
            equal_nan=True)


def _is_kept(stamps: NDArray[np.int64], bits: int) -> NDArray[np.bool_]:
    """Choose one message of 2^bits by its stamp; those of more bits are among those of fewer."""
    if bits == 0:
        return np.ones(len(stamps), np.bool_)
    kept: NDArray[np.bool_] = stamps.astype(np.uint64) * _SPREAD >> np.uint64(64 - bits) == 0
    return kept
