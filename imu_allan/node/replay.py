# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A recording that is played over and over, as ``ros2 bag play --loop`` does.

The second time nothing is new: the same samples twice would make intervals narrower than the data
allow.
"""

from collections.abc import Sequence

from imu_allan.block import ImuBlock
import numpy as np

_MARKS = 8
"""Samples that are remembered from the start: the first of a repetition may get lost."""
_SHORTEST_NS = 1_000_000_000
"""A recording is longer; stamps that stand still are another fault."""


class LoopWatch:
    """Passes on what has not been seen before."""

    def __init__(self) -> None:
        self._stamps = np.empty(0, np.int64)
        self._samples = np.empty((0, 6))
        self._last_ns = 0
        self.looping = False
        """Whether the samples that come now have come before."""

    def unseen(self, blocks: Sequence[ImuBlock]) -> list[ImuBlock]:
        """Give the samples of these blocks that are no repetition."""
        passed = []
        for block in blocks:
            if len(self._stamps) < _MARKS:
                self._stamps = np.append(self._stamps, block.header_ns)[:_MARKS]
                self._samples = np.concatenate([self._samples, block.samples])[:_MARKS]
            if self.looping or self._begins_again(block):
                new = block.header_ns > self._last_ns
                self.looping = not new.any()
                block = block.part(new)
            if len(block):
                self._last_ns = max(self._last_ns, int(block.header_ns.max()))
                passed.append(block)
        return passed

    def _begins_again(self, block: ImuBlock) -> bool:
        if self._last_ns - int(self._stamps[0]) < _SHORTEST_NS:
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
