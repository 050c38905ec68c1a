# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Sums of squared second differences of phase at octave cluster sizes, in constant memory.

A second difference of phase over clusters of m samples is the difference of two adjacent sums of m
samples. A sum over 2 m samples is the sum of two sums over m. Sums that slide over every sample
give the cluster sizes 1, 2, 4 and 8 at full overlap. From there on, each stage has sums of 8 2^L
samples at intervals of 2^L samples. These give the cluster size 8 2^L with eight-fold overlap,
which keeps 98 to 100 % of the equivalent degrees of freedom. Every other pair forms the next one.

References
----------
D. A. Howe, D. W. Allan, J. A. Barnes, "Properties of signal sources and measurement methods", 1981
(overlapping Allan variance); D. B. Percival and P. Guttorp, 1994 (pyramids of differences).

"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES_FIRST, AXES_SECOND, MultiAxis
import numpy as np

OVERLAP_OCTAVE = 3
"""8-fold overlap keeps 98 % of the degrees of freedom of white noise, 4-fold 93, 16-fold 99.5."""
OVERLAP = 2**OVERLAP_OCTAVE    # positions of a cluster within its own length
_MAX_STAGES = 48
"""2**48 samples, 8,900 years at 1 kHz. Limits what a state file may declare."""


@dataclass(eq=False)
class Pyramid(MultiAxis):
    """Octave sums of squared second differences of several axes."""

    # (octaves, axes): sum of squared second differences of phase at cluster size
    # ``2**octave``, in squared sample units
    sums: Array = field(init=False, metadata=AXES_SECOND)
    # (octaves,): number of differences in each sum
    counts: Ints = field(init=False)
    # (axes, n): the last samples
    newest: Array = field(init=False, metadata=AXES_FIRST)
    # Parity of the number of sums of `OVERLAP` samples, and of the sums of each later stage
    odd: list[int] = field(init=False)
    # (axes, n): last sums of the later stages
    tails: list[Array] = field(init=False, metadata=AXES_FIRST)

    def begin(self) -> None:
        """Initialize empty sums."""
        self.sums = np.zeros((OVERLAP_OCTAVE + 1, self.axes))
        self.counts = np.zeros(OVERLAP_OCTAVE + 1, dtype=np.int64)
        self.newest, self.odd, self.tails = np.zeros((self.axes, 0)), [0], []
        self._work = np.empty((3, self.axes, 0))

    def start_segment(self) -> None:
        """Discard the last samples, so that no difference is taken across this point."""
        self.newest = np.zeros((self.axes, 0))
        self.tails, self.odd = [self.newest] * len(self.tails), [0] * len(self.odd)

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples of the segment.

        `rows`, shape (axes, n): in the unit of a sample.
        """
        known, n = self.newest.shape[1], rows.shape[1]
        # Reusing memory saves a third of the time. The last two arrays alternate between input
        # and output.
        if len(self._work[0]) != self.axes or self._work.shape[2] < known + n:
            self._work = np.empty((3, self.axes, known + n))
        room = self._work
        window = room[2][:, :known + n]
        window[:, :known], window[:, known:] = self.newest, rows
        # As many previous samples as the next differences need.
        self.newest = window[:, 1 - 2 * OVERLAP:].copy()
        for octave in range(OVERLAP_OCTAVE):
            m = 2**octave
            # Only differences that end at a new sample have not been counted yet.
            self._add(octave, window, m, n)
            left = max(window.shape[1] - m, 0)
            window = np.add(window[:, m:], window[:, :left], out=room[1 + octave % 2][:, :left])
        track, new = window, min(n, window.shape[1])
        for stage in range(_MAX_STAGES):
            known, end = track.shape[1] - new, max(track.shape[1] - OVERLAP, 0)
            first = end - self._add(OVERLAP_OCTAVE + stage, track, OVERLAP, new)
            # Take every other pair, counted from the beginning of the segment.
            every = slice(first + (self.odd[stage] + known + first) % 2, end, 2)
            sums = track[:, every] + track[:, OVERLAP:][:, every]
            self.odd[stage] = (self.odd[stage] + new) % 2
            new = sums.shape[1]
            if not new:
                break
            if stage == len(self.tails):
                self._grow(stage + 1)
            track = np.concatenate((self.tails[stage], sums), axis=1)
            self.tails[stage] = track[:, -OVERLAP:].copy()

    def _add(self, octave: int, track: Array, apart: int, new: int) -> int:
        """Add differences of values `apart` that end at one of the last `new`; return how many."""
        left = max(track.shape[1] - apart, 0)
        new = min(new, left)
        if new:
            d = np.subtract(track[:, left + apart - new:], track[:, left - new:left],
                            out=self._work[0][:, :new])
            self.sums[octave] += _square_sums(d)
            self.counts[octave] += new
        return new

    def _grow(self, stages: int) -> None:
        """Extend the arrays to a number of stages."""
        more = max(stages - len(self.tails), 0)
        self.tails += [np.zeros((self.axes, 0))] * more
        self.odd += [0] * more
        self.sums = np.concatenate((self.sums, np.zeros((more, self.axes))))
        self.counts = np.append(self.counts, np.zeros(more, dtype=np.int64))

    def merge(self, other: 'Pyramid') -> None:
        """Add the sums of another record of the same axes."""
        self._grow(len(other.tails))
        octaves = len(other.counts)
        self.sums[:octaves] += other.sums
        self.counts[:octaves] += other.counts
        self.start_segment()


def _square_sums(rows: Array) -> Array:
    """Return the sum of squares of each row, shape (axes,), four times as fast as einsum."""
    sums = np.zeros(len(rows))
    # No BLAS splits products of this length over threads, so sums do not depend on their number.
    for begin in range(0, rows.shape[1], 8192):
        part = rows[:, begin:begin + 8192]
        sums += (part[:, None, :] @ part[:, :, None])[:, 0, 0]
    return sums
