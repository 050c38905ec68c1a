# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Spectrum and means of part of a record, from a finished periodogram."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from imu_allan.noise.record.bins import Bins, bins_of
from imu_allan.noise.record.cells import Cells
from imu_allan.noise.record.groups import grouped, Groups, stacked
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
    interpolated: float = 0.0    # share of the samples of the whole record

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
        return bins_of(sections, self.dt, self.interpolated) if sections else None

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
            place, bands = layout(length, step), _bands(length, step, self.dt, self.interpolated)
            known = dof[place.bands]
            parts.append(replace(
                bands, dof=known.astype(np.float64),
                power=power[place.bands] / np.maximum(known, 1),
            ).select((known > 0) & (bands.frequency * self.dt >= self._border)))
        return stacked(parts)


@lru_cache(maxsize=16)
def _bands(length: int, step: int, dt: float, interpolated: float) -> Groups:
    """Return the bands of a block without their power, common to all axes and parts."""
    place = layout(length, step)
    nothing = SpectrumSection(step, length, 1, place.first, place.last, np.zeros((1, length)))
    bins = bins_of([nothing], dt, interpolated)
    zero = np.zeros(len(place.bands))
    return Groups(place.means(bins.frequency), zero, zero, place.means(bins.design),
                  place.means(bins.ramp), bins.step[place.starts], bins.length[place.starts],
                  zero[:, None], zero[:, None, None])
