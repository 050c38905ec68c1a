# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The signal over time in constant memory: lowest, mean and highest value of equal segments.

A column covers ``width`` consecutive places of the grid. When all columns are in use, neighbours
are merged in pairs and the width doubles. So a second and a month need the same memory. The
borders of the columns depend only on the places, not on how the samples arrived.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES, EqualParts, numbers
import numpy as np

COLUMNS = 512
"""Most columns: finer than a figure as wide as a page shows, and 60 KB of JSON for six axes."""


class Columns(NamedTuple):
    """Result of `Signal.columns`."""

    width: int    # places of the grid in a column
    counts: Ints    # (columns,): samples in each column; zero in a gap
    # (axes, columns): NaN in a gap
    low: Array
    mean: Array
    high: Array


def stood_still(columns: Columns, axis: int) -> tuple[int, int] | None:
    """
    Find where an axis kept one value for a time, but not throughout.

    `columns`: of the whole record. Returns: first place and number of places of the longest such
    segment. None if there is none, or if the axis is constant throughout. The steps of its
    output must not hide its noise, or values may repeat as long by chance.
    """
    known = np.flatnonzero(columns.counts)
    # Sixteen equal samples in a row are significant, unless the steps are coarse.
    together = -(-16 // columns.width)
    starts = np.arange(0, len(known), together)
    # Fewest constant segments in a row, of which the first and last may be only partly constant.
    fewest = 3
    if len(starts) <= fewest:
        return None
    low = np.minimum.reduceat(columns.low[axis, known], starts)
    high = np.maximum.reduceat(columns.high[axis, known], starts)
    still = low == high
    # A run ends where the next segment is not constant or has another value.
    borders = np.flatnonzero(~still[1:] | ~still[:-1] | (low[1:] != low[:-1])) + 1
    begins, ends = np.r_[0, borders], np.r_[borders, len(still)]
    lengths = np.where(still[begins], ends - begins, 0)
    longest = int(np.argmax(lengths))
    run = int(lengths[longest])
    if run < fewest or run == len(still):
        return None
    last = min(int(ends[longest]) * together, len(known)) - 1
    first = int(known[starts[begins[longest]]])
    return first * columns.width, (int(known[last]) + 1 - first) * columns.width


@dataclass(eq=False)
class Signal(EqualParts):
    """Lowest, mean and highest value of several axes over time."""

    place: int = 0    # of the next sample
    # (COLUMNS,): samples in each column
    counts: Ints = field(init=False, metadata=numbers(COLUMNS, dtype=np.int64))
    # (axes, COLUMNS): sums and extremes, which is all that is needed to merge columns
    sums: Array = field(init=False, metadata=numbers(AXES, COLUMNS))
    low: Array = field(init=False, metadata=numbers(AXES, COLUMNS, merge=np.minimum))
    high: Array = field(init=False, metadata=numbers(AXES, COLUMNS, merge=np.maximum))

    def skip(self, places: int) -> None:
        """Leave `places` of the grid empty."""
        self.place += places

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples.

        `rows`, shape (axes, n): finite.
        """
        n = rows.shape[1]
        while self.place + n > COLUMNS * self.width:
            self.widen()
        # The rest of a column, whole columns, and the beginning of another one.
        head = min(-self.place % self.width, n)
        whole = (n - head) // self.width
        ends = pairwise((0, head, head + whole * self.width, n))
        for (begin, end), columns in zip(ends, (1, whole, 1), strict=True):
            if begin == end:
                continue
            part = rows[:, begin:end].reshape(self.axes, columns, -1)
            first = self.place // self.width
            here = slice(first, first + columns)
            self.counts[here] += part.shape[2]
            self.sums[:, here] += part.sum(axis=2)
            np.minimum(self.low[:, here], part.min(axis=2), out=self.low[:, here])
            np.maximum(self.high[:, here], part.max(axis=2), out=self.high[:, here])
            self.place += end - begin

    def columns(self) -> Columns:
        """Return the columns up to the last sample."""
        used = int(np.flatnonzero(self.counts)[-1]) + 1 if self.counts.any() else 0
        counts = self.counts[:used]
        empty = counts == 0
        low, high = self.low[:, :used].copy(), self.high[:, :used].copy()
        low[:, empty] = high[:, empty] = np.nan
        mean = self.sums[:, :used] / np.where(empty, 1, counts)
        mean[:, empty] = np.nan
        return Columns(self.width, counts.copy(), low, mean, high)
