# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The signal over time in constant memory: lowest, mean and highest value of equal stretches.

A column holds ``width`` neighbouring places of the grid. When the columns are used up, neighbours
are merged in pairs and the width doubles, so that a second and a month cost the same. Where the
borders of the columns lie depends on the places alone and not on how the samples arrived.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
State = dict[str, NDArray[np.generic]]

COLUMNS = 512
"""Most columns: finer than a figure across a page shows, and 60 KB of JSON for six axes."""
_STILL_SAMPLES = 16
"""To a stretch at least: as many equal samples in a row say something in all but coarse steps."""
_FEWEST_STILL = 3
"""Such stretches in a row: the first and the last may be still in part alone."""
_BY_CHANCE = 1e-4
"""Probability of a false word in a record; coarse steps repeat one value by nature."""


class Columns(NamedTuple):
    """
    What `Signal.columns` returns.

    Attributes
    ----------
    width : int
        Places of the grid to a column.
    counts : ndarray of int64, shape (columns,)
        Samples in each column; zero in a gap.
    low, mean, high : ndarray, shape (axes, columns)
        NaN in a gap.

    """

    width: int
    counts: NDArray[np.int64]
    low: Array
    mean: Array
    high: Array


def stood_still(columns: Columns, axis: int) -> tuple[int, int] | None:
    """
    Find where an axis gave one value all the time, and elsewhere does not.

    Parameters
    ----------
    columns : Columns
        Of the whole record.
    axis : int
        Its number.

    Returns
    -------
    (int, int) or None
        First place and number of places of the longest such stretch. None where there is none,
        where the axis is constant throughout, or where its resolution is so coarse that chance
        repeats values as long.

    Examples
    --------
    >>> signal = Signal(1)
    >>> rows = np.random.default_rng(1).normal(size=(1, 4096))
    >>> rows[0, 1024:2048] = 5.0
    >>> signal.absorb(rows)
    >>> stood_still(signal.columns(), 0)
    (1024, 1024)

    """
    known = np.flatnonzero(columns.counts)
    together = -(-_STILL_SAMPLES // columns.width)
    starts = np.arange(0, len(known), together)
    if len(starts) <= _FEWEST_STILL:
        return None
    low = np.minimum.reduceat(columns.low[axis, known], starts)
    high = np.maximum.reduceat(columns.high[axis, known], starts)
    still = low == high
    # A run ends where the next stretch moves, or holds another value.
    borders = np.flatnonzero(~still[1:] | ~still[:-1] | (low[1:] != low[:-1])) + 1
    begins, ends = np.r_[0, borders], np.r_[borders, len(still)]
    lengths = np.where(still[begins], ends - begins, 0)
    longest = int(np.argmax(lengths))
    run = int(lengths[longest])
    if run < _FEWEST_STILL or run == len(still):
        return None
    chance = (np.count_nonzero(still) - run + 1) / (len(still) - run + 1)
    if len(still) * chance**run > _BY_CHANCE:
        return None
    last = min(int(ends[longest]) * together, len(known)) - 1
    first = int(known[starts[begins[longest]]])
    return first * columns.width, (int(known[last]) + 1 - first) * columns.width


class Signal:
    """
    Lowest, mean and highest value of several axes over time.

    Parameters
    ----------
    axes : int
        How many axes are kept side by side.

    """

    def __init__(self, axes: int) -> None:
        self._width = 1
        self._place = 0     # of the next sample
        self._counts: NDArray[np.int64] = np.zeros(COLUMNS, dtype=np.int64)
        # Sums, lows and highs; merging columns needs nothing else.
        self._sums: Array = np.zeros((axes, COLUMNS))
        self._low: Array = np.full((axes, COLUMNS), np.inf)
        self._high: Array = np.full((axes, COLUMNS), -np.inf)

    @property
    def axes(self) -> int:
        """How many axes are kept."""
        return len(self._sums)

    def skip(self, places: int) -> None:
        """Leave `places` of the grid empty."""
        self._place += places

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)
            Finite.

        """
        n = rows.shape[1]
        while self._place + n > COLUMNS * self._width:
            self._widen()
        begin = 0
        while begin < n:
            column, inside = divmod(self._place, self._width)
            whole = (n - begin) // self._width
            if inside or not whole:
                take, whole = min(self._width - inside, n - begin), 1
            else:
                take = whole * self._width
            part = rows[:, begin:begin + take].reshape(self.axes, whole, -1)
            here = slice(column, column + whole)
            self._counts[here] += take // whole
            self._sums[:, here] += part.sum(axis=2)
            np.minimum(self._low[:, here], part.min(axis=2), out=self._low[:, here])
            np.maximum(self._high[:, here], part.max(axis=2), out=self._high[:, here])
            self._place += take
            begin += take

    def columns(self) -> Columns:
        """Return the columns up to the last sample."""
        used = int(np.flatnonzero(self._counts)[-1]) + 1 if self._counts.any() else 0
        counts = self._counts[:used]
        empty = counts == 0
        low, high = self._low[:, :used].copy(), self._high[:, :used].copy()
        low[:, empty] = high[:, empty] = np.nan
        mean = self._sums[:, :used] / np.where(empty, 1, counts)
        mean[:, empty] = np.nan
        return Columns(self._width, counts.copy(), low, mean, high)

    def merge(self, other: 'Signal', shift: Array) -> None:
        """
        Add the columns of another record behind this one's.

        Parameters
        ----------
        other : Signal
            Of the same axes. It begins with the next whole column.
        shift : ndarray, shape (axes,)
            Added to the other's values.

        """
        theirs = other.copy()
        while self._width < theirs._width:
            self._widen()
        while theirs._width < self._width:
            theirs._widen()
        while -(-self._place // self._width) + -(-theirs._place // theirs._width) > COLUMNS:
            self._widen()
            theirs._widen()
        begin, count = -(-self._place // self._width), -(-theirs._place // theirs._width)
        there = slice(begin, begin + count)
        self._counts[there] = theirs._counts[:count]
        self._sums[:, there] = theirs._sums[:, :count] + shift[:, None] * theirs._counts[:count]
        self._low[:, there] = theirs._low[:, :count] + shift[:, None]
        self._high[:, there] = theirs._high[:, :count] + shift[:, None]
        self._place = begin * self._width + theirs._place

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        self._sums, self._low, self._high = self._sums[axes], self._low[axes], self._high[axes]

    def copy(self) -> 'Signal':
        """Return an independent copy."""
        return Signal.from_state(self.to_state())

    def to_state(self) -> State:
        """Return the state as plain arrays."""
        return {'places': np.array([self._width, self._place]), 'counts': self._counts.copy(),
                'sums': self._sums.copy(), 'low': self._low.copy(), 'high': self._high.copy()}

    @classmethod
    def from_state(cls, state: State) -> 'Signal':
        """
        Return the signal that `to_state` described.

        Raises
        ------
        KeyError, ValueError
            If the state is not one of a signal.

        """
        sums = np.array(state['sums'], dtype=np.float64)
        low = np.array(state['low'], dtype=np.float64)
        high = np.array(state['high'], dtype=np.float64)
        counts = np.array(state['counts'], dtype=np.int64)
        places = np.array(state['places'], dtype=np.int64)
        if (sums.ndim != 2 or not sums.shape == low.shape == high.shape == (len(sums), COLUMNS)
                or counts.shape != (COLUMNS,) or places.shape != (2,)):
            raise ValueError('arrays of the signal do not fit together')
        width, place = (int(value) for value in places)
        if width < 1 or place < 0 or (counts < 0).any() or (counts > width).any():
            raise ValueError('counts of the signal do not fit together')
        self = cls(len(sums))
        self._width, self._place = width, place
        self._counts, self._sums, self._low, self._high = counts, sums, low, high
        return self

    def _widen(self) -> None:
        """Merge neighbouring columns in pairs."""
        half = COLUMNS // 2
        pairs = self._counts.reshape(half, 2).sum(axis=1)
        self._counts = np.concatenate([pairs, np.zeros(half, dtype=np.int64)])
        shape = (self.axes, half, 2)
        room = np.zeros((self.axes, half))
        self._sums = np.hstack([self._sums.reshape(shape).sum(axis=2), room])
        self._low = np.hstack([self._low.reshape(shape).min(axis=2), room + np.inf])
        self._high = np.hstack([self._high.reshape(shape).max(axis=2), room - np.inf])
        self._width *= 2
