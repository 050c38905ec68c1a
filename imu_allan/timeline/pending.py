# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that wait until enough of them have come to be worked off together."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from imu_allan.block import ImuBlock
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


class Pending:
    """Messages in the order they came, whatever blocks they came in."""

    def __init__(self) -> None:
        self._blocks: list[ImuBlock] = []
        # Beside the blocks: asking each for its length again costs more than its messages.
        self._lengths: list[int] = []
        self._messages = 0

    def __len__(self) -> int:
        """Messages that wait."""
        return self._messages

    def append(self, block: ImuBlock) -> None:
        """Let the messages of a block wait behind the others."""
        n = len(block)
        self._blocks.append(block)
        self._lengths.append(n)
        self._messages += n

    def copy(self) -> 'Pending':
        """Give an independent copy; arrays are shared, for they are never written to."""
        twin = Pending()
        twin._blocks, twin._lengths = list(self._blocks), list(self._lengths)
        twin._messages = self._messages
        return twin

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Messages that wait, as a flat dict of arrays."""
        window = self.look(len(self))
        numbers = {} if window.numbers is None else {'numbers': window.numbers}
        return {'header_ns': window.header, 'receive_ns': window.receive,
                'samples': window.samples, 'absent': window.absent, **numbers}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]], frame_id: str) -> 'Pending':
        """Go on from `to_state`; KeyError, TypeError or ValueError if it is damaged."""
        pending = cls()
        samples = np.asarray(state['samples'], dtype=np.float64).reshape(-1, 6)
        n = len(samples)
        if n:
            pending.append(ImuBlock(
                np.asarray(state['header_ns'], dtype=np.int64).reshape(n),
                np.asarray(state['receive_ns'], dtype=np.int64).reshape(n),
                samples, np.asarray(state['absent'], dtype=bool).reshape(n, 2), frame_id,
                np.asarray(state['numbers'], dtype=np.int64).reshape(n) if 'numbers' in state
                else None))
        return pending

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
