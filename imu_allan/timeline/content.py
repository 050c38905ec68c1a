# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the values of messages say, whatever their stamps: held, frozen, or never alive yet.

A sensor whose noise spans its resolution never gives the same six values twice. Where messages
repeat them, they were polled faster than the sensor samples (*held*), or the driver goes on
without the sensor (*frozen*). A coarse output repeats itself by nature and is left alone.
"""

from dataclasses import dataclass, field

from imu_allan.timeline.foreign_samples import LARGEST, may_be_wild, noise_of_steps, spikes
from imu_allan.timeline.record import Record
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FROZEN_RUN = 24
"""Repeats in a row that make a sensor frozen: beyond any polling, within the look-ahead."""

_LIVELY_SHARE = 0.8
"""An axis is lively if so many of its samples differ from the one before: noise of a step."""
_LIVELY_AXES = 3
"""Half of the six: single axes may stand still in coarse steps, a frozen sensor stops them all."""
_HELD_SHARE = 0.2
"""Share of repeats from which on messages are polled, not now and then delivered twice."""
_FEWEST_FOR_SPIKES = 8
"""Messages whose steps tell the noise that a wild value is held against."""
_FEWEST = 64
"""Changes from which it is known how lively the axes are."""


@dataclass(frozen=True)
class Repeats:
    """
    Messages of a window to leave out.

    Attributes
    ----------
    held, frozen : ndarray of bool, shape (n,), or None
        Which ones are polled again, or of a sensor that stands still.
    spikes : ndarray of bool, shape (n,), or None
        Single wild values.
    woke : bool
        The sensor has come to life: whatever came before the window was one frozen value.

    """

    held: Bools | None = None
    frozen: Bools | None = None
    spikes: Bools | None = None
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
        if self.changes < _FEWEST:
            return False
        moving = [count for count in self.changed if count > _LIVELY_SHARE * self.changes]
        return len(moving) >= min(_LIVELY_AXES, sum(count > 0 for count in self.changed))

    def check(self) -> None:
        """Refuse values of another number of axes."""
        if {len(self.last), len(self.noise)} - {0, 6}:
            raise ValueError('values are not those of six axes')

    def is_fresh(self, samples: Floats) -> bool:
        """Tell at a glance whether there cannot be more repeats than by chance."""
        if self.held or self.run or not self.settled:
            return False
        # The liveliest axis says it for most sensors, two for outputs of 16 bits: looking at all
        # takes many times as long.
        same: Bools = np.ones(len(samples) - 1, dtype=bool)
        begins_anew = False
        for axis in sorted(range(6), key=lambda axis: -self.changed[axis]):
            values = samples[:, axis]
            # What never changed, and NaN, which is unlike itself, tell nothing.
            if not self.changed[axis] or np.isnan(values).any():
                continue
            same &= values[1:] == values[:-1]
            begins_anew |= bool(values[0] != self.last[axis])
            if begins_anew and np.count_nonzero(same) < FROZEN_RUN and not same[-1:].any():
                return True
        return False

    def is_tame(self, samples: Floats) -> bool:
        """Tell at a glance whether there cannot be a single wild value; none may be NaN."""
        return len(self.noise) == 6 and not may_be_wild(self._steps(samples), np.array(self.noise))

    def spikes(self, samples: Floats) -> Bools | None:
        """Find single wild values, as `imu_allan.timeline.foreign_samples.spikes`."""
        known = np.clip(np.nan_to_num(samples), -LARGEST, LARGEST)
        if len(known) < _FEWEST_FOR_SPIKES or self.is_tame(known):
            return None
        # Noise that has changed is looked at closely once.
        self.noise = noise_of_steps(self._steps(known)).tolist()
        found = spikes(known, np.array(self.last) if self.last else None)
        return found if found.any() else None

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
        Find held and frozen messages.

        Parameters
        ----------
        samples : ndarray, shape (n, 6)
            As they came; NaN where an axis is absent.
        consumed : int
            The first so many are decided on now.

        """
        known = np.nan_to_num(samples)
        first = not self.last
        before = known[0] + 1 if first else np.array(self.last)
        differs = np.concatenate([[known[0] != before], known[1:] != known[:-1]])
        same: Bools = ~np.any(differs, axis=1)
        fresh = ~same[:consumed]
        fresh[0] &= not first
        if not self.changes:
            self.head += int(np.argmax(fresh)) if fresh.any() else consumed
        run = _runs(same, self.run)
        long = same & (_run_lengths(same, run) >= FROZEN_RUN)
        self.changes += int(np.count_nonzero(fresh))
        self.changed = [a + int(b) for a, b in
                        zip(self.changed, differs[:consumed][fresh].sum(axis=0), strict=True)]
        self.repeats += int(np.count_nonzero(same[:consumed] & ~long[:consumed]))
        self.last, self.run = known[consumed - 1].tolist(), int(run[consumed - 1])
        if not self.lively:
            return Repeats()
        woke = not (self.settled or first) and self.head >= FROZEN_RUN
        self.settled = True
        self.held |= self.repeats > _HELD_SHARE * (self.repeats + self.changes)
        self.frozen += int(np.count_nonzero(long[:consumed]))
        held = same & ~long if self.held else None
        return Repeats(held, long if long.any() else None, woke=woke)


def _runs(same: Bools, before: int) -> Ints:
    """Repeats up to each message; `before` are those up to the message before."""
    place = np.arange(len(same))
    begins = np.where(same, -1, place)
    newest = np.maximum.accumulate(begins)
    run: Ints = np.where(newest >= 0, place - newest, place + 1 + before)
    return run


def _run_lengths(same: Bools, run: Ints) -> Ints:
    """Repeats in the whole run that each message belongs to, as far as it is seen."""
    ends = np.append(~same[1:], True)
    place = np.arange(len(same))
    end = np.where(ends, place, len(same))
    nearest = np.minimum.accumulate(end[::-1])[::-1]
    return np.asarray(run[nearest])
