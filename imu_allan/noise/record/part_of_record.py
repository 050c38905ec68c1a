# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Spectrum and means of part of a record, from a finished periodogram."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from imu_allan.arrays import Array
from imu_allan.noise.record.bins import Bins, bins_of
from imu_allan.noise.record.cells import Cells
from imu_allan.noise.record.groups import grouped, Groups, stacked
from imu_allan.noise.record.interpolation import Interpolation, NO_INTERPOLATION
from imu_allan.noise.record.periodogram import (
    HIGHEST_OF_MEANS,
    Periodogram,
    SpectrumSection,
    whole_sections,
)
from imu_allan.noise.record.segments import (
    layout,
    OCTAVES,
    PER_OCTAVE,
    SHORTEST_SEGMENT,
    TRANSFORMS,
)
import numpy as np


def part_cells(periodogram: Periodogram, first: int, last: int) -> Cells:
    """
    Return the cells of the whole-record series that belong to a range of segments.

    `first`, `last`: segments from `first` up to, but not including, `last`.
    """
    series, segments = periodogram.series, periodogram.segments
    end = np.cumsum(series.counts)
    # A very long record of short runs may have dropped its oldest cells.
    middle = end - series.counts / 2 + (segments.samples - (end[-1] if len(end) else 0))
    number = middle // segments.width
    return series.take((first <= number) & (number < last))


@dataclass(frozen=True)
class Part:
    """Consecutive segments of a record, for all axes."""

    periodogram: Periodogram    # finished
    dt: float    # sample interval in seconds
    # Segments from `first` up to, but not including, `last`
    first: int
    last: int
    interpolation: Interpolation = NO_INTERPOLATION    # of the whole record

    def groups(self, axis: int, lines_hz: Sequence[float] = ()) -> Groups:
        """
        Return the spectrum of one axis.

        `lines_hz`: frequencies of lines, whose bands and the adjacent ones are left out. Returns:
        groups from the slowest to the fastest, as from `grouped` for the whole record; none if the
        part is too short.
        """
        found = [] if self._slow is None else [grouped(self._slow, axis)]
        if self.periodogram.cell > 1:
            found.append(self._banded(axis))
        groups = stacked(found)
        keep = np.ones(len(groups.frequency), dtype=bool)
        for line in lines_hz:
            keep &= np.abs(np.log2(groups.frequency / line)) > 1.5 / PER_OCTAVE
        return groups.select(keep)

    @cached_property
    def _slow(self) -> Bins | None:
        """Spectrum of the series up to `_border`; None if the part is too short."""
        cell = self.periodogram.cell
        cells = part_cells(self.periodogram, self.first, self.last)
        sections = [section for section in whole_sections(cells, cell, cell * self._border)
                    if section.last > 1]
        return bins_of(sections, self.dt, self.interpolation) if sections else None

    @cached_property
    def _border(self) -> float:
        """Frequency in cycles per sample where the bands take over from the series."""
        segments = self.periodogram.segments
        if self.periodogram.cell == 1:
            return 0.5
        highest = HIGHEST_OF_MEANS / self.periodogram.cell
        slow = layout(*TRANSFORMS[0])
        seen = segments.dof[self.first:self.last, slow.bands].sum() / slow.counts.sum()
        samples = min(self.last * segments.width, segments.samples) - self.first * segments.width
        # The slower transform is representative if it contains at least half of the samples.
        whole = seen * SHORTEST_SEGMENT > 0.5 * samples
        return float(min(highest, 2.0**-OCTAVES if whole else 1 / 256))

    def _banded(self, axis: int) -> Groups:
        """Return the spectrum of the bands above `_border`."""
        segments = self.periodogram.segments
        dof = segments.dof[self.first:self.last].sum(axis=0)
        power = segments.power[axis, self.first:self.last].sum(axis=0)
        parts = []
        for length, step in TRANSFORMS:
            place = layout(length, step)
            frequency, design, ramp = _shapes(length, step, self.dt, self.interpolation)
            keep = (dof[place.bands] > 0) & (frequency * self.dt >= self._border)
            bands = place.bands[keep]
            nothing = np.zeros(len(bands))
            parts.append(Groups(
                frequency[keep], dof[bands].astype(np.float64), power[bands] / dof[bands],
                design[keep], ramp[keep], np.full(len(bands), float(step)),
                np.full(len(bands), float(length)), np.full(len(bands), self.interpolation.share),
                nothing[:, None], nothing[:, None, None]))
        return stacked(parts)


@lru_cache(maxsize=16)
def _shapes(length: int, step: int, dt: float, interpolation: Interpolation
            ) -> tuple[Array, Array, Array]:
    """Return frequency, design and ramp of the bands of a block, common to all axes and parts."""
    place = layout(length, step)
    nothing = SpectrumSection(step, length, 1, place.first, place.last, np.zeros((1, length)))
    bins = bins_of([nothing], dt, interpolation)
    return place.means(bins.frequency), place.means(bins.design), place.means(bins.ramp)
