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

from dataclasses import dataclass, replace
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
from imu_allan.noise.record.segments import Segments
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

BLOCK = 4096
"""Points of a whole block."""
STAGE_OCTAVES = 6
"""A stage sees means of 2**6 points of the stage before."""
SERIES = 8192
"""The most cells of the whole-record series."""
SHORTEST = 16
"""Points of the shortest block: the rest of a stretch is cut into blocks of powers of two."""

_MAX_STAGES = 4
"""Means of 2**18 samples in the slowest: at 1 kHz its blocks last for twelve days."""
_LOWEST = 32 / (2 * BLOCK)
"""A block leaves its first 32 coefficients to the next stage, which resolves them better."""
HIGHEST_OF_MEANS = 0.25
"""Of their own rate: means fold what is faster, the more the nearer to half of it."""
_MAX_FILLED_SHARE = 0.5
"""Beyond, the lines over the gaps are most of the record; what they do to noise is known."""


@dataclass(frozen=True)
class SpectrumPiece:
    """
    Part of the spectrum.

    Attributes
    ----------
    step : int
        Samples averaged into one point.
    length : int
        Points of a block.
    blocks : int
        How many blocks were averaged.
    first, last : int
        The DCT indices, `first` up to and without `last`, that this piece is good for.
    power : ndarray, shape (axes, length)
        Mean squared orthonormal DCT-II coefficients by index, in squared sample units.
    coefficients : ndarray or None, shape (axes, length)
        The coefficients themselves where the piece is one block.
    gaps : Gaps
        What missing samples do to noise.
    start : int
        Of one block: samples from the beginning of the record to its first point; runs are laid
        end to end.

    """

    step: int
    length: int
    blocks: int
    first: int
    last: int
    power: Array
    coefficients: Array | None = None
    gaps: Gaps = NO_GAPS
    start: int = 0

    def spacing_hz(self, dt: float) -> float:
        """Return how far apart the frequencies of its coefficients are."""
        return 1 / (2 * self.length * self.step * dt)


class BlockPower:
    """Sums of squared DCT-II coefficients over blocks, by block length."""

    def __init__(self, axes: int) -> None:
        self.axes = axes
        self.power: dict[int, Array] = {}
        self.blocks: dict[int, int] = {}
        self.excess: dict[int, float] = {}

    def add(self, rows: Array, variance: Array | None = None) -> list[tuple[int, int, Array]]:
        """
        Cut consecutive points into the longest blocks and add them.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)
            The points of every axis.
        variance : ndarray, shape (n,), optional
            Variance of white noise in each point over that of a full one.

        Returns
        -------
        list of (int, int, ndarray)
            Length, number and summed power, shape (axes, length), of what was added.

        """
        added = []
        start, length = 0, BLOCK
        while length >= SHORTEST:
            count = (rows.shape[1] - start) // length
            if count:
                part = rows[:, start:start + count * length].reshape(self.axes, count, length)
                coefficients = dct(part, norm='ortho')
                power = np.einsum('ijk,ijk->ik', coefficients, coefficients)
                if length in self.power:
                    self.power[length] += power
                    self.blocks[length] += count
                else:
                    self.power[length], self.blocks[length] = power.copy(), count
                if variance is not None:
                    more = variance[start:start + count * length] - 1
                    self.excess[length] = self.excess.get(length, 0.0) + float(more.sum()) / length
                added.append((length, count, power))
                start += count * length
            length //= 2
        return added

    def copy(self) -> 'BlockPower':
        """Return an independent copy."""
        twin = BlockPower(self.axes)
        twin.power = {length: power.copy() for length, power in self.power.items()}
        twin.blocks, twin.excess = dict(self.blocks), dict(self.excess)
        return twin

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        self.axes = len(axes)
        self.power = {length: power[axes] for length, power in self.power.items()}

    def gaps(self, length: int) -> Gaps:
        """Tell what half-full points do to the white noise in the blocks of one length."""
        excess = self.excess.get(length, 0.0)
        return (Gaps(0.0, np.full(length, 1 + excess / self.blocks[length])) if excess
                else NO_GAPS)

    def merge(self, other: 'BlockPower') -> None:
        """Add the sums of another record."""
        for length, power in other.power.items():
            self.power[length] = self.power.get(length, 0) + power
            self.blocks[length] = self.blocks.get(length, 0) + other.blocks[length]
        for length, excess in other.excess.items():
            self.excess[length] = self.excess.get(length, 0.0) + excess


