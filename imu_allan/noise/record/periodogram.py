# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The spectrum of a record in constant memory.

The record is processed at up to five rates: single samples, means of 16, of 256 and so on. Each
stage sums the squared DCT-II coefficients of consecutive blocks of 4096 points. The lowest
frequencies of a block are left to the next stage. For the slowest part of the spectrum, where each
coefficient matters, one DCT is taken over the whole record. For it the record is kept as at most
8192 means over cells that double in size as it grows. So a record of up to 8192 samples is
transformed as a whole.

Splitting a record into blocks loses very little. For white noise and random walk, all but the
first few coefficients of adjacent blocks are independent; for flicker, they are nearly so.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.cells import (
    Cells,
    cells_of,
    coarser,
    end_to_end,
    joined,
    no_cells,
    RUN_SHIFT,
)
from imu_allan.noise.record.gaps import filled, Gaps, NO_GAPS, noise_through_gaps
from imu_allan.noise.record.multi_axis import AXES_FIRST, begun, MultiAxis
from imu_allan.noise.record.segments import BLOCK, MEANS, Segments
from imu_allan.state import Record
import numpy as np
from scipy.fft import dct

SERIES = 8192
"""Most cells in the whole-record series."""
SHORTEST = 16
"""Points of the shortest block: the end of a segment is split into blocks of powers of two."""
HIGHEST_OF_MEANS = 0.25
"""Highest frequency used of means, relative to their rate: aliasing grows towards half of it."""


@dataclass(frozen=True)
class SpectrumSection:
    """Part of the spectrum."""

    step: int    # samples averaged into one point
    length: int    # points of a block
    blocks: int    # number of blocks averaged
    # Valid DCT indices, from `first` up to, but not including, `last`
    first: int
    last: int
    # (axes, length): mean squared orthonormal DCT-II coefficients by index, in squared
    # sample units
    power: Array
    # (axes, length): the coefficients themselves if the section is a single block
    coefficients: Array | None = None
    gaps: Gaps = NO_GAPS    # effect of missing samples on noise
    # For a single block: samples from the beginning of the record to its first point, with runs
    # joined end to end
    start: int = 0

    def spacing_hz(self, dt: float) -> float:
        """Return the frequency spacing of the coefficients in Hz."""
        return 1 / (2 * self.length * self.step * dt)


def whole_section(points: Array, step: int = 1, top: float = 0.5, gaps: Gaps = NO_GAPS,
                  start: int = 0) -> SpectrumSection:
    """
    Transform a part of a record as one block.

    `points`, shape (axes, n): means over `step` samples. `top`: highest valid frequency, in cycles
    per point. `gaps`, `start`: as in `SpectrumSection`.
    """
    length, coefficients = points.shape[1], dct(points, norm='ortho')
    last = min(length, int(np.ceil(2 * length * top)))
    return SpectrumSection(step, length, 1, 1, last, coefficients**2, coefficients, gaps, start)


@dataclass(eq=False)
class BlockSum(Record):
    """Sum over the blocks of one length."""

    # (axes, length): sum of squared DCT-II coefficients
    power: Array = field(metadata=AXES_FIRST)
    blocks: int = 0
    # Sum over the blocks of the variance that half-full points add to unit white noise
    excess: float = 0.0

    @property
    def gaps(self) -> Gaps:
        """Return the effect of half-full points on white noise."""
        return Gaps(0.0, np.full(self.power.shape[1], 1 + self.excess / self.blocks)
                    ) if self.excess else NO_GAPS


