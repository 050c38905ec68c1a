# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A recording that is played over and over, as ``ros2 bag play --loop`` does.

The second time nothing is new: the same samples twice would make intervals narrower than the data
allow.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.recordings.same_recording import is_kept
import numpy as np
from numpy.typing import NDArray

_FIRST = 8
"""Samples that are remembered from the start: a repetition is seen at once."""
_MOST = 2048
"""Samples that are remembered in all, 110 kB, chosen by their stamps: of a repetition whose start
got lost one of the next few is among them, a hundred of a day at 100 Hz thousands later."""
_SHORTEST_NS = 1_000_000_000
"""A recording is longer; stamps that stand still are another fault."""
_ARRAYS = ('stamps', 'samples', 'counts')


class LoopWatch:
    """Passes on what has not been seen before."""

    def __init__(self) -> None:
        self._stamps = np.empty(0, np.int64)
        self._samples = np.empty((0, 6))
        self._bits = 0
        self._last_ns = 0
        self.looping = False
        """Whether the samples that come now have come before."""

    def unseen(self, blocks: Sequence[ImuBlock]) -> list[ImuBlock]:
        """Give the samples of these blocks that are no repetition."""
        passed = []
        for block in blocks:
            if self.looping or self._begins_again(block):
                new = block.header_ns > self._last_ns
                self.looping = not new.any()
                block = block.part(new)
            if len(block):
                self._remember(block)
                self._last_ns = max(self._last_ns, int(block.header_ns.max()))
                passed.append(block)
        return passed

    def _remember(self, block: ImuBlock) -> None:
        fresh = block.header_ns > self._last_ns
        kept = fresh & is_kept(block.header_ns, self._bits)
        kept |= fresh & (np.cumsum(fresh) + len(self._stamps) <= _FIRST)
        if not kept.any():
            return
        self._stamps = np.append(self._stamps, block.header_ns[kept])
        self._samples = np.concatenate([self._samples, block.samples[kept]])
        while len(self._stamps) > _MOST:
            self._bits += 1
            kept = is_kept(self._stamps, self._bits)
            kept[:_FIRST] = True
            self._stamps, self._samples = self._stamps[kept], self._samples[kept]

    def _begins_again(self, block: ImuBlock) -> bool:
        if not len(self._stamps) or self._last_ns - int(self._stamps[0]) < _SHORTEST_NS:
            return False
        back = block.header_ns < self._last_ns
        if not back.any():
            return False
        for row in np.flatnonzero(back & np.isin(block.header_ns, self._stamps)):
            same = self._samples[self._stamps == block.header_ns[row]]
            # An axis that is absent is NaN, which equals nothing.
            if any(np.array_equal(sample, block.samples[row], equal_nan=True) for sample in same):
                return True
        return False

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Return what is remembered, as plain arrays."""
        return dict(zip(_ARRAYS, (self._stamps, self._samples,
                                  np.array([self._bits, self._last_ns])), strict=True))

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> 'LoopWatch':
        """
        Go on from `to_state`; from nothing as from the start.

        Raises
        ------
        ValueError
            If the arrays are none of it.

        """
        self = cls()
        if not state:
            return self
        stamps, samples, counts = (state.get(name, np.empty(0)) for name in _ARRAYS)
        if (stamps.dtype != np.int64 or counts.dtype != np.int64 or samples.dtype != np.float64
                or stamps.ndim != 1 or samples.shape != (len(stamps), 6) or counts.shape != (2,)
                or len(stamps) > _MOST or not 0 <= counts[0] < 64 or counts[1] < 0):
            raise ValueError('what is remembered of earlier samples is damaged')
        self._stamps, self._samples = stamps, samples
        self._bits, self._last_ns = counts.tolist()
        return self
