# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which axes are alive: what the values of messages say, whatever their stamps.

*Presence*: a value is unusable where it is NaN, infinite or absurd, or its field is declared
absent. Single ones spoil their message. Where they last, the axis is gone until it comes back for
as long, and the others lose nothing by it.

An axis without noise, a coarse one in the middle of a step, and a dead one are the same at first.
A coarse one leaves its step slowly, with a single change now and then; a dead one changes all the
time from its first change on, and begins there.

*Content*: a sensor whose noise spans its resolution never gives the same six values twice. Where
messages repeat them, they were polled faster than the sensor samples (held), or the driver goes on
without the sensor (frozen). A coarse output repeats itself by nature and is left alone.
"""

from dataclasses import dataclass, field

from imu_allan.state import Record
from imu_allan.timeline.clock import Bools, Floats, runs
from imu_allan.timeline.foreign_samples import LARGEST, may_be_wild, noise_of_steps, spikes
import numpy as np

FROZEN_RUN = 24
"""Repeats in a row that make a sensor frozen: beyond any polling, within the look-ahead."""

SPARSE = 16
"""Every so many samples go into the mean acceleration, which needs no more."""


@dataclass(frozen=True)
class Repeats:
    """
    Messages of a window to leave out, ndarrays of bool, shape (n,).

    Attributes
    ----------
    held, frozen : ndarray of bool
        Which ones are polled again, or of a sensor that stands still.
    spikes : ndarray of bool
        Single wild values.
    woke : bool
        The sensor has started: whatever came before the window was one frozen value.

    """

    held: Bools
    frozen: Bools
    spikes: Bools
    woke: bool = False


@dataclass
class Content(Record):
    """
    What was seen of the values.

    Attributes
    ----------
    run : int
        Repeats up to the newest message.
    last : list of float
        Values of the newest message.
    changes : int, changed : list of int
        Messages unlike the one before, and how many of them changed each axis.
    repeats : int
        Messages like the one before, in runs too short to be frozen.
    head : int
        Messages before the first that was unlike them.
    settled : bool
        It is known that the axes are lively.
    held : bool
        Repeats are polled.
    frozen : int, frozen_s : float or None
        Messages of frozen runs, and when the first began.
    noise : list of float
        Standard deviation of a sample by the steps of the first messages; infinite where there
        are none.

    """

    run: int = 0
    last: list[float] = field(default_factory=list)
    changes: int = 0
    changed: list[int] = field(default_factory=lambda: [0] * 6)
    repeats: int = 0
    head: int = 0
    settled: bool = False
    held: bool = False
    frozen: int = 0
    frozen_s: float | None = None
    noise: list[float] = field(default_factory=list)

    @property
    def lively(self) -> bool:
        """Whether chance does not repeat all axes."""
        # Of fewer changes it is not known how lively the axes are.
        if self.changes < 64:
            return False
        # Noise of a step changes four of five samples of an axis.
        moving = [count for count in self.changed if count > 0.8 * self.changes]
        # Single axes may stand still in coarse steps, a frozen sensor stops them all.
        return len(moving) >= min(3, sum(count > 0 for count in self.changed))

    def check(self) -> None:
        """Refuse values of another number of axes."""
        if {len(self.last), len(self.noise)} - {0, 6}:
            raise ValueError('values are not those of six axes')

    def is_fresh(self, samples: Floats) -> bool:
        """Return by a quick look whether there cannot be more repeats than by chance."""
        if self.held or self.run or not self.settled:
            return False
        # The liveliest axis says it for most sensors, two for outputs of 16 bits: looking at all
        # takes many times as long.
        same: Bools = np.ones(len(samples) - 1, dtype=bool)
        begins_anew = False
        for axis in sorted(range(6), key=lambda axis: -self.changed[axis]):
            values = samples[:, axis]
            # What never changed, and NaN, which is unlike itself, decide nothing.
            if not self.changed[axis] or np.isnan(values).any():
                continue
            same &= values[1:] == values[:-1]
            begins_anew |= bool(values[0] != self.last[axis])
            if begins_anew and np.count_nonzero(same) < FROZEN_RUN and not same[-1:].any():
                return True
        return False

    def is_tame(self, samples: Floats) -> bool:
        """Return by a quick look whether there cannot be a single wild value; none may be NaN."""
        return len(self.noise) == 6 and not may_be_wild(self._steps(samples), np.array(self.noise))

    def _spikes(self, samples: Floats) -> Bools:
        """Find single wild values, as `imu_allan.timeline.foreign_samples.spikes`."""
        known = np.clip(np.nan_to_num(samples), -LARGEST, LARGEST)
        # Fewer do not measure the noise that a wild value is held against.
        if len(known) < 8 or self.is_tame(known):
            return np.zeros(len(known), dtype=bool)
        # Noise that has changed is looked at closely once.
        self.noise = noise_of_steps(self._steps(known)).tolist()
        return spikes(known, np.array(self.last) if self.last else None)

    def _steps(self, samples: Floats) -> Floats:
        """Return the steps from the newest message on, shape (n, 6) or one less."""
        if not self.last:
            return samples[1:] - samples[:-1]
        steps = np.empty_like(samples)
        steps[0] = samples[0] - self.last
        np.subtract(samples[1:], samples[:-1], out=steps[1:])
        return steps

    def look(self, samples: Floats, consumed: int) -> Repeats:
        """
        Find held, frozen and wild messages among samples, shape (n, 6), as they came.

        The first `consumed` are decided on now.
        """
        wild, none = self._spikes(samples), np.zeros(len(samples), dtype=bool)
        if self.is_fresh(samples[:consumed]):
            self.last = np.nan_to_num(samples[consumed - 1]).tolist()
            return Repeats(none, none, wild)
        known = np.nan_to_num(samples)
        first = not self.last
        before = known[0] + 1 if first else np.array(self.last)
        differs = np.concatenate([[known[0] != before], known[1:] != known[:-1]])
        same: Bools = ~np.any(differs, axis=1)
        fresh = ~same[:consumed]
        fresh[0] &= not first
        if not self.changes:
            self.head += int(np.argmax(fresh)) if fresh.any() else consumed
        run, whole = runs(same, self.run)
        long = same & (whole >= FROZEN_RUN)
        self.changes += int(np.count_nonzero(fresh))
        self.changed = [a + int(b) for a, b in
                        zip(self.changed, differs[:consumed][fresh].sum(axis=0), strict=True)]
        self.repeats += int(np.count_nonzero(same[:consumed] & ~long[:consumed]))
        self.last, self.run = known[consumed - 1].tolist(), int(run[consumed - 1])
        if not self.lively:
            return Repeats(none, none, wild)
        woke = not (self.settled or first) and self.head >= FROZEN_RUN
        self.settled = True
        # One in five is polled, not now and then delivered twice.
        self.held |= self.repeats > 0.2 * (self.repeats + self.changes)
        self.frozen += int(np.count_nonzero(long[:consumed]))
        return Repeats(same & ~long if self.held else none, long, wild, woke)


@dataclass
class Presence(Record):
    """
    What was seen of the axes.

    Attributes
    ----------
    there : list of bool
        Which axes have values now.
    bad, run : list of bool, list of int
        Which had none in the newest message, and for how many messages that has been so.
    gone : list of int
        Messages during which each axis was not there, but others were.
    changed : bool
        An axis has gone or come since the first messages.
    asleep, value : list of int, list of float
        Messages with one value from the first on, and that value; -1 of an axis that has changed.
    late : list of int
        Messages before an axis came to life.

    """

    there: list[bool] = field(default_factory=lambda: [True] * 6)
    bad: list[bool] = field(default_factory=lambda: [False] * 6)
    run: list[int] = field(default_factory=lambda: [0] * 6)
    gone: list[int] = field(default_factory=lambda: [0] * 6)
    changed: bool = False
    asleep: list[int] = field(default_factory=lambda: [0] * 6)
    value: list[float] = field(default_factory=lambda: [0.0] * 6)
    late: list[int] = field(default_factory=lambda: [0] * 6)

    def goes_on(self, samples: Floats) -> bool:
        """Whether every axis is there, and none comes to life in samples, shape (n, 6)."""
        return all(self.there) and all(
            asleep < 0 or (asleep > 0 and bool((samples[:, axis] == value).all()))
            for axis, (asleep, value) in enumerate(zip(self.asleep, self.value, strict=True)))

    def count(self, messages: int) -> None:
        """Count messages during which it goes on."""
        self.asleep = [asleep + messages if asleep > 0 else asleep for asleep in self.asleep]

    def look(self, unusable: Bools, consumed: int) -> Bools:
        """
        Find axes that are gone from values that are spoilt, both ndarrays of bool, shape (n, 6).

        The first `consumed` messages are decided on now.
        """
        gone = np.empty_like(unusable)
        for axis in range(6):
            gone[:, axis] = self._gone(axis, unusable[:, axis], consumed)
        none = gone[:consumed].all(axis=1)
        self.gone = [before + int(np.count_nonzero(now & ~none)) for before, now
                     in zip(self.gone, gone[:consumed].T, strict=True)]
        return gone

    def _gone(self, axis: int, bad: Bools, consumed: int) -> Bools:
        """Return whether one axis is gone, and remember how it ends."""
        starts = np.flatnonzero(np.append(True, bad[1:] != bad[:-1]))
        lengths = np.diff(np.append(starts, len(bad)))
        before = self.run[axis] if self.bad[axis] == bad[0] else 0
        state, states = not self.there[axis], []
        for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
            # More than a slip of the driver, and within the look-ahead.
            if length + (before if start == 0 else 0) >= 32:
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

    def waking(self, samples: Floats, consumed: int) -> Bools:
        """
        Find messages before an axis comes to life, in which it is not to count, shape (n, 6).

        The first `consumed` of samples, shape (n, 6), NaN where unknown, are decided on now.
        """
        away = np.zeros(samples.shape, dtype=bool)
        for axis, asleep in enumerate(self.asleep):
            values = samples[:, axis]
            known = np.flatnonzero(np.isfinite(values)) if asleep >= 0 else np.empty(0, int)
            now = known[:np.searchsorted(known, consumed)]
            if not len(now):
                continue
            if asleep == 0:
                self.value[axis] = float(values[now[0]])
            other = np.flatnonzero(values[now] != self.value[axis])
            if not len(other):
                self.asleep[axis] += len(now)
                continue
            slept, self.asleep[axis] = asleep + int(other[0]), -1
            # As many messages as are always seen ahead decide.
            following = values[known[other[0]:other[0] + 1 + 64]]
            changes = int(np.count_nonzero(following[1:] != following[:-1]))
            # Fewer than 32 messages with one value change no number that counts, and at the end of
            # a recording eight decide. Noise of a third of a step changes a quarter of them, drift
            # over a border does not.
            if slept >= 32 and len(following) > 8 and changes >= 0.25 * (len(following) - 1):
                self.late[axis], row = slept, int(now[other[0]])
                away[max(row - SPARSE, 0):max(row, 1), axis] = self.changed = True
        return away
