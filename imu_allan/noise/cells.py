# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Means over equal cells of the sample grid.

A cell is named by a key: the run it belongs to in the upper bits, its place on the grid of that
run in the lower ones. Two cells are neighbours where their keys differ by one; runs, whose
relation in time is unknown, never touch.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Keys = NDArray[np.int64]

RUN_SHIFT = 44
_FEWEST = 4
_MOST = 256
_PLACE = (1 << RUN_SHIFT) - 1


@dataclass(frozen=True)
class Cells:
    """
    Some cells in order of time.

    Attributes
    ----------
    keys : ndarray of int64, shape (n,)
        Strictly increasing.
    sums : ndarray, shape (axes, n)
        Sum of the samples that fell into each cell.
    counts : ndarray of int64, shape (n,)
        How many samples these were.

    """

    keys: Keys
    sums: Array
    counts: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.keys)

    @property
    def means(self) -> Array:
        """Mean of each cell, shape (axes, n)."""
        return np.asarray(self.sums / self.counts)

    def take(self, part: slice | NDArray[np.bool_]) -> 'Cells':
        """Return some of the cells."""
        return Cells(self.keys[part], self.sums[:, part], self.counts[part])


def no_cells(axes: int) -> Cells:
    """Return an empty series of `axes` axes."""
    return Cells(np.zeros(0, np.int64), np.zeros((axes, 0)), np.zeros(0, np.int64))


def cells_of(rows: Array, run: int, first: int, size: int) -> Cells:
    """
    Sum samples into cells.

    Parameters
    ----------
    rows : ndarray, shape (axes, n)
        Consecutive samples, n >= 1.
    run : int
        Number of the run.
    first : int
        Place of the first sample on the grid of the run.
    size : int
        Samples in a cell.

    Returns
    -------
    Cells

    """
    n = rows.shape[1]
    starts = np.concatenate(([0], np.arange(size - first % size, n, size)))
    keys = (np.int64(run) << RUN_SHIFT) + (first + starts) // size
    sums = rows.copy() if size == 1 else np.add.reduceat(rows, starts, axis=1)
    return Cells(keys, sums, np.diff(np.append(starts, n)))


def joined(before: Cells, after: Cells) -> Cells:
    """Return both series in one; a cell that ends the first and begins the second is summed."""
    if not len(before) or not len(after):
        return after if len(after) else before
    if before.keys[-1] != after.keys[0]:
        return Cells(np.append(before.keys, after.keys),
                     np.concatenate((before.sums, after.sums), axis=1),
                     np.append(before.counts, after.counts))
    sums = np.concatenate((before.sums, after.sums[:, 1:]), axis=1)
    sums[:, len(before) - 1] += after.sums[:, 0]
    counts = np.append(before.counts, after.counts[1:])
    counts[len(before) - 1] += after.counts[0]
    return Cells(np.append(before.keys, after.keys[1:]), sums, counts)


def coarser(cells: Cells, octaves: int) -> Cells:
    """Return the series summed into cells 2**`octaves` times as large."""
    if not len(cells):
        return cells
    keys = (cells.keys & ~_PLACE) + ((cells.keys & _PLACE) >> octaves)
    starts = np.flatnonzero(np.append(True, np.diff(keys) != 0))
    return Cells(keys[starts], np.add.reduceat(cells.sums, starts, axis=1),
                 np.add.reduceat(cells.counts, starts))


def filled(cells: Cells) -> Array:
    """
    Lay means out on the whole grid from the first to the last cell.

    Parameters
    ----------
    cells : Cells
        All of one run.

    Returns
    -------
    ndarray, shape (axes, span)
        Missing cells stand on the straight line between the means of what surrounds them, taken
        over twice as many cells as are missing: a line between the two nearest cells alone would
        stretch their noise over the gap and look like flicker.

    """
    means = cells.means
    places = cells.keys - cells.keys[0]
    span = int(places[-1]) + 1
    if span == len(cells):
        return means
    grid = np.empty((means.shape[0], span))
    grid[:, places] = means
    for before in np.flatnonzero(np.diff(places) > 1):
        first, last = int(places[before]) + 1, int(places[before + 1])
        width = min(max(2 * (last - first), _FEWEST), _MOST)
        left = slice(max(before + 1 - width, 0), before + 1)
        right = slice(before + 1, before + 1 + width)
        x0, x1 = places[left].mean(), places[right].mean()
        y0, y1 = means[:, left].mean(axis=1), means[:, right].mean(axis=1)
        share = (np.arange(first, last) - x0) / (x1 - x0)
        grid[:, first:last] = y0[:, None] + (y1 - y0)[:, None] * share
    return grid
