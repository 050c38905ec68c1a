# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The spectrum of every part of a record, in constant memory.

A record is cut into at most 16 segments of equal length; when they are used up, neighbours are
added in pairs and the length doubles. A segment keeps the power of its blocks in bands of an
eighth of an octave. What is slower than a block is not kept here: the whole-record series has it,
and its cells are shared out among the segments when somebody asks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from imu_allan.noise.record.side_by_side import AXES_FIRST, SideBySide
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

SEGMENTS = 16
"""Most segments: halves and quarters of a record are whole segments, and each still has many
blocks."""
BLOCK = 4096
"""Points of a whole block."""
SHORTEST_SEGMENT = 4 * BLOCK
"""Samples of a segment at first: what the estimator takes in at once."""
OCTAVES = 12
"""The slowest band begins at 2**-12 cycles per sample: the means of the series lie below it."""
PER_OCTAVE = 8
"""A line costs three of them: coarser ones lose more beside it, finer ones hold fewer degrees."""
MEANS = 64
"""Samples in a mean of the slower of two transforms, as in the first stage of the spectrum."""
TRANSFORMS = ((SHORTEST_SEGMENT // MEANS, MEANS), (BLOCK, 1))
"""Points of the two, and samples in a point: the slower bands are of the first."""
_BANDS = PER_OCTAVE * (OCTAVES - 1)
"""The fastest octave ends at half the sample rate."""
_BORDER = 1 / 256
"""Cycles per sample up to which the slower transform is used: a quarter of its sample rate."""
_LOWEST_INDEX = 8
"""Below, the ends of a block leak into its coefficients."""


class Layout(NamedTuple):
    """Which coefficients of a block fall into which band."""

    # The DCT indices, `first` up to and without `last`
    first: int
    last: int
    starts: NDArray[np.int64]    # (bands,): where each band begins, counted from `first`
    bands: NDArray[np.int64]    # (bands,): numbers of these bands
    counts: NDArray[np.int64]    # (bands,): coefficients in each

    def means(self, values: Array) -> Array:
        """Average over the coefficients of each band; the first dimension is theirs."""
        sums = np.add.reduceat(values, self.starts, axis=0)
        return np.asarray(sums / self.counts.reshape(-1, *[1] * (values.ndim - 1)))


@lru_cache(maxsize=64)
def layout(length: int, step: int) -> Layout:
    """
    Lay the coefficients of a block out on the bands.

    `length`: points of the block. `step`: samples in a point: 1, or `MEANS`.
    """
    low, high = (_BORDER, 0.5) if step == 1 else (2.0**-OCTAVES, _BORDER)
    first = max(_LOWEST_INDEX, int(np.ceil(2 * length * step * low)))
    last = min(length, int(np.ceil(2 * length * step * high)))
    index = np.arange(first, last)
    # A power of two stands at the lower end of its band, without rounding.
    band = np.floor(PER_OCTAVE * (np.log2(index / (2 * length * step)) + OCTAVES)).astype(np.int64)
    starts = np.flatnonzero(np.diff(band, prepend=-1))
    return Layout(first, last, starts, band[starts], np.diff(np.append(starts, len(band))))


@dataclass(eq=False)
class Segments(SideBySide):
    """Power by segment and band."""

    width: int = SHORTEST_SEGMENT    # samples in a whole segment; gaps do not count
    samples: int = 0    # samples taken in
    # (axes, SEGMENTS, bands): sum of squared orthonormal DCT-II coefficients, in squared
    # sample units
    power: Array = field(init=False, metadata=AXES_FIRST)
    # (SEGMENTS, bands): how many coefficients were added
    dof: NDArray[np.int64] = field(init=False)

    def begin(self) -> None:
        """Begin with nothing."""
        self.power = np.zeros((self.axes, SEGMENTS, _BANDS))
        self.dof = np.zeros((SEGMENTS, _BANDS), np.int64)

    @property
    def used(self) -> int:
        """How many segments have samples; the last one may be short."""
        return -(-self.samples // self.width)

    def absorb(self, rows: Array, blocks: Sequence[tuple[int, int, Array]]) -> None:
        """
        Add the next samples.

        `rows`, shape (axes, n): at most `SHORTEST_SEGMENT` consecutive samples. `blocks`: length,
        number and summed power, shape (axes, length), of the blocks that they make.
        """
        n = rows.shape[1]
        while self.samples + n > SEGMENTS * self.width:
            self._widen()
        at = (self.samples + n // 2) // self.width
        for length, count, power in blocks:
            # A shorter one, the rest of a segment, has under five octaves above `_LOWEST_INDEX`.
            if length >= 256:
                self._add(at, layout(length, 1), count, power)
        if n == SHORTEST_SEGMENT:
            means = rows.reshape(len(rows), n // MEANS, MEANS) @ np.full(MEANS, 1 / MEANS)
            self._add(at, layout(n // MEANS, MEANS), 1, dct(means, norm='ortho')**2)
        self.samples += n

    def _add(self, at: int, place: Layout, count: int, power: Array) -> None:
        part = power[:, place.first:place.last]
        self.power[:, at, place.bands] += np.add.reduceat(part, place.starts, axis=1)
        self.dof[at, place.bands] += count * place.counts

    def _widen(self) -> None:
        """Add neighbouring segments in pairs."""
        half = SEGMENTS // 2
        power = self.power.reshape(self.axes, half, 2, _BANDS).sum(axis=2)
        self.power = np.concatenate((power, np.zeros_like(power)), axis=1)
        dof = self.dof.reshape(half, 2, _BANDS).sum(axis=1)
        self.dof = np.concatenate((dof, np.zeros_like(dof)))
        self.width *= 2

    def merge(self, other: 'Segments') -> None:
        """Add the segments of another record behind those of this one."""
        theirs = other.copy()
        while self.width < theirs.width or self.samples + theirs.samples > SEGMENTS * self.width:
            self._widen()
        while theirs.width < self.width:
            theirs._widen()
        for number in range(theirs.used):
            # Where the first record ends within a segment, the second's are shared out by their
            # middles, so that the samples before a segment stay those of the series.
            middle = min((number + 0.5) * self.width, theirs.samples - 1)
            at = int(self.samples + middle) // self.width
            self.power[:, at] += theirs.power[:, number]
            self.dof[at] += theirs.dof[number]
        self.samples += theirs.samples

    def check(self) -> None:
        """Raise ValueError where fields that were saved do not belong together."""
        if (self.power.shape != (self.axes, SEGMENTS, _BANDS)
                or self.dof.shape != (SEGMENTS, _BANDS) or (self.dof < 0).any()
                or self.width < SHORTEST_SEGMENT or self.width & (self.width - 1)
                or not 0 <= self.samples <= SEGMENTS * self.width):
            raise ValueError('arrays of the segments do not fit together')
