# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Sums of squared second differences of phase at octave cluster sizes, in constant memory.

The phase is the running sum of samples. Stage 0 sees every phase point and takes the cluster
sizes 1, 2, 4 and 8 at full overlap; stage L sees every 2^L-th point and takes the cluster size
8 2^L with eight-fold overlap, which keeps 98 to 100 % of the equivalent degrees of freedom.

References
----------
D. A. Howe, D. W. Allan, J. A. Barnes, "Properties of signal sources and measurement methods", 1981
(overlapping Allan variance); D. B. Percival and P. Guttorp, 1994 (pyramids of differences).

"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OVERLAP_OCTAVE = 3
OVERLAP = 2**OVERLAP_OCTAVE
_CARRY = 2 * OVERLAP
_MAX_STAGES = 48


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
        self._carry: list[Array] = [np.zeros((axes, 1))]
        self._next: list[int] = [1]

    def start_stretch(self) -> None:
        """Forget the phase: no difference is taken across this point."""
        axes = self.sums.shape[1]
        self._carry = [np.zeros((axes, 1)) for _ in self._carry]
        self._next = [1] * len(self._next)

    def absorb(self, rows: Array) -> None:
        """
        Add the next samples of the stretch.

        Parameters
        ----------
        rows : ndarray, shape (axes, n)

        """
        points = np.cumsum(rows, axis=1)
        points += self._carry[0][:, -1:]
        stage = 0
        while points.shape[1]:
            if stage == len(self._carry):
                # A stage starts with the point at phase zero, where the stretch began.
                self._carry.append(np.zeros((rows.shape[0], 1)))
                self._next.append(1)
                self.sums = np.concatenate((self.sums, np.zeros((1, rows.shape[0]))))
                self.counts = np.append(self.counts, 0)
            carry, first = self._carry[stage], self._next[stage]
            known = carry.shape[1]
            track = np.concatenate((carry, points), axis=1)
            octaves = range(OVERLAP_OCTAVE + 1) if stage == 0 else (OVERLAP_OCTAVE,)
            for octave in octaves:
                m = 2**octave
                begin = max(known, 2 * m) - 2 * m
                count = track.shape[1] - 2 * m - begin
                if count <= 0:
                    continue
                d = track[:, begin + m:begin + m + count] * -2.0
                d += track[:, begin:begin + count]
                d += track[:, begin + 2 * m:]
                self.sums[octave + stage] += np.einsum('ij,ij->i', d, d)
                self.counts[octave + stage] += count
            self._carry[stage] = track[:, -_CARRY:].copy()
            self._next[stage] = first + points.shape[1]
            stage += 1
            if stage == _MAX_STAGES:
                break
            points = points[:, first % 2::2]

    def copy(self) -> 'Pyramid':
        """Return an independent copy."""
        twin = Pyramid.__new__(Pyramid)
        twin.sums, twin.counts = self.sums.copy(), self.counts.copy()
        twin._carry, twin._next = list(self._carry), list(self._next)
        return twin

    def merge(self, other: 'Pyramid') -> None:
        """Add the sums of another record of the same axes."""
        octaves = max(len(self.counts), len(other.counts))
        for pyramid in (self, other):
            grow = octaves - len(pyramid.counts)
            axes = pyramid.sums.shape[1]
            pyramid.sums = np.concatenate((pyramid.sums, np.zeros((grow, axes))))
            pyramid.counts = np.append(pyramid.counts, np.zeros(grow, dtype=np.int64))
            pyramid._carry += [np.zeros((axes, 1)) for _ in range(grow)]
            pyramid._next += [1] * grow
        self.sums += other.sums
        self.counts += other.counts
        self.start_stretch()

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """Return the state as plain arrays."""
        stages, axes = len(self._carry), self.sums.shape[1]
        carry = np.zeros((stages, axes, _CARRY))
        for padded, points in zip(carry, self._carry, strict=True):
            padded[:, :points.shape[1]] = points
        return {
            'sums': self.sums, 'counts': self.counts, 'carry': carry,
            'carry_length': np.array([points.shape[1] for points in self._carry]),
            'next': np.array(self._next),
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
        carry = np.array(state['carry'], dtype=np.float64)
        lengths = np.array(state['carry_length'], dtype=np.int64)
        self._next = [int(i) for i in np.array(state['next'], dtype=np.int64)]
        stages = len(self._next)
        if (self.sums.ndim != 2 or carry.shape != (stages, self.sums.shape[1], _CARRY)
                or lengths.shape != (stages,) or np.any((lengths < 1) | (lengths > _CARRY))
                or self.counts.shape != (stages + OVERLAP_OCTAVE,)
                or len(self.sums) != len(self.counts)):
            raise ValueError('arrays of the pyramid do not fit together')
        self._carry = [points[:, :n].copy() for points, n in zip(carry, lengths, strict=True)]
        return self
