# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Means over one second of even samples, in order of arrival and in constant memory."""

from collections.abc import Collection, Iterable

from imu_allan.arrays import Ints
from imu_allan.block import EvenBlock
from imu_allan.noise.record.cells import cells_of, coarser, joined, no_cells
from imu_allan.noise.terms import AXES
import numpy as np


class Means:
    """
    Means over one second of some axes; where one of them is absent, there is a gap.

    Parameters
    ----------
    axes : collection of str
        Keys of `AXES`.

    Attributes
    ----------
    series : Cells
        Means of these axes.
    cell : int
        Number of samples in a mean.
    columns : ndarray of int
        Their columns in a block.
    cell_s : float
        Duration of a mean.

    """

    def __init__(self, axes: Collection[str]) -> None:
        self.columns: Ints = np.flatnonzero([name in axes for name in AXES])
        self.series, self.cell = no_cells(len(self.columns)), 1
        self._run, self._away = 0, False
        self._interval_ns = 1e9

    @property
    def cell_s(self) -> float:
        """Duration of a mean, in seconds."""
        return self.cell * self._interval_ns * 1e-9

    def take(self, blocks: Iterable[EvenBlock], interval_ns: float | None) -> None:
        """Take in the next samples of a timeline, and its current sample interval."""
        self._interval_ns = interval_ns or self._interval_ns
        for block in blocks:
            if len(block):
                self._absorb(block)

    def _absorb(self, block: EvenBlock) -> None:
        if block.restart or not len(self.series):
            self.series = no_cells(len(self.columns))
            self.cell = max(1, round(1e9 / self._interval_ns))
        self._run += block.new_run
        rows = np.ascontiguousarray(block.samples[:, self.columns].T)
        there = np.asarray(np.isfinite(rows).all(axis=0))
        edges = np.flatnonzero(np.diff(there, prepend=False, append=False))
        for start, end in edges.reshape(-1, 2).tolist():
            # Samples after the absence of an axis belong to another run.
            self._run += start > 0 or self._away
            self.series = joined(self.series, cells_of(
                rows[:, start:end], self._run, block.first_index + start, self.cell))
            self._away = False
        self._away = not there[-1]
        # Nine hours of seconds, 2 MB for six axes; then means are over two, four, ... seconds.
        while len(self.series) > 32_768:
            self.series = coarser(self.series, 2)
            self.cell *= 2
