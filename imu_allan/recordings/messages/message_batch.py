# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Serialized messages of one topic, as the containers hand them to the decoders."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class MessageBatch:
    """
    Messages of equal size, in the order of the file.

    Attributes
    ----------
    rows : ndarray of uint8, shape (n, size)
        Serialized messages; may be a view of a buffer.
    receive_ns : ndarray of int64, shape (n,)
        Receive stamps of the messages in nanoseconds.
    numbers : ndarray of int64, shape (n,), optional
        Numbers of the messages, where the file has room for them.

    """

    rows: NDArray[np.uint8]
    receive_ns: NDArray[np.int64]
    numbers: NDArray[np.int64] | None = None


class MessageNumbers:
    """The numbers that a writer may give the messages of one channel: those missing were lost."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._steps = self._ones = self._back = self._skipped = 0

    def seen(self, batches: Iterable[MessageBatch]) -> Iterator[MessageBatch]:
        """Hand batches on."""
        for batch in batches:
            if batch.numbers is not None:
                before = batch.numbers[:1] if self._last is None else [self._last]
                step = np.diff(batch.numbers, prepend=before)[self._last is None:]
                self._steps += len(step)
                self._ones += int(np.count_nonzero(step == 1))
                self._back += int(np.count_nonzero(step <= 0))
                self._skipped += int(np.maximum(step - 1, 0).sum())
                self._last = int(batch.numbers[-1])
            yield batch

    def lost(self, others: int) -> int:
        """Count the lost, beside so many messages of other channels; 0 where none is numbered."""
        # Most writers leave zeros. Some count the messages of all channels in one.
        numbered = 3 * self._ones >= self._steps and 1000 * self._back <= self._steps
        of_all = others and abs(self._skipped - others) <= 1 + 0.02 * others
        return self._skipped if numbered and not of_all else 0
