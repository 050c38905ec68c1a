# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Means over a second of even samples as they come, in constant memory."""

from collections.abc import Iterable

from imu_allan.block import EvenBlock
from imu_allan.noise.cells import cells_of, coarser, joined, no_cells
import numpy as np
from numpy.typing import NDArray

MOST = 32_768
"""Nine hours of seconds, 2 MB of six axes; after that the means are over two, four, ..."""


class Means:
    """
    Means over a second of every axis that there is.

    Attributes
    ----------
    series : Cells
        Of these axes.
    cell : int
        Samples in a mean.
    columns : ndarray of int
        Their columns in a block.
    cell_s : float
        Time that a mean is taken over.

    Examples
    --------
    >>> means = Means()
    >>> means.take([EvenBlock(np.ones((250, 6)), first_index=0)], 1e7)
    >>> means.series.means[0].tolist(), means.series.counts.tolist(), means.cell_s
    ([1.0, 1.0, 1.0], [100, 100, 50], 1.0)

    """

    def __init__(self) -> None:
        self.series, self.cell = no_cells(0), 1
        self.columns: NDArray[np.int64] = np.zeros(0, np.int64)
        self._run = 0
        self._interval_ns = 1e9

    @property
    def cell_s(self) -> float:
        """Time that a mean is taken over."""
        return self.cell * self._interval_ns * 1e-9

    def take(self, blocks: Iterable[EvenBlock], interval_ns: float | None) -> None:
        """
        Take in the next samples.

        Parameters
        ----------
        blocks : iterable of EvenBlock
            As a timeline gives them.
        interval_ns : float or None
            Time between two samples as the timeline has it by now.

        """
        self._interval_ns = interval_ns or self._interval_ns
        for block in blocks:
            if len(block):
                self._absorb(block)

    def _absorb(self, block: EvenBlock) -> None:
        if block.restart or not len(self.series):
            self.columns = np.flatnonzero(np.isfinite(block.samples[0]))
            self.series = no_cells(len(self.columns))
            self.cell = max(1, round(1e9 / self._interval_ns))
        self._run += block.new_run
        rows = np.ascontiguousarray(block.samples[:, self.columns].T)
        self.series = joined(self.series, cells_of(rows, self._run, block.first_index, self.cell))
        while len(self.series) > MOST:
            self.series = coarser(self.series, 1)
            self.cell *= 2
