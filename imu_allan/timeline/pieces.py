# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a timeline hand on: usable messages, then even pieces."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

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
        NaN only where an axis is absent.
    consumed : int
        The first so many are to be placed; the others only show what comes next.
    void : ndarray of bool, shape (n,), or None
        Those whose values are unusable: they have a place, which stays empty.
    numbers : ndarray of int64, shape (n,), or None
        As in `ImuBlock`.

    """

    stamps: Stamps
    other: Stamps
    samples: Floats
    consumed: int
    void: Bools | None = None
    numbers: Ints | None = None

    def pick(self, rows: slice | Bools, consumed: int) -> 'Messages':
        """Give some of the messages, `consumed` of them to be placed."""
        return Messages(self.stamps[rows], self.other[rows], self.samples[rows], consumed,
                        None if self.void is None else self.void[rows],
                        None if self.numbers is None else self.numbers[rows])

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
        NaN only where an axis is absent.
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
        return EvenBlock(self.samples, self.first_index, self.bridged - self.first_index,
                         self.new_run, start_s=self.start_s)

    def by_axes(self, interval_s: float) -> Iterator['EvenPiece']:
        """Give the piece in parts within which the same axes are there, and at least one."""
        there = np.isfinite(self.samples)
        edges = np.flatnonzero((there[1:] != there[:-1]).any(axis=1)) + 1
        new_run = self.new_run
        for first, last in pairwise([0, *edges.tolist(), len(self.samples)]):
            if there[first].any():
                begin = self.first_index + first
                low, high = np.searchsorted(self.bridged, (begin, begin + last - first))
                yield EvenPiece(self.samples[first:last], begin, self.start_s + first * interval_s,
                                new_run, self.bridged[low:high])
                new_run = False
