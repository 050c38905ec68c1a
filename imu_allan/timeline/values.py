# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether values are those of the sensor, judged by the values alone, whatever their stamps.

A sensor whose noise spans its resolution never gives the same six values twice. If messages repeat
them, they were polled faster than the sensor samples (held), or the driver continues without the
sensor (frozen). A coarse output repeats itself by nature and is kept. Not the sensor's own are
isolated outliers, and every second sample where two publish.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Bools
from imu_allan.state import Record
from imu_allan.timeline.stamps import count_in_runs, off_a_line
import numpy as np

LARGEST = 1e9
"""Larger values, in SI units, are corrupt data, as no IMU measures them."""
_BLOCK = 64
"""Samples per transform: drift stays out of its upper half, where neighbours are compared."""
_FROZEN_RUN = 24
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
            if begins_anew and np.count_nonzero(same) < _FROZEN_RUN and not same[-1:].any():
                return True
        return False

    def spikes(self, samples: Array) -> Bools:
        """Find isolated outliers, by the noise of the sensor."""
        # What is beyond all numbers is no noise with which later samples may be compared.
        last = np.clip(self.last, -LARGEST, LARGEST) if self.last else None
        steps = np.empty_like(samples)
        steps[0] = 0.0 if last is None else samples[0] - last
        np.subtract(samples[1:], samples[:-1], out=steps[1:])
        # Fewer samples do not give the noise with which an outlier is compared.
        if len(samples) < 8 or (self.noise and not _may_have_outlier(steps, np.array(self.noise))):
            return np.zeros(len(samples), dtype=bool)
        # After a change of the noise level, the full search is needed only once.
        noise = _noise_of_steps(steps)
        self.noise = noise.tolist()
        return _outliers(samples, last, noise)

    def look(self, samples: Array, consumed: int, all_usable: bool, polled: bool) -> Repeats:
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
        # Messages without any value tell nothing of the sensor.
        empty: Bools = np.all(np.isnan(samples), axis=1)
        same: Bools = ~np.any(differs, axis=1) & ~empty
        fresh = ~(same | empty)[:consumed]
        fresh[0] &= not first
        run, whole = count_in_runs(same, self.run)
        long = same & (whole >= _FROZEN_RUN)
        self.changes += int(np.count_nonzero(fresh))
        self.changed = [a + int(b) for a, b in
                        zip(self.changed, differs[:consumed][fresh].sum(axis=0), strict=True)]
        self.repeats += int(np.count_nonzero(same[:consumed] & ~long[:consumed]))
        self.last, self.run = known[consumed - 1].tolist(), int(run[consumed - 1])
        if not polled and (not self.is_noisy or self._alone_is_coarse(known)):
            return Repeats(none, none, wild)
        self.settled = True
        evenly = _come_evenly(same & ~long)
        # One repeat in five is due to polling, not to an occasional double delivery.
        self.held |= polled or evenly or self.repeats > 0.2 * (self.repeats + self.changes)
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