@dataclass(eq=False)
class Stage(MultiAxis):
    """One stage of the spectrum: blocks of samples, or of means."""

    sums: dict[int, BlockSum] = field(default_factory=dict)    # by block length
    # Means that do not fill a block yet
    waiting: Cells = field(init=False, metadata=begun(no_cells))

    def add(self, rows: Array, variance: Array | None = None) -> list[tuple[int, int, Array]]:
        """
        Split consecutive points into the longest possible blocks and add them.

        `rows`, shape (axes, n): the points of all axes. `variance`, shape (n,): variance of white
        noise in each point, relative to a full one. Returns: length, number and summed power,
        shape (axes, length), of the blocks added.
        """
        added = []
        start = 0
        for octave in range((BLOCK // SHORTEST).bit_length()):
            length = BLOCK >> octave
            count = (rows.shape[1] - start) // length
            if not count:
                continue
            end = start + count * length
            blocks = rows[:, start:end].reshape(self.axes, count, length)
            coefficients = dct(blocks, norm='ortho')
            power = np.einsum('ijk,ijk->ik', coefficients, coefficients)
            total = self.sums.setdefault(length, BlockSum(np.zeros((self.axes, length))))
            total.power += power
            total.blocks += count
            if variance is not None:
                total.excess += float((variance[start:end] - 1).sum()) / length
            added.append((length, count, power))
            start = end
        return added

    def take(self, cells: Cells, size: int, *, last: bool = False) -> None:
        """Add cells of `size` samples, held back while they may grow or do not fill a block."""
        cells = self.waiting = joined(self.waiting, cells)
        if len(cells) <= BLOCK + SHORTEST and not last:
            return
        end = len(cells) - (not last)
        self.waiting, cells = cells.take(slice(end, None)), cells.take(slice(end))
        # Gaps are not filled: frequencies low enough to need it are in the series.
        segments = cells.take(cells.counts >= size / 2).split()
        for segment in segments:
            whole = len(segment)
            if segment is segments[-1] and not last:
                # The segment continues, so take only whole blocks for now.
                whole -= whole % BLOCK
                self.waiting = joined(segment.take(slice(whole, None)), self.waiting)
            self.add(segment.means[:, :whole], (size / segment.counts)[:whole])


@dataclass(eq=False)
class Periodogram(MultiAxis):
    """Spectrum of several axes, computed block by block."""

    cell: int = 1    # samples in a cell of the series
    samples: int = 0
    # The first of samples, the others of means
    stages: list[Stage] = field(init=False, metadata=begun(lambda axes: [Stage(axes)]))
    series: Cells = field(init=False, metadata=begun(no_cells))    # the whole record
    segments: Segments = field(init=False, metadata=begun(Segments))

    def absorb(self, rows: Array, run: int, first: int) -> None:
        """
        Add samples of one segment.

        `rows`, shape (axes, n): a multiple of `BLOCK` samples, or the end of the segment. `run`:
        number of the run. `first`: place of the first sample on the grid of the run.
        """
        self.samples += rows.shape[1]
        self.segments.absorb(rows, self.stages[0].add(rows))
        cells = cells_of(rows, run, first, MEANS)
        self.series = joined(
            self.series, coarser(cells, self.cell // MEANS) if self.cell >= MEANS else
            cells_of(rows, run, first, self.cell))
        self._bound_series()
        # The slowest stage has means of 2**16 samples: at 1 kHz its blocks are three days long.
        for number in range(1, 5):
            if number == len(self.stages):
                # The stage is needed once the series is coarser than its points.
                if self.samples < SERIES // 2:
                    break
                self.stages.append(Stage(self.axes))
            if number > 1:
                cells = coarser(cells, MEANS)
            self.stages[number].take(cells, MEANS**number)

    def _bound_series(self) -> None:
        """Enlarge the cells until there are at most `SERIES`."""
        # Cells do not extend over runs, so with thousands of runs, drop the oldest cells instead.
        while len(self.series) > SERIES and self.cell <= 1 << 36:
            self.series = coarser(self.series, 2)
            self.cell *= 2
        self.series = self.series.take(slice(-SERIES, None))

    @property
    def ends(self) -> Ints:
        """Return the samples up to the end of each cell of the series, shape (cells,)."""
        # Counted from the end, as a very long record of short runs may have dropped its oldest
        # cells.
        counts = self.series.counts
        return np.asarray(self.samples + counts - np.cumsum(counts[::-1])[::-1])

    def finish(self) -> None:
        """Transform the waiting means of all stages, at the end of the record."""
        for number, stage in enumerate(self.stages):
            stage.take(no_cells(self.axes), MEANS**number, last=True)

    def sections(self) -> list[SpectrumSection]:
        """Return the spectrum from the slowest to the fastest part, without overlap."""
        top = 0.5 if self.cell == 1 else HIGHEST_OF_MEANS
        found = whole_sections(self.series, self.cell, top)
        if self.cell == 1:
            return found
        border = top / self.cell
        # The first 128 coefficients of a block are left to the next stage, of finer resolution.
        # Quantization noise at both ends of a block leaks equally into all of them, so that they
        # vary together; in later ones it is at most a tenth of the quantization noise itself.
        lowest = HIGHEST_OF_MEANS / MEANS
        for number, stage in reversed([*enumerate(self.stages)]):
            step = MEANS**number
            if step >= self.cell:
                continue
            low = max(border * step, lowest if number + 1 < len(self.stages) else 0)
            high = HIGHEST_OF_MEANS if number else 0.5
            for length, total in sorted(stage.sums.items(), reverse=True):
                # Never empty: `low` is at most an eighth, a block has at least 16 points.
                first = max(1, int(np.ceil(2 * length * low)))
                last = int(np.ceil(2 * length * high))
                found.append(SpectrumSection(step, length, total.blocks, first, last,
                                             total.power / total.blocks, gaps=total.gaps))
            border = max(border, lowest / step)
        return found


def whole_sections(cells: Cells, size: int, top: float) -> list[SpectrumSection]:
    """
    Transform each part of a record whose gaps are few enough to be filled.

    `cells`: in order of time. `size`: samples in a full cell; cells less than half full are left
    out. `top`: as in `whole_section`. Returns: sections of at least `SHORTEST` points.
    """
    whole = cells.take(cells.counts >= size / 2)
    place = end_to_end(whole.keys) * size
    runs = whole.keys >> RUN_SHIFT
    parts = [whole.take(runs == run) for run in np.unique(runs)]
    found: list[SpectrumSection] = []
    while parts:
        part = parts.pop(0)
        if len(part) < SHORTEST:
            continue
        span = int(part.keys[-1] - part.keys[0]) + 1
        # The effect of filled gaps is known, but they must not be most of a part; else split it.
        if 1 - len(part) / span <= 0.5:
            start = int(place[np.searchsorted(whole.keys, part.keys[0])])
            found.append(whole_section(
                filled(part), size, top, noise_through_gaps(part, size), start))
        else:
            widest = int(np.argmax(np.diff(part.keys))) + 1
            parts[:0] = [part.take(slice(None, widest)), part.take(slice(widest, None))]
    return found
