# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a timeline hand on: messages that wait, then those that are usable."""

from dataclasses import dataclass, field

from imu_allan.block import ImuBlock
from imu_allan.state import Record
from imu_allan.timeline.clock import Stamps
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NONE_VOID: Bools = np.empty(0, dtype=bool)


@dataclass(frozen=True)
class Window(ImuBlock):
    """Messages as they came; the first `consumed` are worked off now, the others seen again."""

    consumed: int = 0


@dataclass
class Pending(Record):
    """Messages that wait, in the order they came, until enough are there to be worked off."""

    _blocks: list[ImuBlock] = field(default_factory=list)
    # Beside the blocks: asking each for its length again costs more than its messages.
    _lengths: list[int] = field(default_factory=list)
    _messages: int = 0

    def __len__(self) -> int:
        """Messages that wait."""
        return self._messages

    def append(self, block: ImuBlock) -> None:
        """Let the messages of a block wait behind the others."""
        n = len(block)
        self._blocks.append(block)
        self._lengths.append(n)
        self._messages += n

    def joined(self) -> list[ImuBlock]:
        """Give all messages in one block, if there are any."""
        return [self._first(len(self))] if len(self) else []

    def _first(self, n: int) -> ImuBlock:
        """Give the first `n` messages, samples axis after axis: numpy goes through them faster."""
        whole = have = 0
        while have < n and have + self._lengths[whole] <= n:
            have += self._lengths[whole]
            whole += 1
        blocks = self._blocks[:whole]
        if have < n:
            # The last block may be far larger than what is still needed of it.
            blocks.append(self._blocks[whole].part(slice(n - have)))
        if len(blocks) == 1:
            return blocks[0]
        numbers = [block.numbers for block in blocks if block.numbers is not None]
        return ImuBlock(np.concatenate([block.header_ns for block in blocks]),
                        np.concatenate([block.receive_ns for block in blocks]),
                        np.concatenate([block.samples for block in blocks],
                                       out=np.empty((6, n)).T),
                        np.concatenate([block.absent for block in blocks]), blocks[0].frame_id,
                        np.concatenate(numbers) if len(numbers) == len(blocks) else None)

    def take(self, n: int, consumed: int) -> Window:
        """Give the first `n` messages and let go of `consumed` of them."""
        first = self._first(n)
        left, whole = consumed, 0
        while left and self._lengths[whole] <= left:
            left -= self._lengths[whole]
            whole += 1
        del self._blocks[:whole], self._lengths[:whole]
        if left:
            self._blocks[0] = self._blocks[0].part(slice(left, None))
            self._lengths[0] -= left
        self._messages -= consumed
        return Window(first.header_ns, first.receive_ns, np.asfortranarray(first.samples),
                      first.absent, first.frame_id, first.numbers, consumed)


@dataclass(frozen=True)
class Messages:
    """
    Messages that are to find their places.

    Attributes
    ----------
    stamps, other : ndarray of int64, shape (n,)
        Stamps of the clock in use, and of the other one.
    samples : ndarray of float64, shape (n, 6)
        NaN only where an axis is absent.
    consumed : int
        The first so many are to be placed; the others only show what comes next.
    void : ndarray of bool, shape (n,)
        Those whose values are unusable: they have a place, which stays empty.
    numbers : ndarray of int64, shape (n,), or None
        As in `ImuBlock`.

    """

    stamps: Stamps
    other: Stamps
    samples: Floats
    consumed: int
    void: Bools
    numbers: Ints | None = None

    def pick(self, rows: slice | Bools | NDArray[np.intp], consumed: int) -> 'Messages':
        """Give some of the messages, `consumed` of them to be placed."""
        return Messages(self.stamps[rows], self.other[rows], self.samples[rows], consumed,
                        self.void[rows],
                        None if self.numbers is None else self.numbers[rows])