def alternates(samples: Array) -> bool:
    """Return whether every second sample differs in mean or in noise."""
    # Two sensors differ in mean or in noise. Either alternates from message to message, which is a
    # line at exactly half the message rate.
    blocks = len(samples) // _BLOCK
    there = np.isfinite(samples).all(axis=0)
    # White noise passes on one axis in 0.2 % of cases, on three in 1e-8; with 4 blocks in 2 % and
    # 5e-6.
    if blocks < 8 or not there.any():
        return False
    known = np.clip(samples[:blocks * _BLOCK, there], -LARGEST, LARGEST)
    # Two sensors differ in most axes, hum is in one or two.
    enough = min(3, (known.shape[1] + 1) // 2)
    # Interpolated axes are left out: there, nearly every second sample is the mean of its
    # neighbours.
    bends = np.abs(np.diff(known, 2, axis=0))
    one, other = (np.quantile(bends[start::2], 0.9, axis=0) for start in (0, 1))
    own = np.minimum(one, other) >= 1e-3 * np.maximum(one, other)
    known = known.reshape(blocks, _BLOCK, -1)
    centred = known - np.median(known, axis=1, keepdims=True)
    # A second sensor sends half of the samples. If one in every hundred is an outlier, these
    # alternate, too, and are replaced by their neighbours.
    usual = np.diff(np.quantile(centred, (0.2, 0.8), axis=(0, 1)), axis=0)[0]
    far = (np.abs(centred) > 4 * usual) & (usual > 0)
    centred = np.where(far, np.roll(centred, 1, axis=1), centred)
    # Without noise only rounding errors would be compared.
    own &= centred.std(axis=(0, 1)) > 1e-10 * np.maximum(np.abs(known).max(axis=(0, 1)), 1)
    found, own = _line_at_half(centred, own)
    if np.count_nonzero(found) >= enough:
        return True
    magnitude = np.abs(centred)
    found, _ = _line_at_half(magnitude, own)
    swing = np.abs(np.mean(magnitude[:, ::2] - magnitude[:, 1::2], axis=(0, 1)))
    found &= swing > 0.05 * magnitude.mean(axis=(0, 1))
    return bool(np.count_nonzero(found) >= enough)


def _line_at_half(values: Array, own: Bools) -> tuple[Bools, Bools]:
    """Find the axes with a line at half the rate, and those without one at a quarter of it."""
    transform = np.fft.rfft(values, axis=1)
    power = np.mean(np.abs(transform) ** 2, axis=0)
    turns = transform[:, -1].real
    scatter = np.mean(turns ** 2, axis=0)
    level = np.median(power[_BLOCK // 4:-2], axis=0)
    threshold = 3.0   # by chance the ratio to the neighbours is 1.5 at most
    # The alternating parts of successive blocks correlate: by 1 for a line, less if occasional
    # gaps swap the two sensors, and not at all for a rising spectrum.
    line = ((np.mean(turns[1:] * turns[:-1], axis=0) > 0.5 * scatter)
            & (power[-1] > threshold * level))
    # Without such gaps, all blocks together show a weak line at five standard errors: in 4,096
    # messages, means 0.16 standard deviations apart.
    line |= len(turns) * turns.mean(axis=0) ** 2 > 25.0 * np.maximum(turns.var(axis=0), level)
    # A vibration at a quarter of the rate has an alternating magnitude.
    quarter = power[_BLOCK // 4 - 1:_BLOCK // 4 + 2].max(axis=0)
    return line & own, own & (quarter <= threshold * level)


def _noise_of_steps(steps: Array) -> Array:
    """Estimate the noise of each axis from its steps; infinite if all of them are zero."""
    # Zero steps do not count, so that held or coarse outputs have noise.
    made = [np.abs(values[values != 0]) for values in steps.T]
    # For a quantized output, the median is known to half a step.
    usual = [float(np.median(values) + values.min() / 2) if len(values) else np.inf
             for values in made]
    sigma: Array = 1.4826 / np.sqrt(2) * np.array(usual)
    return sigma


def _may_have_outlier(steps: Array, sigma: Array) -> bool:
    """Return quickly whether any step is large enough to lead to an outlier."""
    # Even on a ramp, an outlier is reached by a step of at least 0.7 of its distance.
    largest = 7.0 * sigma
    return bool((steps.max(axis=0) > largest).any() or (steps.min(axis=0) < -largest).any())


def _outliers(samples: Array, before: Array | None, noise: Array) -> Bools:
    """Find single samples and pairs that lie far from their neighbours."""
    # They are not outliers where nearby samples are some, too, or louder than noise: that is a
    # knock.
    known = samples if before is None else np.concatenate([before[None], samples])
    steps = np.diff(known, axis=0)
    # A noise-free simulation still has rounding errors.
    sigma = np.maximum(noise, 1e-12 * np.abs(known).max(axis=0))
    farthest = 10.0 * sigma   # which the finding quotes; chosen by judgment
    # Only a larger step leads that far away from the median of five samples.
    large = np.flatnonzero((np.abs(steps) > farthest).any(axis=1))
    near = np.unique([large, large + 1])
    # Reflected at both ends, so that the first and last samples are compared with others.
    padded = np.pad(known, ((2, 2), (0, 0)), mode='reflect')
    median = np.median(padded[near[:, None] + np.arange(5)], axis=1)
    found = np.zeros(len(known), dtype=bool)
    found[near] = np.any(np.abs(known[near] - median) > farthest, axis=1)
    found = found[-len(samples):]
    at = np.flatnonzero(found)
    reach = 3   # within this distance two outliers may be errors, while three are a knock
    beside = at[:, None] + np.arange(-reach, reach + 1)
    inside = (beside >= 0) & (beside < len(samples))
    beside = np.where(inside, beside, 0)
    others = (inside & ~found[beside])[:, :, None]
    count = np.maximum(others.sum(axis=1), 1)
    values = samples[beside] / sigma
    mean = np.sum(np.where(others, values, 0.0), axis=1) / count
    # The samples around an outlier are this loud in one of 10,000 cases by chance, but nearly
    # always in a knock, which rings.
    loud = np.sum(np.where(others, values - mean[:, None], 0.0)**2, axis=1) > 2.3**2 * count
    found[at] = (np.sum(inside & found[beside], axis=1) <= 2) & ~loud.any(axis=1)
    return found


def repeated(samples: Array) -> Bools:
    """Return whether each sample but the first equals the one before, absent axes included."""
    same: Bools = np.all((samples[1:] == samples[:-1])
                         | (np.isnan(samples[1:]) & np.isnan(samples[:-1])), axis=1)
    return same
