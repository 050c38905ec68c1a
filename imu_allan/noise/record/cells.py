# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Means over equal cells of the sample grid.

A cell has a key, with the run in its upper bits and the place on the grid of that run in its lower
bits. Two cells are adjacent if their keys differ by one. Cells of different runs, whose relation
in time is unknown, are never adjacent.
"""

from dataclasses import dataclass, field
from itertools import pairwise

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.record.multi_axis import AXES_FIRST
import numpy as np

RUN_SHIFT = 40
"""Bits of a place, enough for 30 years at 1 kHz."""
_PLACE = (1 << RUN_SHIFT) - 1
"""Mask for the place in a key."""


@dataclass(frozen=True)
class Cells:
    """Cells in order of time."""

    keys: Ints    # (n,): strictly increasing
    # (axes, n): sum of the samples in each cell
    sums: Array = field(metadata=AXES_FIRST)
    counts: Ints    # (n,): number of samples in each cell

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self.keys)

    @property
    def means(self) -> Array:
        """Mean of each cell, shape (axes, n)."""
        return np.asarray(self.sums / self.counts)

    def take(self, part: slice | Bools) -> 'Cells':
        """Return a selection of the cells."""
        return Cells(self.keys[part], self.sums[:, part], self.counts[part])

    def split(self, apart: int = 1) -> list['Cells']:
        """Split the cells where the keys of neighbours differ by more than `apart`."""
        cuts = np.flatnonzero(np.diff(self.keys) > apart) + 1
        return [self.take(slice(*ends)) for ends in pairwise([0, *cuts.tolist(), len(self)])]


def no_cells(axes: int) -> Cells:
    """Return an empty series of `axes` axes."""
    return Cells(np.zeros(0, np.int64), np.zeros((axes, 0)), np.zeros(0, np.int64))


def cells_of(rows: Array, run: int, first: int, size: int) -> Cells:
    """
    Sum samples into cells.

    `rows`, shape (axes, n): consecutive samples, n >= 1. `run`: number of their run. `first`:
    place of the first sample on the grid of the run. `size`: samples in a cell.
    """
    n = rows.shape[1]
    head = min(-first % size, n)
    tail = head + (n - head) // size * size
    starts = np.concatenate(([0], np.arange(size - first % size, n, size)))
    keys = (np.int64(run) << RUN_SHIFT) + (first + starts) // size
    before, after = (part.sum(axis=1, keepdims=True)[:, :part.shape[1]]
                     for part in (rows[:, :head], rows[:, tail:]))
    # A matrix product is ten times as fast as a sum over an axis.
    whole = rows[:, head:tail].reshape(len(rows), -1, size) @ np.ones(size)
    sums = np.concatenate((before, whole, after), axis=1)
    return Cells(keys, sums, np.diff(np.append(starts, n)))


def joined(before: Cells, after: Cells) -> Cells:
    """Concatenate two series; add up a cell that both have, at the end and at the beginning."""
    if not len(before) or not len(after):
        return after if len(after) else before
    both = int(before.keys[-1] == after.keys[0])
    sums = np.concatenate((before.sums, after.sums[:, both:]), axis=1)
    counts = np.concatenate((before.counts, after.counts[both:]))
    if both:
        sums[:, len(before) - 1] += after.sums[:, 0]
        counts[len(before) - 1] += after.counts[0]
    return Cells(np.concatenate((before.keys, after.keys[both:])), sums, counts)


def coarser(cells: Cells, times: int) -> Cells:
    """Merge cells into cells `times` as large, a power of two."""
    if not len(cells) or times == 1:
        return cells
    keys = (cells.keys & ~_PLACE) + (cells.keys & _PLACE) // times
    first = np.ones(len(keys), np.bool_)
    np.not_equal(keys[1:], keys[:-1], out=first[1:])
    starts = first.nonzero()[0]
    return Cells(keys[starts], np.add.reduceat(cells.sums, starts, axis=1),
                 np.add.reduceat(cells.counts, starts))


def centres(cells: Cells, size: int) -> tuple[Ints, Array, Array]:
    """
    Return the positions of cells.

    `cells`: in order of time. `size`: samples in a full cell. Returns shape (n,): the run of each
    cell, its middle in samples on the grid of the run, and the same with runs joined end to end.
    """
    in_a_row = np.asarray(end_to_end(cells.keys), dtype=np.float64)
    places = np.asarray(cells.keys & _PLACE, dtype=np.float64)
    runs: Ints = np.asarray(cells.keys >> RUN_SHIFT, dtype=np.int64)
    return runs, (places + 0.5) * size, (in_a_row + 0.5) * size


def end_to_end(keys: Ints) -> Ints:
    """Return the places of cells, counted from the first, with runs joined end to end."""
    run, place = keys >> RUN_SHIFT, keys & _PLACE
    step = np.diff(place, prepend=place[:1])
    step[np.diff(run, prepend=run[:1]) > 0] = 1
    return np.asarray(np.cumsum(step))
