# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The spectrum in constant memory, in one module because each stage begins where another ends.

The record is seen at three or four rates: every sample, means of 64, of 4096, ... Each stage adds
up the squared DCT-II coefficients of consecutive blocks of 4096 points; what is slower than a
block is left to the next stage. The slowest part of the spectrum, where every single coefficient
counts, comes from one DCT over the whole record, kept as at most 8192 means over cells that double
in size as the record grows. A record of up to 8192 samples is thus transformed whole.

Cutting a record into blocks costs nothing that matters: the coefficients above the first few of a
block are independent of those of its neighbours for white noise and random walk, and nearly so for
flicker.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from imu_allan.noise.record.cells import (
    Cells,
    cells_of,
    coarser,
    end_to_end,
    joined,
    moved,
    no_cells,
    renumbered,
    RUN_SHIFT,
)
from imu_allan.noise.record.gaps import filled, Gaps, NO_GAPS, noise_through_gaps, without_islands
from imu_allan.noise.record.segments import BLOCK, Segments
from imu_allan.noise.record.side_by_side import AXES_FIRST, SideBySide
from imu_allan.state import Record
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

STAGE_OCTAVES = 6
"""A stage sees means of 2**6 points of the stage before."""
SERIES = 8192
"""The most cells of the whole-record series."""
SHORTEST = 16
"""Points of the shortest block: the rest of a segment is cut into blocks of powers of two."""

