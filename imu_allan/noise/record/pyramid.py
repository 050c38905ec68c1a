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
from itertools import count

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES, AXES_FIRST, MultiAxis, numbers
import numpy as np

OVERLAP_OCTAVE = 3
"""8-fold overlap keeps 98 % of the degrees of freedom of white noise, 4-fold 93, 16-fold 99.5."""
OVERLAP = 2**OVERLAP_OCTAVE    # positions of a cluster within its own length


@dataclass(eq=False)
class Pyramid(MultiAxis):
    """Octave sums of squared second differences of several axes."""

    # (octaves, axes): sum of squared second differences of phase at cluster size
    # ``2**octave``, in squared sample units
    sums: Array = field(init=False, metadata=numbers(OVERLAP_OCTAVE + 1, AXES))
    # (octaves,): number of differences in each sum
    counts: Ints = field(init=False, metadata=numbers(OVERLAP_OCTAVE + 1, dtype=np.int64))
    # (axes, n): the last samples
    newest: Array = field(init=False, metadata=numbers(AXES, 0))
    # Parity of the number of sums of `OVERLAP` samples, and of the sums of each later stage
    odd: list[int] = field(default_factory=lambda: [0])
    # (axes, n): last sums of the later stages
    tails: list[Array] = field(default_factory=list, metadata=AXES_FIRST)

    def start_segment(self) -> None:
        """Discard the last samples, so that no difference is taken across this point."""
        self.newest = np.zeros((self.axes, 0))
        self.tails, self.odd = [self.newest] * len(self.tails), [0] * len(self.odd)

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples of the segment.

        `rows`, shape (axes, n): in the unit of a sample.
        """
        # So many samples of six axes fit into the cache with their differences.
        sums = np.concatenate([self._fast_octaves(rows[:, begin:begin + 8192])
                               for begin in range(0, rows.shape[1], 8192)], axis=1)
        for stage in count(1):
            new = sums.shape[1]
            if not new:
                break
            if stage > len(self.tails):
                self.tails.append(np.zeros((self.axes, 0)))
                self.odd.append(0)
                self.sums = np.concatenate((self.sums, np.zeros((1, self.axes))))
                self.counts = np.append(self.counts, 0)
            window = np.concatenate((self.tails[stage - 1], sums), axis=1)
            self.tails[stage - 1] = window[:, -OVERLAP:].copy()
            sums = self._next_sums(stage, window, new)

    def _fast_octaves(self, rows: Array) -> Array:
        """Add the octaves of full overlap and stage 0; return the sums for stage 1."""
        window, new = np.concatenate((self.newest, rows), axis=1), rows.shape[1]
        # As many previous samples as the next differences need.
        self.newest = window[:, 1 - 2 * OVERLAP:].copy()
        for octave in range(OVERLAP_OCTAVE):
            m = 2**octave
            self._add(octave, window, m, new)
            window = window[:, m:] + window[:, :-m]
        return self._next_sums(0, window, min(new, window.shape[1]))

    def _next_sums(self, stage: int, window: Array, new: int) -> Array:
        """Add a stage, of which the last `new` sums are new; return the sums for the next one."""
        known, end = window.shape[1] - new, max(window.shape[1] - OVERLAP, 0)
        first = end - self._add(OVERLAP_OCTAVE + stage, window, OVERLAP, new)
        # Take every other pair, counted from the beginning of the segment.
        every = slice(first + (self.odd[stage] + known + first) % 2, end, 2)
        self.odd[stage] = (self.odd[stage] + new) % 2
        return np.asarray(window[:, every] + window[:, OVERLAP:][:, every])

    def _add(self, octave: int, window: Array, apart: int, new: int) -> int:
        """Add differences of values `apart` that end at one of the last `new`; return how many."""
        new = min(new, max(window.shape[1] - apart, 0))
        if new:
            last = window[:, -new - apart:]
            self.sums[octave] += _square_sums(last[:, apart:] - last[:, :-apart])
            self.counts[octave] += new
        return new


def _square_sums(rows: Array) -> Array:
    """Return the sum of squares of each row, shape (axes,), four times as fast as einsum."""
    # No BLAS splits products of 8192 numbers over threads, so sums do not depend on their number.
    return np.asarray((rows[:, None, :] @ rows[:, :, None])[:, 0, 0])
