# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which axes are there, message by message.

A value is unusable where it is NaN, infinite or absurd, or its field is declared absent. Single
ones spoil their message. Where they last, the axis is gone until it comes back for as long, and
the others lose nothing by it.
"""

from dataclasses import dataclass, field

from imu_allan.timeline.record import Record
import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]

LASTING = 32
"""Messages in a row: more than a slip of the driver, and within the look-ahead."""


@dataclass
class Presence(Record):
    """
    What was seen of the axes.

    Attributes
    ----------
    there : list of bool
        Which axes have values now.
    bad : list of bool
        Which had none in the newest message.
    run : list of int
        For how many messages that has been so.
    gone : list of int
        Messages during which each axis was not there, but others were.
    changed : bool
        An axis has gone or come since the first messages.

    """

    there: list[bool] = field(default_factory=lambda: [True] * 6)
    bad: list[bool] = field(default_factory=lambda: [False] * 6)
    run: list[int] = field(default_factory=lambda: [0] * 6)
    gone: list[int] = field(default_factory=lambda: [0] * 6)
    changed: bool = False

    def look(self, unusable: Bools, consumed: int) -> Bools:
        """
        Tell axes that are gone from values that are spoilt.

        Parameters
        ----------
        unusable : ndarray of bool, shape (n, 6)
            Whether each value cannot be used.
        consumed : int
            The first so many messages are decided on now.

        Returns
        -------
        ndarray of bool, shape (n, 6)
            Whether each axis is gone.

        """
        gone = np.empty_like(unusable)
        for axis in range(6):
            gone[:, axis] = self._gone(axis, unusable[:, axis], consumed)
        none = gone[:consumed].all(axis=1)
        self.gone = [before + int(np.count_nonzero(now & ~none)) for before, now
                     in zip(self.gone, gone[:consumed].T, strict=True)]
        return gone

    def _gone(self, axis: int, bad: Bools, consumed: int) -> Bools:
        """Tell whether one axis is gone, and remember how it ends."""
        now = bool(bad[0])
        if now != self.there[axis] and (bad == now).all():
            # All is as it was: an axis that is never there, or always.
            self.run[axis] = consumed + (self.run[axis] if self.bad[axis] == now else 0)
            self.bad[axis] = now
            return bad
        starts = np.flatnonzero(np.append(True, bad[1:] != bad[:-1]))
        lengths = np.diff(np.append(starts, len(bad)))
        before = self.run[axis] if self.bad[axis] == now else 0
        state, states = not self.there[axis], []
        for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
            if length + (before if start == 0 else 0) >= LASTING:
                state = bool(bad[start])
            states.append(state)
        gone: Bools = np.repeat(states, lengths)
        newest = int(np.searchsorted(starts, consumed - 1, 'right')) - 1
        begun = int(starts[newest])
        self.run[axis] = consumed - begun + (before if begun == 0 else 0)
        self.bad[axis] = bool(bad[consumed - 1])
        self.changed |= bool((gone[:consumed] == self.there[axis]).any())
        self.there[axis] = not gone[consumed - 1]
        return gone
