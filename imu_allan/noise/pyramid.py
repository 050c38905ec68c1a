# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Sums of squared second differences of phase at octave cluster sizes, in constant memory.

A second difference of phase over clusters of m samples is the difference of two neighbouring sums
of m samples, and a sum over 2 m is that of two sums over m. Stage 0 slides such sums over every
sample and takes the cluster sizes 1, 2, 4 and 8 at full overlap; stage L sees sums of 2^L samples
side by side and takes the cluster size 8 2^L with eight-fold overlap, which keeps 98 to 100 % of
the equivalent degrees of freedom.

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
"""Values of a stage that the next differences reach back to."""
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
        # By stage: the last values it saw, and whether the very last waits for its partner.
        self._tails: list[Array] = [np.zeros((axes, 0))]
        self._odd: list[int] = [0]
        self._work: Array = np.empty((5, axes, 0))

    def start_stretch(self) -> None:
        """Forget the last samples: no difference is taken across this point."""
        nothing = np.zeros((self.sums.shape[1], 0))
        self._tails = [nothing] * len(self._tails)
        self._odd = [0] * len(self._odd)

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples of the stretch.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)
            In the unit of a sample.

        """
        values, stage = rows, 0
        while values.shape[1] and stage < _MAX_STAGES:
            if stage == len(self._tails):
                self._grow(stage + 1)
            known, n = self._tails[stage].shape[1], values.shape[1]
            room = self._room(known + n)
            track = room[0][:, :known + n]
            track[:, :known], track[:, known:] = self._tails[stage], values
            window = track
            for octave in range(OVERLAP_OCTAVE + 1):
                m = 2**octave
                left = window.shape[1] - m
                if left <= 0:
                    break
                if octave == OVERLAP_OCTAVE or stage == 0:
                    # Differences that end at a value already seen have been counted.
                    new = min(n, left)
                    d = np.subtract(window[:, left + m - new:], window[:, left - new:left],
                                    out=room[1][:, :new])
                    self.sums[octave + stage] += _square_sums(d)
                    self.counts[octave + stage] += new
                if octave < OVERLAP_OCTAVE:
                    window = np.add(window[:, m:], window[:, :left],
                                    out=room[2 + octave][:, :left])
            self._tails[stage] = track[:, -_TAIL:].copy()
            # Every other sum of two, from the one that takes in the value left over.
            pairs, left_over = divmod(self._odd[stage] + n, 2)
            first = known - self._odd[stage]
            values = room[2][:, first:first + 2 * pairs:2]
            self._odd[stage] = left_over
            stage += 1

    def _room(self, length: int) -> Array:
        """Return working memory for five arrays of `length` columns."""
        if self._work.shape[2] < length:
            self._work = np.empty((5, self.sums.shape[1], length))
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
        twin.sums, twin.counts = self.sums.copy(), self.counts.copy()
        twin._tails, twin._odd = list(self._tails), list(self._odd)
        twin._work = self._work[:, :, :0]
        return twin

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        self.sums = self.sums[:, axes]
        self._tails = [tail[axes] for tail in self._tails]
        self._work = np.empty((5, len(axes), 0))

    def merge(self, other: 'Pyramid') -> None:
        """Add the sums of another record of the same axes."""
        self._grow(max(len(self._tails), len(other._tails)))
        octaves = len(other.counts)
        self.sums[:octaves] += other.sums
        self.counts[:octaves] += other.counts
        self.start_stretch()

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """Return the state as plain arrays."""
        stages, axes = len(self._tails), self.sums.shape[1]
        tails = np.zeros((stages, axes, _TAIL))
        for padded, tail in zip(tails, self._tails, strict=True):
            padded[:, :tail.shape[1]] = tail
        return {
            'sums': self.sums, 'counts': self.counts, 'tails': tails,
            'lengths': np.array([(tail.shape[1], odd)
                                 for tail, odd in zip(self._tails, self._odd, strict=True)]),
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
        tails = np.array(state['tails'], dtype=np.float64)
        lengths = np.array(state['lengths'], dtype=np.int64)
        stages = len(lengths)
        if (self.sums.ndim != 2 or tails.shape != (stages, self.sums.shape[1], _TAIL)
                or lengths.shape != (stages, 2) or np.any((lengths < 0) | (lengths > (_TAIL, 1)))
                or np.any(lengths[:, 1] > lengths[:, 0])
                or self.counts.shape != (stages + OVERLAP_OCTAVE,)
                or len(self.sums) != len(self.counts)):
            raise ValueError('arrays of the pyramid do not fit together')
        self._tails = [tail[:, :n].copy() for tail, n in zip(tails, lengths[:, 0], strict=True)]
        self._odd = lengths[:, 1].tolist()
        self._work = np.empty((5, self.sums.shape[1], 0))
        return self


def _square_sums(rows: Array) -> Array:
    """Sum of the squares of each row, shape (axes,): a quarter of the time of an einsum."""
    sums = np.zeros(len(rows))
    for begin in range(0, rows.shape[1], _ONE_THREAD):
        part = rows[:, begin:begin + _ONE_THREAD]
        sums += (part[:, None, :] @ part[:, :, None])[:, 0, 0]
    return sums
