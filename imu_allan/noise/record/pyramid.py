# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Sums of squared second differences of phase at octave cluster sizes, in constant memory.

A second difference of phase over clusters of m samples is the difference of two neighbouring sums
of m samples, and a sum over 2 m is that of two sums over m. Sums that slide over every sample give
the cluster sizes 1, 2, 4 and 8 at full overlap. From there on sums of 8 2^L samples, each 2^L
samples further on, give the cluster size 8 2^L with eight-fold overlap, which keeps 98 to 100 % of
the equivalent degrees of freedom, and by every other pair of neighbours those of the next stage.

References
----------
D. A. Howe, D. W. Allan, J. A. Barnes, "Properties of signal sources and measurement methods", 1981
(overlapping Allan variance); D. B. Percival and P. Guttorp, 1994 (pyramids of differences).

"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OVERLAP_OCTAVE = 3
"""8-fold overlap keeps 98 % of the degrees of freedom of white noise, 4-fold 93, 16-fold 99.5."""
OVERLAP = 2**OVERLAP_OCTAVE    # places of a cluster within its length
_TAIL = 2 * OVERLAP - 1
"""Samples that the next differences reach back to."""
_ONE_THREAD = 8192
"""Longest product that no BLAS shares out among threads: sums then do not depend on how many."""
_MAX_STAGES = 48
"""2**48 samples: 8,900 years at 1 kHz. Bounds what a state file may claim."""


