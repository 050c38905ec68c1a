# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that wait until enough of them have come to be worked off together."""

from dataclasses import dataclass, field, replace

from imu_allan.block import ImuBlock
from imu_allan.state import Record
import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Window:
    """
    Messages as they came; the first `consumed` of them are to be worked off.

    Attributes
    ----------
    header, receive : ndarray of int64, shape (n,)
        Stamps in nanoseconds.
    samples : ndarray of float64, shape (n, 6)
        As in `ImuBlock`; in memory axis after axis, which numpy goes through fastest.
    absent : ndarray of bool, shape (n, 2)
        As in `ImuBlock`.
    consumed : int
        The others are seen again in the next window.
    numbers : ndarray of int64, shape (n,), or None
        As in `ImuBlock`; None where those of some messages are not known.

    """

    header: Ints
    receive: Ints
    samples: NDArray[np.float64]
    absent: NDArray[np.bool_]
    consumed: int
    numbers: Ints | None = None


@dataclass
class Pending(Record):
    """Messages in the order they came, whatever blocks they came in."""

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

    def joined(self, frame_id: str) -> list[ImuBlock]:
        """Give all messages in one block, if there are any."""
        window = self.look(len(self))
        return [ImuBlock(window.header, window.receive, window.samples, window.absent, frame_id,
                         window.numbers)] if len(self) else []

    def look(self, n: int) -> Window:
        """Give the first `n` messages; they go on waiting."""
        whole = have = 0
        while have < n and have + self._lengths[whole] <= n:
            have += self._lengths[whole]
            whole += 1
        blocks = self._blocks[:whole]
        if have < n:
            # The last block may be far larger than what is still needed of it.
            blocks.append(self._blocks[whole].part(slice(n - have)))
        if len(blocks) == 1:
            block, samples = blocks[0], blocks[0].samples
            if samples.strides[0] != samples.itemsize:
                samples = np.asfortranarray(samples)
            return Window(block.header_ns, block.receive_ns, samples, block.absent, n,
                          block.numbers)
        if not blocks:
            return Window(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 6)),
                          np.empty((0, 2), bool), n)
        numbers = [block.numbers for block in blocks if block.numbers is not None]
        samples = np.empty((6, n)).T
        return Window(np.concatenate([block.header_ns for block in blocks]),
                      np.concatenate([block.receive_ns for block in blocks]),
                      np.concatenate([block.samples for block in blocks], out=samples),
                      np.concatenate([block.absent for block in blocks]), n,
                      np.concatenate(numbers) if len(numbers) == len(blocks) else None)

    def take(self, n: int, consumed: int) -> Window:
        """Give the first `n` messages and let go of `consumed` of them."""
        window = self.look(n)
        left, whole = consumed, 0
        while left and self._lengths[whole] <= left:
            left -= self._lengths[whole]
            whole += 1
        del self._blocks[:whole], self._lengths[:whole]
        if left:
            self._blocks[0] = self._blocks[0].part(slice(left, None))
            self._lengths[0] -= left
        self._messages -= consumed
        return replace(window, consumed=consumed)