_MAX_STAGES = 4
"""Means of 2**18 samples in the slowest: at 1 kHz its blocks last for twelve days."""
_LOWEST = 32 / (2 * BLOCK)
"""A block leaves its first 32 coefficients to the next stage, which resolves them better."""
HIGHEST_OF_MEANS = 0.25
"""Of their own rate: means fold what is faster, the more the nearer to half of it."""
_LENGTHS = tuple(BLOCK >> octave for octave in range((BLOCK // SHORTEST).bit_length()))
"""Of the blocks, from the longest to the shortest."""


@dataclass(frozen=True)
class SpectrumSection:
    """Part of the spectrum."""

    step: int    # samples averaged into one point
    length: int    # points of a block
    blocks: int    # how many blocks were averaged
    # The DCT indices, `first` up to and without `last`, that this section is good for
    first: int
    last: int
    # (axes, length): mean squared orthonormal DCT-II coefficients by index, in squared
    # sample units
    power: Array
    # (axes, length): the coefficients themselves where the section is one block
    coefficients: Array | None = None
    gaps: Gaps = NO_GAPS    # what missing samples do to noise
    # Of one block: samples from the beginning of the record to its first point; runs are joined
    # end to end
    start: int = 0

    def spacing_hz(self, dt: float) -> float:
        """Return how far apart the frequencies of its coefficients are."""
        return 1 / (2 * self.length * self.step * dt)


def longest_blocks(sections: Sequence[SpectrumSection]) -> dict[int, int]:
    """Return the points of the longest blocks, by the samples averaged into one point."""
    return {section.step: max(one.length for one in sections if one.step == section.step)
            for section in sections}


def whole_section(points: Array, step: int = 1, top: float = 0.5, gaps: Gaps = NO_GAPS,
                  start: int = 0) -> SpectrumSection:
    """
    Transform a part of a record as one block.

    `points`, shape (axes, n): means over `step` samples. `top`: cycles per point up to which the
    section is good. `gaps`, `start`: as in `SpectrumSection`.
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
    # Sum over the blocks of the variance that half-full points add to white noise of 1
    excess: float = 0.0

    @property
    def gaps(self) -> Gaps:
        """Return what half-full points do to the white noise."""
        return Gaps(0.0, np.full(self.power.shape[1], 1 + self.excess / self.blocks)
                    ) if self.excess else NO_GAPS


@dataclass(eq=False)
class Stage(SideBySide):
    """Blocks of samples, or of means: one stage of the spectrum."""

    sums: dict[int, BlockSum] = field(default_factory=dict)    # by block length
    waiting: Cells = field(init=False)    # means that make no whole block yet

    def begin(self) -> None:
        """Begin with nothing."""
        self.waiting = no_cells(self.axes)

    def _of(self, length: int) -> BlockSum:
        return self.sums.setdefault(length, BlockSum(np.zeros((self.axes, length))))

    def add(self, rows: Array, variance: Array | None = None) -> list[tuple[int, int, Array]]:
        """
        Cut consecutive points into the longest blocks and add them.

        `rows`, shape (axes, n): the points of every axis. `variance`, shape (n,): variance of
        white noise in each point over that of a full one. Returns: length, number and summed
        power, shape (axes, length), of what was added.
        """
        added = []
        start = 0
        for length in _LENGTHS:
            count = (rows.shape[1] - start) // length
            if not count:
                continue
            part = rows[:, start:start + count * length].reshape(self.axes, count, length)
            coefficients = dct(part, norm='ortho')
            power = np.einsum('ijk,ijk->ik', coefficients, coefficients)
            own = self._of(length)
            own.power += power
            own.blocks += count
            if variance is not None:
                more = variance[start:start + count * length] - 1
                own.excess += float(more.sum()) / length
            added.append((length, count, power))
            start += count * length
        return added

    def take(self, cells: Cells, size: int) -> None:
        """Add cells of `size` samples; the last one waits, since it may still grow."""
        self.waiting = joined(self.waiting, cells)
        if len(self.waiting) > BLOCK + SHORTEST:
            self._transform(size, all_of_it=False)

    def finish(self, size: int) -> None:
        """Transform what waits."""
        if len(self.waiting):
            self._transform(size, all_of_it=True)

    def _transform(self, size: int, *, all_of_it: bool) -> None:
        growing = self.waiting.take(slice(len(self.waiting) - (not all_of_it), None))
        held = self.waiting.take(slice(0, len(self.waiting) - (not all_of_it)))
        held = held.take(held.counts >= size / 2)
        self.waiting = growing
        if not len(held):
            return
        # Nothing is filled here: what is slow enough to need it is in the series.
        cut = np.flatnonzero(np.diff(held.keys) > 1) + 1
        for begin, end in pairwise([0, *cut.tolist(), len(held)]):
            segment = held.take(slice(begin, end))
            whole = len(segment)
            if end == len(held) and not all_of_it:
                # The segment goes on: only whole blocks are taken now.
                whole -= whole % BLOCK
                self.waiting = joined(segment.take(slice(whole, None)), growing)
            self.add(segment.means[:, :whole], (size / segment.counts)[:whole])

    def merge(self, other: 'Stage') -> None:
        """Add the sums of another finished record."""
        for length, theirs in other.sums.items():
            own = self._of(length)
            own.power += theirs.power
            own.blocks += theirs.blocks
            own.excess += theirs.excess

    def check(self) -> None:
        """Raise ValueError where fields that were saved do not belong together."""
        self.waiting.check(self.axes)
        for length, own in self.sums.items():
            if (length not in _LENGTHS or own.power.shape != (self.axes, length)
                    or own.blocks < 1 or not 0 <= own.excess <= own.blocks):
                raise ValueError(f'blocks of {length} points do not fit together')


@dataclass(eq=False)
class Periodogram(SideBySide):
    """The spectrum of several axes, block by block."""

    cell: int = 1    # samples in a cell of the series
    samples: int = 0
    stages: list[Stage] = field(init=False)    # the first of samples, the others of means
    series: Cells = field(init=False)    # the whole record
    segments: Segments = field(init=False)

    def begin(self) -> None:
        """Begin with nothing."""
        self.stages, self.series = [Stage(self.axes)], no_cells(self.axes)
        self.segments = Segments(self.axes)

    def absorb(self, rows: Array, run: int, first: int) -> None:
        """
        Add samples of one segment.

        `rows`, shape (axes, n): a multiple of `BLOCK` samples, or the rest of the segment.
        `first`: place of the first sample on the grid of the run.
        """
        self.samples += rows.shape[1]
        self.segments.absorb(rows, self.stages[0].add(rows))
        cells = cells_of(rows, run, first, 2**STAGE_OCTAVES)
        octaves = self.cell.bit_length() - 1 - STAGE_OCTAVES
        self.series = joined(self.series, coarser(cells, octaves) if octaves >= 0 else
                             cells_of(rows, run, first, self.cell))
        self._bound_series()
        for number in range(1, _MAX_STAGES):
            if number == len(self.stages):
                # The stage is needed once the series is coarser than its points.
                if self.samples < SERIES // 2:
                    break
                self.stages.append(Stage(self.axes))
            self.stages[number].take(cells, 2**(STAGE_OCTAVES * number))
            cells = coarser(cells, STAGE_OCTAVES)

    def _bound_series(self) -> None:
        """Make the cells larger until they are few enough."""
        # With larger cells each run would be one: of thousands of runs the oldest go.
        while len(self.series) > SERIES and self.cell <= 1 << 36:
            self.series = coarser(self.series, 1)
            self.cell *= 2
        self.series = self.series.take(slice(-SERIES, None))

    def renumber_runs(self) -> int:
        """Give the runs numbers without holes; return how many numbers that takes at most."""
        self.series, most = renumbered(self.series)
        for stage in self.stages:
            stage.waiting, count = renumbered(stage.waiting)
            most = max(most, count)
        return most

    def finish(self) -> None:
        """Transform what waits in every stage: the record has ended."""
        for number, stage in enumerate(self.stages):
            stage.finish(2**(STAGE_OCTAVES * number))

    def sections(self) -> list[SpectrumSection]:
        """Return the spectrum from the slowest to the fastest part, without overlap."""
        top = 0.5 if self.cell == 1 else HIGHEST_OF_MEANS
        found = [whole_section(points, self.cell, top, gaps, start)
                 for points, gaps, start in unbroken(self.series, self.cell)]
        if self.cell == 1:
            return found
        border = top / self.cell
        for i, stage in reversed([*enumerate(self.stages)]):
            step = 2**(STAGE_OCTAVES * i)
            if step >= self.cell:
                continue
            low = max(border * step, _LOWEST if i + 1 < len(self.stages) else 0)
            high = HIGHEST_OF_MEANS if i else 0.5
            for length, own in sorted(stage.sums.items(), reverse=True):
                # Never empty: `low` is at most an eighth, a block has at least 16 points.
                first = max(1, int(np.ceil(2 * length * low)))
                last = int(np.ceil(2 * length * high))
                found.append(SpectrumSection(step, length, own.blocks, first, last,
                                             own.power / own.blocks, gaps=own.gaps))
            border = max(border, _LOWEST / step)
        return found

    def shift_cells(self, values: Array) -> None:
        """Add values to all samples of the cells of the series, for their shape (axes, cells)."""
        series = self.series
        self.series = replace(series, sums=series.sums + values * series.counts)

    def merge(self, other: 'Periodogram', runs: int) -> None:
        """Add another finished record, whose runs are counted on from `runs`."""
        self.segments.merge(other.segments)
        self.stages += [Stage(self.axes) for _ in other.stages[len(self.stages):]]
        for mine, theirs in zip(self.stages, other.stages, strict=False):
            mine.merge(theirs)
        cell = max(self.cell, other.cell)
        octaves = cell.bit_length()
        self.series = joined(
            coarser(self.series, octaves - self.cell.bit_length()),
            moved(coarser(other.series, octaves - other.cell.bit_length()), runs))
        self.cell = cell
        self._bound_series()
        self.samples += other.samples

    def check(self) -> None:
        """Raise ValueError where fields that were saved do not belong together."""
        self.series.check(self.axes)
        if (self.cell < 1 or self.cell & (self.cell - 1)
                or not 1 <= len(self.stages) <= _MAX_STAGES
                or any(part.axes != self.axes for part in (self.segments, *self.stages))):
            raise ValueError('parts of the spectrum do not fit together')


def unbroken(cells: Cells, size: int) -> list[tuple[Array, Gaps, int]]:
    """
    Cut cells into parts whose gaps are few enough to be filled.

    `cells`: in order of time. `size`: samples in a full cell; those less than half full are left
    out, and so are a few that lie alone beyond a gap. Returns: points, shape (axes, n), of each
    part of at least `SHORTEST` of them, what filling its gaps did to noise, and the samples before
    the first; runs are joined end to end.
    """
    whole = cells.take(cells.counts >= size / 2)
    place = end_to_end(whole.keys) * size
    runs = whole.keys >> RUN_SHIFT
    parts = [without_islands(whole.take(runs == run)) for run in np.unique(runs)]
    found: list[tuple[Array, Gaps, int]] = []
    while parts:
        part = parts.pop(0)
        if len(part) < SHORTEST:
            continue
        span = int(part.keys[-1] - part.keys[0]) + 1
        # Beyond, the lines over the gaps are most of the record; what they do to noise is known.
        if 1 - len(part) / span <= 0.5:
            start = int(place[np.searchsorted(whole.keys, part.keys[0])])
            found.append((filled(part), noise_through_gaps(part, size), start))
        else:
            widest = int(np.argmax(np.diff(part.keys))) + 1
            parts[:0] = [part.take(slice(None, widest)), part.take(slice(widest, None))]
    return found
