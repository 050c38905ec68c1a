# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a timeline hand on: messages that wait, then those that are usable."""

from dataclasses import dataclass, field

from imu_allan.block import ImuBlock
from imu_allan.state import Record
from imu_allan.timeline.clock import Bools, Floats, Ints, Stamps
import numpy as np
from numpy.typing import NDArray

NONE_VOID: Bools = np.empty(0, dtype=bool)


@dataclass(frozen=True)
class Window(ImuBlock):
    """Messages as they came; the first `consumed` are worked off now, the others seen again."""

    consumed: int = 0


@dataclass
class Pending(Record):
    """Messages that wait, in the order they came, until enough are there to be worked off."""

    blocks: list[ImuBlock] = field(default_factory=list)
    # Counted once: asking each block for its length again costs more than its messages.
    messages: int = 0

    def check(self) -> None:
        """Refuse messages whose parts are not as many."""
        for block in self.blocks:
            n = len(block)
            if (block.header_ns.shape, block.receive_ns.shape, block.samples.shape,
                    block.absent.shape) != ((n,), (n,), (n, 6), (n, 2)) or (
                    block.numbers is not None and block.numbers.shape != (n,)):
                raise ValueError('messages are missing')
        if self.messages != sum(map(len, self.blocks)):
            raise ValueError('messages are missing')

    def append(self, block: ImuBlock) -> None:
        """Let the messages of a block wait behind the others."""
        self.blocks.append(block)
        self.messages += len(block)

    def join(self) -> None:
        """Put all messages in one block, if there are any; axis after axis numpy is faster."""
        if len(self.blocks) > 1:
            blocks = self.blocks
            numbers = [block.numbers for block in blocks if block.numbers is not None]
            self.blocks = [ImuBlock(
                np.concatenate([block.header_ns for block in blocks]),
                np.concatenate([block.receive_ns for block in blocks]),
                np.concatenate([block.samples for block in blocks],
                               out=np.empty((6, self.messages)).T),
                np.concatenate([block.absent for block in blocks]), blocks[0].frame_id,
                np.concatenate(numbers) if len(numbers) == len(blocks) else None)]

    def take(self, n: int, consumed: int) -> Window:
        """Give the first `n` messages and let go of `consumed` of them."""
        self.join()
        [block] = self.blocks
        first = block.part(slice(n))
        self.messages -= consumed
        self.blocks = [block.part(slice(consumed, None))] if self.messages else []
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
