# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a timeline hand on: usable messages, then even pieces."""

from dataclasses import dataclass

from imu_allan.block import EvenBlock
from imu_allan.timeline.clock import Stamps
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NONE_BRIDGED: Ints = np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Messages:
    """
    Messages that are to find their places.

    Attributes
    ----------
    stamps, other : ndarray of int64, shape (n,)
        Stamps of the clock in use, and of the other one.
    samples : ndarray of float64, shape (n, 6)
        NaN only in columns of absent axes.
    consumed : int
        The first so many are to be placed; the others only show what comes next.
    void : ndarray of bool, shape (n,), or None
        Those whose values are unusable: they have a place, which stays empty.

    """

    stamps: Stamps
    other: Stamps
    samples: Floats
    consumed: int
    void: Bools | None = None

    def pick(self, rows: slice | Bools, consumed: int) -> 'Messages':
        """Give some of the messages, `consumed` of them to be placed."""
        return Messages(self.stamps[rows], self.other[rows], self.samples[rows], consumed,
                        None if self.void is None else self.void[rows])

    def part(self, first: int, last: int, look_ahead: bool) -> 'Messages':
        """Give messages `first` up to `last`, and where wanted what comes next."""
        end = len(self.stamps) if look_ahead else last
        return self.pick(slice(first, end), last - first)


@dataclass(frozen=True)
class EvenPiece:
    """
    Even samples without a gap between them.

    Attributes
    ----------
    samples : ndarray of float64, shape (n, 6)
        NaN only in columns of absent axes.
    first_index : int
        Place of the first row on the grid.
    start_s : float
        Its time since the first sample.
    new_run : bool
        As in `EvenBlock`.
    bridged : ndarray of int64, shape (b,)
        Rising grid places whose row stands in for a missing sample.

    """

    samples: Floats
    first_index: int
    start_s: float
    new_run: bool
    bridged: Ints

    def block(self) -> EvenBlock:
        """Give all rows."""
        return EvenBlock(self.samples, self.first_index, len(self.bridged), self.new_run,
                         start_s=self.start_s)