class MeansStage:
    """Blocks of means: one slower stage of the spectrum."""

    def __init__(self, axes: int) -> None:
        self.power = BlockPower(axes)
        self.waiting = no_cells(axes)

    def add(self, cells: Cells, size: int) -> None:
        """Add cells of `size` samples; the last one waits, since it may still grow."""
        self.waiting = joined(self.waiting, cells)
        if len(self.waiting) > BLOCK + SHORTEST:
            self._transform(size, all_of_it=False)

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
            stretch = held.take(slice(begin, end))
            points, variance = stretch.means, size / stretch.counts
            if end < len(held) or all_of_it:
                self.power.add(points, variance)
            else:
                # The stretch goes on: only whole blocks are taken now.
                whole = points.shape[1] // BLOCK * BLOCK
                self.power.add(points[:, :whole], variance[:whole])
                rest = stretch.take(stretch.keys - stretch.keys[0] >= whole)
                self.waiting = joined(rest, growing)

    def finish(self, size: int) -> None:
        """Transform what waits."""
        if len(self.waiting):
            self._transform(size, all_of_it=True)


class Periodogram:
    """
    The spectrum of several axes, block by block.

    Parameters
    ----------
    axes : int

    """

    def __init__(self, axes: int) -> None:
        self.axes = axes
        self.power = BlockPower(axes)
        self.means: list[MeansStage] = []
        self.series = no_cells(axes)
        self.segments = Segments(axes)
        self.cell = 1
        self.samples = 0

    def absorb(self, rows: Array, run: int, first: int) -> None:
        """
        Add samples of one stretch.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)
            A multiple of `BLOCK` samples, or the rest of the stretch.
        run : int
            Number of the run.
        first : int
            Place of the first sample on the grid of the run.

        """
        self.samples += rows.shape[1]
        self.segments.absorb(rows, self.power.add(rows))
        cells = cells_of(rows, run, first, 2**STAGE_OCTAVES)
        octaves = self.cell.bit_length() - 1 - STAGE_OCTAVES
        self.series = joined(self.series, coarser(cells, octaves) if octaves >= 0 else
                             cells_of(rows, run, first, self.cell))
        while len(self.series) > SERIES:
            if self.cell > 1 << 36:
                # Thousands of runs of a few samples each: the oldest go.
                self.series = self.series.take(slice(-SERIES, None))
                break
            self.series = coarser(self.series, 1)
            self.cell *= 2
        for stage in range(_MAX_STAGES - 1):
            if stage == len(self.means):
                # The stage is needed once the series is coarser than its points.
                if self.samples < SERIES // 2:
                    break
                self.means.append(MeansStage(self.axes))
            self.means[stage].add(cells, 2**(STAGE_OCTAVES * (stage + 1)))
            cells = coarser(cells, STAGE_OCTAVES)

    def renumber_runs(self) -> int:
        """Give the runs numbers without holes; return how many numbers that takes at most."""
        self.series, most = renumbered(self.series)
        for stage in self.means:
            stage.waiting, count = renumbered(stage.waiting)
            most = max(most, count)
        return most

    def finish(self) -> None:
        """Transform what waits in every stage: the record has ended."""
        for i, stage in enumerate(self.means):
            stage.finish(2**(STAGE_OCTAVES * (i + 1)))

    def pieces(self) -> list[SpectrumPiece]:
        """
        Return the spectrum from the slowest to the fastest part, without overlap.

        Returns
        -------
        list of SpectrumPiece

        """
        top = 0.5 if self.cell == 1 else HIGHEST_OF_MEANS
        found = []
        for points, gaps, start in unbroken(self.series, self.cell):
            length = points.shape[1]
            coefficients = dct(points, norm='ortho')
            last = length if self.cell == 1 else int(np.ceil(2 * length * top))
            found.append(SpectrumPiece(self.cell, length, 1, 1, last, coefficients**2,
                                       coefficients, gaps, start))
        if self.cell == 1:
            return found
        border = top / self.cell
        stages = [self.power, *(stage.power for stage in self.means)]
        for i in reversed(range(len(stages))):
            step = 2**(STAGE_OCTAVES * i)
            if step >= self.cell:
                continue
            low = max(border * step, _LOWEST if i + 1 < len(stages) else 0)
            high = HIGHEST_OF_MEANS if i else 0.5
            for length, power in sorted(stages[i].power.items(), reverse=True):
                # Never empty: `low` is at most an eighth, a block has at least 16 points.
                first = max(1, int(np.ceil(2 * length * low)))
                last = int(np.ceil(2 * length * high))
                blocks = stages[i].blocks[length]
                found.append(SpectrumPiece(step, length, blocks, first, last, power / blocks,
                                           gaps=stages[i].gaps(length)))
            border = max(border, _LOWEST / step)
        return found

    def copy(self) -> 'Periodogram':
        """Return an independent copy."""
        twin = Periodogram(self.axes)
        twin.power, twin.segments = self.power.copy(), self.segments.copy()
        for stage in self.means:
            copied = MeansStage(self.axes)
            copied.power, copied.waiting = stage.power.copy(), stage.waiting
            twin.means.append(copied)
        twin.series, twin.cell, twin.samples = self.series, self.cell, self.samples
        return twin

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        self.axes = len(axes)
        self.power.keep(axes)
        self.segments.keep(axes)
        self.series = replace(self.series, sums=self.series.sums[axes])
        for stage in self.means:
            stage.power.keep(axes)
            stage.waiting = replace(stage.waiting, sums=stage.waiting.sums[axes])

    def shift(self, values: Array) -> None:
        """Add a value to all samples of every axis, shape (axes,), of a finished record."""
        series = self.series
        self.series = replace(series, sums=series.sums + values[:, None] * series.counts)

    def shift_cells(self, values: Array) -> None:
        """Add a value to each cell of the series of all axes, shape (cells,)."""
        series = self.series
        self.series = replace(series, sums=series.sums + values * series.counts)

    def merge(self, other: 'Periodogram', runs: int) -> None:
        """Add another finished record, whose runs are counted on from `runs`."""
        self.power.merge(other.power)
        self.segments.merge(other.segments)
        for i, stage in enumerate(other.means):
            if i == len(self.means):
                self.means.append(MeansStage(self.axes))
            self.means[i].power.merge(stage.power)
        cell = max(self.cell, other.cell)
        octaves = cell.bit_length()
        mine = coarser(self.series, octaves - self.cell.bit_length())
        theirs = coarser(other.series, octaves - other.cell.bit_length())
        self.series, self.cell = joined(mine, moved(theirs, runs)), cell
        while len(self.series) > SERIES and self.cell <= 1 << 36:
            self.series = coarser(self.series, 1)
            self.cell *= 2
        self.samples += other.samples

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """Return the state as plain arrays."""
        state: dict[str, NDArray[np.generic]] = {
            'shape': np.array([self.axes, self.cell, self.samples, len(self.means)]),
            **_cells_state('series', self.series),
            **{f'segments/{key}': value for key, value in self.segments.to_state().items()},
        }
        for i, power in enumerate([self.power, *(stage.power for stage in self.means)]):
            for length, sums in power.power.items():
                state[f'power{i}/{length}'] = sums.copy()
                state[f'blocks{i}/{length}'] = np.array(power.blocks[length])
                state[f'excess{i}/{length}'] = np.array(power.excess.get(length, 0.0))
        for i, stage in enumerate(self.means):
            state.update(_cells_state(f'waiting{i}', stage.waiting))
        return state

    @classmethod
    def from_state(cls, state: dict[str, NDArray[np.generic]]) -> 'Periodogram':
        """
        Return the periodogram that `to_state` described.

        Raises
        ------
        KeyError, ValueError
            If the state is not one of a periodogram.

        """
        axes, cell, samples, stages = (int(value) for value in state['shape'])
        if not 1 <= axes <= 64 or cell < 1 or cell & (cell - 1) or not 0 <= stages < _MAX_STAGES:
            raise ValueError('shape of the periodogram is out of range')
        self = cls(axes)
        self.cell, self.samples = cell, samples
        self.series = _cells_from(state, 'series', axes)
        self.segments = Segments.from_state({
            key.partition('/')[2]: value for key, value in state.items()
            if key.startswith('segments/')})
        if len(self.segments.power) != axes:
            raise ValueError('segments have the wrong shape')
        self.means = [MeansStage(axes) for _ in range(stages)]
        for i, stage in enumerate(self.means):
            stage.waiting = _cells_from(state, f'waiting{i}', axes)
        powers = [self.power, *(stage.power for stage in self.means)]
        for key, value in state.items():
            name, _, text = key.partition('/')
            if not name.startswith('power') or not text:
                continue
            power, length = powers[int(name[5:])], int(text)
            sums = np.array(value, dtype=np.float64)
            if sums.shape != (axes, length) or length not in _LENGTHS:
                raise ValueError(f'{key} has the wrong shape')
            power.power[length] = sums
            power.blocks[length] = int(state[f'blocks{name[5:]}/{length}'])
            excess = float(state[f'excess{name[5:]}/{length}'])
            if not 0 <= excess <= power.blocks[length]:
                raise ValueError(f'excess{name[5:]}/{length} is out of range')
            if excess:
                power.excess[length] = excess
        return self


