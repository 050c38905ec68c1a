# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Spectrum and means of part of a record, from a finished periodogram."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from imu_allan.noise.record.bins import Bins, bins_of
from imu_allan.noise.record.cells import Cells
from imu_allan.noise.record.groups import grouped, Groups
from imu_allan.noise.record.periodogram import HIGHEST_OF_MEANS, Periodogram, whole_sections
from imu_allan.noise.record.segments import PER_OCTAVE
import numpy as np


def part_cells(periodogram: Periodogram, first: int, last: int) -> Cells:
    """
    Return the cells of the whole-record series that belong to a range of segments.

    `first`, `last`: segments from `first` up to, but not including, `last`.
    """
    series = periodogram.series
    number = (periodogram.ends - series.counts / 2) // periodogram.segments.width
    return series.take((first <= number) & (number < last))


@dataclass(frozen=True)
class Part:
    """Consecutive segments of a record, for all axes."""

    periodogram: Periodogram    # finished
    dt: float    # sample interval in seconds
    # Segments from `first` up to, but not including, `last`
    first: int
    last: int
    interpolated: float = 0.0    # share of the samples of the whole record

    def groups(self, axis: int, lines_hz: Sequence[float] = ()) -> Groups | None:
        """
        Return the slow part of the spectrum of one axis, from the whole-record series.

        `lines_hz`: frequencies of lines, whose bands and the adjacent ones are left out. Returns:
        groups as from `grouped` for the whole record; None if the part is too short.
        """
        if self._bins is None:
            return None
        groups = grouped(self._bins, axis)
        keep = np.ones(len(groups.frequency), dtype=bool)
        for line in lines_hz:
            keep &= np.abs(np.log2(groups.frequency / line)) > 1.5 / PER_OCTAVE
        return groups.select(keep)

    @cached_property
    def _bins(self) -> Bins | None:
        cell = self.periodogram.cell
        cells = part_cells(self.periodogram, self.first, self.last)
        sections = whole_sections(cells, cell, 0.5 if cell == 1 else HIGHEST_OF_MEANS)
        return bins_of(sections, self.dt, self.interpolated) if sections else None
