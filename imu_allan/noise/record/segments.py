# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The spectrum of each part of a record, in constant memory.

A record is split into at most 16 segments of equal length. When all are in use, neighbours are
added in pairs and the length doubles. A segment keeps the power of its blocks in bands of an
eighth of an octave. Lower frequencies are not kept here; when needed, they are computed from the
cells of the whole-record series that belong to a segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES, EqualParts, numbers
import numpy as np
from scipy.fft import dct

SEGMENTS = 16
"""Most segments: quarters of a record consist of whole segments, and each segment still has many
blocks."""
BLOCK = 4096
"""Points of a whole block."""
SHORTEST_SEGMENT = 4 * BLOCK
"""Initial length of a segment in samples, the number that the estimator processes at once: 0.8 MB
for six axes."""
OCTAVES = 12
"""The slowest band begins at 2**-12 cycles per sample; lower frequencies are in the series."""
PER_OCTAVE = 8
"""Bands per octave. A line costs three: wider bands lose more, narrower ones scatter more."""
BANDS = PER_OCTAVE * (OCTAVES - 1)
"""Number of bands: the fastest octave ends at half the sample rate."""
MEANS = 16
"""Points whose mean is a point of the next stage of the spectrum, and of the slower transform."""
TRANSFORMS = ((SHORTEST_SEGMENT // MEANS, MEANS), (BLOCK, 1))
"""Points, and samples per point, of the transforms for the slower and the faster bands."""


class Layout(NamedTuple):
    """Assignment of the coefficients of a block to bands."""

    # DCT indices from `first` up to, but not including, `last`
    first: int
    last: int
    starts: Ints    # (bands,): first coefficient of each band, minus `first`
    bands: Ints    # (bands,): numbers of the bands
    counts: Ints    # (bands,): number of coefficients in each band

    def means(self, values: Array) -> Array:
        """Average over the coefficients of each band, along the first dimension."""
        sums = np.add.reduceat(values, self.starts, axis=0)
        return np.asarray(sums / self.counts.reshape(-1, *[1] * (values.ndim - 1)))


@lru_cache(maxsize=64)
def layout(length: int, step: int) -> Layout:
    """
    Assign the coefficients of a block to bands.

    `length`: points of the block. `step`: samples in a point, 1 or `MEANS`.
    """
    # The slower transform ends at a quarter of its own rate.
    border = 1 / (4 * MEANS)
    low, high = (border, 0.5) if step == 1 else (2.0**-OCTAVES, border)
    # Leakage from the ends of a block affects the lower coefficients.
    first = max(8, int(np.ceil(2 * length * step * low)))
    last = min(length, int(np.ceil(2 * length * step * high)))
    index = np.arange(first, last)
    # A power of two is the lower edge of its band, without rounding errors.
    band = np.floor(PER_OCTAVE * (np.log2(index / (2 * length * step)) + OCTAVES)).astype(np.int64)
    starts = np.flatnonzero(np.diff(band, prepend=-1))
    return Layout(first, last, starts, band[starts], np.diff(np.append(starts, len(band))))


@dataclass(eq=False)
class Segments(EqualParts):
    """Power by segment and band."""

    width: int = SHORTEST_SEGMENT    # samples in a whole segment, not counting gaps
    samples: int = 0    # number of samples added
    # (axes, SEGMENTS, bands): sum of squared orthonormal DCT-II coefficients, in squared
    # sample units
    power: Array = field(init=False, metadata=numbers(AXES, SEGMENTS, BANDS))
    # (SEGMENTS, bands): number of coefficients added
    dof: Ints = field(init=False, metadata=numbers(SEGMENTS, BANDS, dtype=np.int64))

    @property
    def used(self) -> int:
        """Return the number of segments with samples; the last one may be incomplete."""
        return -(-self.samples // self.width)

    def absorb(self, rows: Array, blocks: Sequence[tuple[int, int, Array]]) -> None:
        """
        Add the next samples.

        `rows`, shape (axes, n): at most `SHORTEST_SEGMENT` consecutive samples. `blocks`: length,
        number and summed power, shape (axes, length), of their blocks.
        """
        n = rows.shape[1]
        while self.samples + n > SEGMENTS * self.width:
            self.widen()
        at = (self.samples + n // 2) // self.width
        for length, count, power in blocks:
            # Shorter blocks, at the end of a segment, have under five octaves of coefficients.
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