def unbroken(cells: Cells, size: int) -> list[tuple[Array, Gaps, int]]:
    """
    Cut cells into parts whose gaps are few enough to be filled.

    Parameters
    ----------
    cells : Cells
        In order of time.
    size : int
        Samples in a full cell; those less than half full are left out, and so are a few that lie
        alone beyond a gap.

    Returns
    -------
    list of (ndarray, Gaps, int)
        Points, shape (axes, n), of each part of at least `SHORTEST` of them, what filling its gaps
        did to noise, and the samples before the first; runs are laid end to end.

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
        if 1 - len(part) / span <= _MAX_FILLED_SHARE:
            start = int(place[np.searchsorted(whole.keys, part.keys[0])])
            found.append((filled(part), noise_through_gaps(part, size), start))
        else:
            widest = int(np.argmax(np.diff(part.keys))) + 1
            parts[:0] = [part.take(slice(None, widest)), part.take(slice(widest, None))]
    return found


_LENGTHS = {2**i for i in range(SHORTEST.bit_length() - 1, BLOCK.bit_length())}


def _cells_state(name: str, cells: Cells) -> dict[str, NDArray[np.generic]]:
    return {f'{name}/keys': cells.keys, f'{name}/sums': cells.sums,
            f'{name}/counts': cells.counts}


def _cells_from(state: dict[str, NDArray[np.generic]], name: str, axes: int) -> Cells:
    keys = np.array(state[f'{name}/keys'], dtype=np.int64)
    sums = np.array(state[f'{name}/sums'], dtype=np.float64)
    counts = np.array(state[f'{name}/counts'], dtype=np.int64)
    if keys.ndim != 1 or sums.shape != (axes, len(keys)) or counts.shape != keys.shape:
        raise ValueError(f'{name} has the wrong shape')
    if np.any(np.diff(keys) <= 0) or np.any(counts < 1):
        raise ValueError(f'{name} is out of order')
    return Cells(keys, sums, counts)