class Pyramid:
    """
    Octave sums of squared second differences of several axes.

    Parameters
    ----------
    axes : int
        How many axes are kept side by side.

    Attributes
    ----------
    sums : ndarray, shape (octaves, axes)
        Sum of squared second differences of phase at cluster size ``2**octave``, in squared
        sample units.
    counts : ndarray of int64, shape (octaves,)
        How many differences each sum holds.

    """

    def __init__(self, axes: int) -> None:
        self.sums: Array = np.zeros((OVERLAP_OCTAVE + 1, axes))
        self.counts: NDArray[np.int64] = np.zeros(OVERLAP_OCTAVE + 1, dtype=np.int64)
        self._newest: Array = np.zeros((axes, 0))   # the last samples
        # Of sums of `OVERLAP` samples, and of every stage behind: whether their number is odd,
        # and of those behind the last ones.
        self._odd: list[int] = [0]
        self._tails: list[Array] = []
        self._work: Array = np.empty((3, axes, 0))

    def start_stretch(self) -> None:
        """Forget the last samples: no difference is taken across this point."""
        self._newest = np.zeros((self.sums.shape[1], 0))
        self._tails, self._odd = [self._newest] * len(self._tails), [0] * len(self._odd)

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples of the stretch.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)
            In the unit of a sample.

        """
        known, n = self._newest.shape[1], rows.shape[1]
        # What is read lies in one of the last two arrays, what is written in the other.
        room = self._room(known + n)
        window = room[2][:, :known + n]
        window[:, :known], window[:, known:] = self._newest, rows
        self._newest = window[:, -_TAIL:].copy()
        for octave in range(OVERLAP_OCTAVE):
            m = 2**octave
            # Differences that end at a sample already seen have been counted.
            self._add(octave, window, m, n)
            left = max(window.shape[1] - m, 0)
            window = np.add(window[:, m:], window[:, :left], out=room[1 + octave % 2][:, :left])
        track, new = window, min(n, window.shape[1])
        for stage in range(_MAX_STAGES):
            known, end = track.shape[1] - new, max(track.shape[1] - OVERLAP, 0)
            first = end - self._add(OVERLAP_OCTAVE + stage, track, OVERLAP, new)
            # Every other pair, counted from the beginning of the stretch.
            every = slice(first + (self._odd[stage] + known + first) % 2, end, 2)
            low, high = track[:, every], track[:, OVERLAP:][:, every]
            self._odd[stage] = (self._odd[stage] + new) % 2
            new = low.shape[1]
            if not new:
                break
            if stage == len(self._tails):
                self._grow(stage + 1)
            known = self._tails[stage].shape[1]
            track = room[2 - stage % 2][:, :known + new]
            track[:, :known] = self._tails[stage]
            np.add(low, high, out=track[:, known:])
            self._tails[stage] = track[:, -OVERLAP:].copy()

    def _add(self, octave: int, track: Array, apart: int, new: int) -> int:
        """Add the differences of values `apart` that end at one of the `new` last; count them."""
        left = max(track.shape[1] - apart, 0)
        new = min(new, left)
        if new:
            d = np.subtract(track[:, left + apart - new:], track[:, left - new:left],
                            out=self._work[0][:, :new])
            self.sums[octave] += _square_sums(d)
            self.counts[octave] += new
        return new

    def _room(self, length: int) -> Array:
        """Return working memory for differences, sums, and the sums made of them."""
        if self._work.shape[2] < length:
            self._work = np.empty((3, self.sums.shape[1], length))
        return self._work

    def _grow(self, stages: int) -> None:
        """Make room for more stages."""
        axes, more = self.sums.shape[1], stages - len(self._tails)
        self._tails += [np.zeros((axes, 0))] * more
        self._odd += [0] * more
        self.sums = np.concatenate((self.sums, np.zeros((more, axes))))
        self.counts = np.append(self.counts, np.zeros(more, dtype=np.int64))

    def copy(self) -> 'Pyramid':
        """Return an independent copy."""
        twin = Pyramid.__new__(Pyramid)
        twin.sums, twin.counts, twin._newest = self.sums.copy(), self.counts.copy(), self._newest
        twin._tails, twin._odd = list(self._tails), list(self._odd)
        twin._work = self._work[:, :, :0]
        return twin

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        self.sums, self._newest = self.sums[:, axes], self._newest[axes]
        self._tails = [tail[axes] for tail in self._tails]
        self._work = np.empty((3, len(axes), 0))

    def merge(self, other: 'Pyramid') -> None:
        """Add the sums of another record of the same axes."""
        self._grow(max(len(self._tails), len(other._tails)))
        octaves = len(other.counts)
        self.sums[:octaves] += other.sums
        self.counts[:octaves] += other.counts
        self.start_stretch()

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """Return the state as plain arrays."""
        tails = np.zeros((len(self._tails), self.sums.shape[1], OVERLAP))
        for padded, tail in zip(tails, self._tails, strict=True):
            padded[:, :tail.shape[1]] = tail
        return {
            'sums': self.sums.copy(), 'counts': self.counts.copy(), 'newest': self._newest,
            'odd': np.array(self._odd), 'clusters': tails,
            'lengths': np.array([tail.shape[1] for tail in self._tails], dtype=np.int64),
        }

    @classmethod
    def from_state(cls, state: dict[str, NDArray[np.generic]]) -> 'Pyramid':
        """
        Return the pyramid that `to_state` described.

        Raises
        ------
        KeyError, ValueError
            If the state is not one of a pyramid.

        """
        self = cls.__new__(cls)
        self.sums = np.array(state['sums'], dtype=np.float64)
        self.counts = np.array(state['counts'], dtype=np.int64)
        self._newest = np.array(state['newest'], dtype=np.float64)
        tails = np.array(state['clusters'], dtype=np.float64)
        lengths = np.array(state['lengths'], dtype=np.int64)
        odd = np.array(state['odd'], dtype=np.int64)
        stages, axes = len(lengths), self.sums.shape[-1]
        if (self.sums.shape != (OVERLAP_OCTAVE + 1 + stages, axes) or stages >= _MAX_STAGES
                or self.counts.shape != self.sums.shape[:1]
                or self._newest.ndim != 2 or len(self._newest) != axes
                or self._newest.shape[1] > _TAIL or tails.shape != (stages, axes, OVERLAP)
                or lengths.shape != (stages,) or np.any((lengths < 0) | (lengths > OVERLAP))
                or odd.shape != (stages + 1,) or np.any((odd < 0) | (odd > 1))):
            raise ValueError('arrays of the pyramid do not fit together')
        self._tails = [tail[:, :n].copy() for tail, n in zip(tails, lengths, strict=True)]
        self._odd = odd.tolist()
        self._work = np.empty((3, axes, 0))
        return self


def _square_sums(rows: Array) -> Array:
    """Sum of the squares of each row, shape (axes,): a quarter of the time of an einsum."""
    sums = np.zeros(len(rows))
    for begin in range(0, rows.shape[1], _ONE_THREAD):
        part = rows[:, begin:begin + _ONE_THREAD]
        sums += (part[:, None, :] @ part[:, :, None])[:, 0, 0]
    return sums
