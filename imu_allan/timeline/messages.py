# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages as the stages of a timeline pass them on: first pending, then usable."""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Bools
from imu_allan.block import ImuBlock, joined
from imu_allan.state import Record
from imu_allan.timeline.stamps import Stamps
import numpy as np


@dataclass(frozen=True)
class Window(ImuBlock):
    """Raw messages: the first `consumed` are processed now, the rest again in the next window."""

    consumed: int = 0


@dataclass
class Pending(Record):
    """Messages in order of arrival, held until there are enough to process."""

    blocks: list[ImuBlock] = field(default_factory=list)
    # A running count, as asking each block for its length costs more than its messages do.
    messages: int = 0

    def append(self, block: ImuBlock) -> None:
        """Append the messages of a block."""
        self.blocks.append(block)
        self.messages += len(block)

    def join(self) -> None:
        """Join all messages into one block."""
        if len(self.blocks) > 1:
            self.blocks = [joined(self.blocks)]

    def take(self, n: int, consumed: int) -> Window:
        """Return the first `n` messages and discard the first `consumed` of them."""
        # An error, as of messages without any axis, may leave more than one window.
        later, beyond = [], self.messages - n
        while beyond >= len(self.blocks[-1]):
            later.append(self.blocks.pop())
            beyond -= len(later[-1])
        last = self.blocks.pop()
        first = joined([*self.blocks, last.part(slice(len(last) - beyond))])
        self.messages -= consumed
        self.blocks = [block for block in (
            first.part(slice(consumed, None)), last.part(slice(len(last) - beyond, None)),
            *reversed(later)) if len(block)]
        return Window(**vars(first), consumed=consumed)


@dataclass(frozen=True)
class Messages:
    """Messages to be placed on the grid."""

    # Stamps of the clock in use, and of the other clock, shape (n,).
    stamps: Stamps
    other: Stamps
    samples: Array  # NaN only where an axis is absent, shape (n, 6)
    consumed: int  # number of leading messages to place; the others only show what follows
    # Messages with unusable values: they have a grid place, which stays empty, shape (n,).
    void: Bools

    def pick(self, rows: slice | Bools) -> 'Messages':
        """Return the selected messages; those to be placed remain so."""
        consumed = int(np.count_nonzero(rows[:self.consumed]) if isinstance(rows, np.ndarray)
                       else len(self.stamps[:self.consumed][rows]))
        return Messages(self.stamps[rows], self.other[rows], self.samples[rows], consumed,
                        self.void[rows])
