# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Axes that give one value from their first message on, and the moment at which they come to life.

Until then nobody knows: an axis without noise, a coarse one in the middle of a step, and a dead
one look alike. A coarse one leaves its step slowly, with a single change now and then; a dead one
changes all the time from its first change on.
"""

from dataclasses import dataclass, field

from imu_allan.timeline.placing import SPARSE
from imu_allan.timeline.record import Record
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_FOLLOWING = 64
"""Messages after the first change that tell: as many as are always seen ahead."""
_FEWEST = 8
"""Of these at least, at the end of a recording."""
_ALIVE_SHARE = 0.25
"""Share of them that change: noise of a third of a step does so, drift over a border does not."""
_LATE = 32
"""Messages with one value from which an axis is late: fewer change no number that counts."""


@dataclass
class LateAxes(Record):
    """
    What was seen of axes that have not changed yet.

    Attributes
    ----------
    run : list of int
        Messages with one value so far; -1 of an axis that has changed.
    value : list of float
        That value.
    late : list of int
        Messages before an axis came to life.

    """

    run: list[int] = field(default_factory=lambda: [0] * 6)
    value: list[float] = field(default_factory=lambda: [0.0] * 6)
    late: list[int] = field(default_factory=lambda: [0] * 6)

    def sleep_on(self, samples: Floats) -> bool:
        """Tell whether no axis that has not changed yet does so in samples, shape (n, 6)."""
        return all(run < 0 or (run > 0 and bool((samples[:, axis] == self.value[axis]).all()))
                   for axis, run in enumerate(self.run))

    def count(self, messages: int) -> None:
        """Count messages during which `sleep_on` holds."""
        self.run = [run + messages if run > 0 else run for run in self.run]

    def look(self, samples: Floats, consumed: int) -> dict[int, slice]:
        """
        Find axes that come to life, and those that sleep on with another value than the first.

        Parameters
        ----------
        samples : ndarray, shape (n, 6)
            As they came; NaN where an axis is absent.
        consumed : int
            The first so many are decided on now.

        Returns
        -------
        dict of int to slice
            Number of the axis, and the messages before, in which it is not to count.

        """
        parts = {axis: part for axis, run in enumerate(self.run) if run >= 0
                 and (part := self._not_yet(axis, samples[:, axis], consumed)) is not None}
        first = max((part.stop for part in parts.values() if part.start is None),
                    default=0)
        # What a driver sent before it had anything to send is no sample of any axis.
        return {axis: slice(first) for axis in range(6) if first} | parts

    def _not_yet(self, axis: int, values: Floats, consumed: int) -> slice | None:
        known = np.flatnonzero(np.isfinite(values))
        now = known[:np.searchsorted(known, consumed)]
        if not len(now):
            return None
        if self.run[axis] == 0:
            self.value[axis] = float(values[now[0]])
        other = np.flatnonzero(values[now] != self.value[axis])
        if not len(other):
            self.run[axis] += len(now)
            return None
        slept, self.run[axis] = self.run[axis] + int(other[0]), -1
        following = values[known[other[0]:other[0] + 1 + _FOLLOWING]]
        changes = int(np.count_nonzero(following[1:] != following[:-1]))
        if slept < _LATE and not changes and len(following) > _FEWEST:
            # A driver's first messages may hold zeros: the axis sleeps on with another value.
            first, self.run[axis] = int(now[other[0]]), 0
            rest = values.copy()
            rest[:first] = np.nan
            return self._not_yet(axis, rest, consumed) or slice(first)
        if slept < _LATE or len(following) <= _FEWEST or (
                changes < _ALIVE_SHARE * (len(following) - 1)):
            return None
        self.late[axis] = slept
        row = int(now[other[0]])
        return slice(max(row - SPARSE, 0), max(row, 1))
