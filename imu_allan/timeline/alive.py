# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a sensor gives new values, judged by the values of messages, whatever their stamps.

A sensor whose noise spans its resolution never gives the same six values twice. If messages repeat
them, they were polled faster than the sensor samples (held), or the driver continues without the
sensor (frozen). A coarse output repeats itself by nature and is kept.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Bools
from imu_allan.state import Record
from imu_allan.timeline.foreign_samples import LARGEST, may_have_outlier, noise_of_steps, spikes
from imu_allan.timeline.stamps import count_in_runs, off_a_line
import numpy as np

FROZEN_RUN = 24
"""Repeats in a row that mark a sensor as frozen: beyond any polling, within the look-ahead."""


@dataclass(frozen=True)
class Repeats:
    """Messages of a window to leave out, as bool arrays of shape (n,)."""

    # Messages that were polled again, and those of a sensor that has stopped.
    held: Bools
    frozen: Bools
    spikes: Bools  # isolated outliers
    # Whether repeats come evenly, as from polling, and not in place of new samples.
    evenly: bool = False


@dataclass
class Content(Record):
    """Statistics of the values of messages so far."""

    run: int = 0  # repeats in a row up to the newest message
    last: list[float] = field(default_factory=list)  # values of the newest message
    # Messages that differ from the one before, and how many of them changed each axis.
    changes: int = 0
    changed: list[int] = field(default_factory=lambda: [0] * 6)
    repeats: int = 0  # messages equal to the one before, in runs too short to be frozen
    settled: bool = False  # whether the axes are known to be noisy
    held: bool = False  # whether repeats are due to polling
    # Messages in frozen runs, and the time in seconds at which the first one began.
    frozen: int = 0
    frozen_s: float | None = None
    # Standard deviation of a sample, from the steps of the window last examined; infinite for an
    # axis without steps.
    noise: list[float] = field(default_factory=list)

    @property
    def is_noisy(self) -> bool:
        """Whether a repetition of all axes by chance is practically excluded."""
        # Fewer changes do not show how noisy the axes are.
        if self.changes < 64:
            return False
        # Noise of one quantization step changes four of five samples of an axis.
        moving = [count for count in self.changed if count > 0.8 * self.changes]
        # Single axes may rest within a coarse step, but a frozen sensor stops all of them.
        return len(moving) >= min(3, sum(count > 0 for count in self.changed))

    def _alone_is_coarse(self, samples: Array) -> bool:
        """Return whether only one axis changes, and repeats its values by chance."""
        alone = np.flatnonzero(self.changed)
        if len(alone) != 1:
            return False
        steps = np.abs(np.diff(np.clip(samples[:, alone[0]], -LARGEST, LARGEST)))
        made = steps[steps > 0]
        # At the limit, the noise is two steps of the output, and repeats one value in eight. An
        # axis that has stopped is as it was.
        return bool(np.median(made) < 2.5 * made.min()) if len(made) else not self.settled

    def has_no_repeats(self, samples: Array) -> bool:
        """Return quickly whether more repeats than by chance are excluded."""
        if self.held or self.run or not self.settled:
            return False
        # The liveliest axis decides for most sensors, two axes for 16-bit outputs. Comparing all
        # of them takes many times as long.
        same: Bools = np.ones(len(samples) - 1, dtype=bool)
        begins_anew = False
        for axis in sorted(range(6), key=lambda axis: -self.changed[axis]):
            values = samples[:, axis]
            # A constant axis, and NaN, which differs from itself, decide nothing.
            if not self.changed[axis] or np.isnan(values).any():
                continue
            same &= values[1:] == values[:-1]
            begins_anew |= bool(values[0] != self.last[axis])
            if begins_anew and np.count_nonzero(same) < FROZEN_RUN and not same[-1:].any():
                return True
        return False

    def spikes(self, samples: Array) -> Bools:
        """Find isolated outliers, as `imu_allan.timeline.foreign_samples.spikes` does."""
        # What is beyond all numbers is no noise with which later samples may be compared.
        last = np.clip(self.last, -LARGEST, LARGEST) if self.last else None
        steps = np.empty_like(samples)
        steps[0] = 0.0 if last is None else samples[0] - last
        np.subtract(samples[1:], samples[:-1], out=steps[1:])
        # Fewer samples do not give the noise with which an outlier is compared.
        if len(samples) < 8 or (self.noise and not may_have_outlier(steps, np.array(self.noise))):
            return np.zeros(len(samples), dtype=bool)
        # After a change of the noise level, the full search is needed only once.
        noise = noise_of_steps(steps)
        self.noise = noise.tolist()
        return spikes(samples, last, noise)

    def look(self, samples: Array, consumed: int, all_usable: bool) -> Repeats:
        """Find held and frozen messages and outliers; only the first `consumed` count."""
        known = samples if all_usable else np.nan_to_num(samples)
        wild = self.spikes(known if all_usable else np.clip(known, -LARGEST, LARGEST))
        none = np.zeros(len(samples), dtype=bool)
        if self.has_no_repeats(samples[:consumed]):
            self.last = known[consumed - 1].tolist()
            return Repeats(none, none, wild)
        first = not self.last
        before = known[0] + 1 if first else np.array(self.last)
        differs = np.concatenate([[known[0] != before], known[1:] != known[:-1]])
        same: Bools = ~np.any(differs, axis=1)
        fresh = ~same[:consumed]
        fresh[0] &= not first
        run, whole = count_in_runs(same, self.run)
        long = same & (whole >= FROZEN_RUN)
        self.changes += int(np.count_nonzero(fresh))
        self.changed = [a + int(b) for a, b in
                        zip(self.changed, differs[:consumed][fresh].sum(axis=0), strict=True)]
        self.repeats += int(np.count_nonzero(same[:consumed] & ~long[:consumed]))
        self.last, self.run = known[consumed - 1].tolist(), int(run[consumed - 1])
        if not self.is_noisy or self._alone_is_coarse(known):
            return Repeats(none, none, wild)
        self.settled = True
        evenly = _come_evenly(same & ~long)
        # One repeat in five is due to polling, not to an occasional double delivery.
        self.held |= evenly or self.repeats > 0.2 * (self.repeats + self.changes)
        self.frozen += int(np.count_nonzero(long[:consumed]))
        return Repeats(same & ~long if self.held else none, long, wild, evenly)


def _come_evenly(again: Bools) -> bool:
    """Return whether messages repeat as regularly as those of a timer that polls a sensor."""
    # The number of messages between new values then varies by at most one. If repeats replace new
    # samples at random, the positions drift: by 1.5 messages for 32 repeats, the fewest
    # considered.
    new = np.flatnonzero(~again)
    # Repeats matter from a share of 0.03, which changes N by 1 %.
    if len(again) - len(new) < max(32, 0.03 * len(again)) or len(new) < 64:
        return False
    return float(off_a_line(new).std()) < 0.7
