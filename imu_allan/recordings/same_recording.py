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

_HEAD = 64
"""Messages from the beginning that are kept, so that short recordings are compared, too."""
_ONE_OF_BITS = 10
"""One message of 2^10 is kept besides: 5 MB of 100 million."""
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
        self._seen = 0
        self._stamps: list[NDArray[np.int64]] = []
        self._samples: list[NDArray[np.float64]] = []

    def watch(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Hand on blocks and keep what is needed of them."""
        for block in blocks:
            # A driver that stamps nothing leaves what the recorder knows.
            stamps = np.where(block.header_ns > 0, block.header_ns, block.receive_ns)
            chosen = stamps.astype(np.uint64) * _SPREAD >> np.uint64(64 - _ONE_OF_BITS) == 0
            chosen[:max(0, _HEAD - self._seen)] = True
            self._stamps.append(stamps[chosen])
            self._samples.append(block.samples[chosen])
            self._seen += len(block)
            yield block

    def shares_messages_with(self, other: 'Fingerprint') -> bool:
        """Whether both hold the same values wherever both have a message of the same time."""
        if not (self._seen and other._seen):
            return False
        _, here, there = np.intersect1d(
            np.concatenate(self._stamps), np.concatenate(other._stamps), return_indices=True)
        enough = min(_FEWEST, self._seen, other._seen)
        return len(here) >= enough and np.array_equal(
            np.concatenate(self._samples)[here], np.concatenate(other._samples)[there],
            equal_nan=True)
