# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The noise level at rest, from which motion is distinguished, in windows of half a second.

A window is judged by three statistics of each axis: the power within parts of 20 ms, that of the
differences of their means, and the second difference of window means. These keep noise of every
term stationary and nearly Gaussian, however far it drifts. Thresholds follow from the median and
the spread of the past, without tuning to rate, noise level, quantization or steady vibration.

A test by physics needs no learning: no sensor at rest changes its mean by 3 deg/s or 0.5 m/s^2
within two seconds, except through its white noise.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log, sqrt

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import EvenBlock
from imu_allan.state import Record
import numpy as np

QUIETER = 3.0 ** (2 / 3)
"""Ratio of loudness for a third of the noise: no driving is that quiet, and no drift that
large."""
_FINE = 0.7
"""Noise over step above which the step hides no noise; below, an output may rest for long."""
_PLAUSIBLE_CHANGE = np.array([0.05] * 3 + [0.5] * 3)
"""In rad/s and m/s^2 within two seconds: a smaller change is judged by the noise alone."""


@dataclass
class Segment(Record):
    """
    Even rows without a gap, not yet decided on.

    Windows are numbered from the start of the segment. `blocks` begin with window `given`. The
    arrays of windows begin with window `base`, a few earlier, as context.
    """

    first_index: int
    start_s: float
    new_run: bool
    blocks: list[EvenBlock] = field(default_factory=list)
    closed: bool = False
    given: int = 0
    base: int = 0
    means: Array = field(default_factory=lambda: np.empty((0, 6)))
    loudness: Array = field(default_factory=lambda: np.empty((0, 12)))
    moving: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))

    @property
    def held(self) -> int:
        """Count the rows held."""
        return sum(map(len, self.blocks))

    def joined(self) -> EvenBlock:
        """Return all rows held, as one block."""
        if len(self.blocks) > 1:
            first = self.blocks[0]
            self.blocks = [replace(
                first, samples=np.concatenate([block.samples for block in self.blocks]),
                interpolated=np.concatenate([
                    block.first_index - first.first_index + block.interpolated
                    for block in self.blocks]))]
        return self.blocks[0]

    def statistics(self, first: int, last: int) -> Array:
        """Return loudness and wander of windows by their array indices, shape (windows, 18)."""
        # Wander is the second difference of means, NaN for the first and the last window.
        table = np.full((len(self.means), 18), np.nan)
        table[:, :12] = self.loudness
        table[1:-1, 12:] = self.means[2:] - 2 * self.means[1:-1] + self.means[:-2]
        return table[first:last]


class Windows:
    """The division of rows into windows."""

    def __init__(self, interval_s: float) -> None:
        self.interval_s = interval_s
        # Loudness within parts of 20 ms is of fast noise, between them of slow.
        self.part = max(round(0.02 / self.interval_s), 1)
        # A window shorter than half a second gives its noise less accurately; a longer one cuts
        # out more for a knock.
        self.size = 25 * self.part
        # Means are compared at these distances, in windows: 1 for a jerk, 4 for a slow turn of two
        # seconds. Windows of a slow sensor are longer: a change over more than 6 s is drift.
        # Chosen by judgment.
        self.lags = tuple(lag for lag in (1, 4) if lag * self.size * self.interval_s < 6.0)
        self.farthest = max(self.lags, default=0)

    def time(self, segment: Segment, window: int) -> float:
        """Return the start of a window of a segment, in seconds."""
        return max(segment.start_s + window * self.size * self.interval_s, 0.0)

    def measure(self, segment: Segment) -> None:
        """Compute mean and loudness of the windows completed since the last call."""
        rows, size = segment.joined().samples, self.size
        done = (segment.base + len(segment.means) - segment.given) * size
        complete = done + (len(rows) - done) // size * size
        last = [rows[None, -size:]] if segment.closed and complete < len(rows) else []
        for windows in (rows[done:complete].reshape(-1, size, 6), *last):
            if len(windows):
                means, loudness = _describe(windows, self.part)
                segment.means = np.concatenate([segment.means, means])
                segment.loudness = np.concatenate([segment.loudness, loudness])

    def implausible(self, segment: Segment, first: int) -> Bools:
        """Find windows, from array index `first` on, whose mean moved implausibly far."""
        means = segment.means
        beyond = np.zeros(len(means), dtype=bool)
        for lag in self.lags:
            change = np.abs(means[lag:] - means[:-lag])
            if (change > _PLAUSIBLE_CHANGE).any():
                sigma = segment.loudness ** 1.5
                sigma = np.maximum(sigma[:, :6], sqrt(self.part) * sigma[:, 6:])
                white = np.minimum(sigma[lag:], sigma[:-lag]) * sqrt(2 / self.size)
                # A noisy mean changes by chance, but not by ten of its standard deviations.
                beyond[lag:] |= np.any(
                    change > np.maximum(_PLAUSIBLE_CHANGE, 10.0 * white), axis=1)
        return beyond[first:]


def _describe(rows: Array, part: int) -> tuple[Array, Array]:
    """Return means (windows, 6) and loudness (windows, 12) of rows (windows, size, 6)."""
    # Loudness is the cube root of a variance: of that within parts, and of that of their means, as
    # the differences of successive parts give it. The cube root makes a chi-square variable nearly
    # normal, whatever its degrees of freedom. Axes without values count as zero.
    windows, size, _ = rows.shape
    axes, parts = rows.transpose(2, 0, 1), size // part
    if part == 1 or parts < 2:
        steps, means = axes[:, :, 1:] - axes[:, :, :-1], axes.mean(axis=2)
        within = slow = _square_sums(steps) * (0.5 / max(size - 1, 1))
    else:
        split = axes[:, :, :parts * part].reshape(6, windows, parts, part)
        coarse = np.matmul(split.reshape(6, -1, part), np.ones(part)).reshape(split.shape[:3])
        coarse /= part
        own = (split - coarse[..., None]).reshape(6, windows, parts * part)
        within = _square_sums(own) / (parts * (part - 1))
        slow = _square_sums(coarse[:, :, 1:] - coarse[:, :, :-1]) * (0.5 / (parts - 1))
        means = coarse.mean(axis=2)
    means, power = means.T.copy(), np.concatenate([within, slow]).T.copy()
    # The mean of equal values is that value up to rounding, which is not noise. For some hundred
    # values the rounding error is less than this share of the mean, and any noise is more.
    power[power < (1e-13 * np.tile(means, 2)) ** 2] = 0.0
    if np.isnan(means[-1]).any():
        np.nan_to_num(means, copy=False)
        np.nan_to_num(power, copy=False)
    return means, np.cbrt(power)


def _square_sums(values: Array) -> Array:
    """Sum the squares of the values of every axis and window, shape (6, windows)."""
    # As in the pyramid of the record, this takes half as long as einsum.
    return np.asarray((values[:, :, None] @ values[..., None])[..., 0, 0])


@dataclass(frozen=True)
class Baseline:
    """Statistics of the windows of a sensor at rest."""

    # Median and robust standard deviation of the loudness of a window, as `_describe` returns it,
    # shape (12,).
    loudness: Array
    spread: Array
    # Robust standard deviation of the second difference of window means, shape (6,).
    wander: Array
    # Smallest change seen between two samples; infinite while constant, shape (6,).
    resolution: Array

    def limits(self, shorter: float = 1.0) -> Array:
        """Return the largest loudness and wander at rest; `shorter` is window length over rows."""
        # Far beyond chance: a lower threshold would cut out noise that is not quite normal. Chosen
        # by judgment.
        sigmas = 8.0
        # Loudness is the cube root of a variance, so noise up to 1.6 times as large is not motion.
        excess = np.maximum(sigmas * sqrt(shorter) * self.spread, 0.35 * self.loudness)
        # Where the noise does not dither the resolution, whole steps are not motion.
        coarse = self.loudness[:6] ** 1.5 < _FINE * self.resolution
        steps = np.where(coarse, self.resolution, 0.0)
        # A coarse output that flips between two values has a variance of up to a quarter of a
        # squared step.
        stepping = np.tile(np.cbrt(0.75 * steps ** 2), 2)
        return np.concatenate([np.maximum(self.loudness + excess, stepping),
                               np.maximum(sigmas * self.wander, 3 * steps)])

    @cached_property
    def loudest(self) -> Array:
        """Largest loudness of a whole window at rest."""
        return self.limits()[:12]


@dataclass
class RestLevel(Record):
    """The noise level at rest, as learned so far."""

    baseline: Baseline
    first: Array | None = None  # loudness when the noise level was last reported, shape (12,)
    # Loudness and wander of the windows at rest that make the baseline, and of those since, shape
    # (windows, 18).
    past: Array = field(default_factory=lambda: np.empty((0, 18)))
    news: Array = field(default_factory=lambda: np.empty((0, 18)))
    # The same of all windows since motion began, with the verdict, shape (windows, 19).
    lately: Array = field(default_factory=lambda: np.empty((0, 19)))
    quieter: int = 0  # number of windows in a row that are far quieter than the baseline

    @classmethod
    def of(cls, held: list[Segment], windows: Windows) -> 'RestLevel':
        """Determine the first baseline from the windows held back."""
        full = [segment for segment in held if segment.held >= windows.size]
        if not full:
            # With frequent gaps no segment may fill a window. Then each one of at least median
            # length serves as a window: one sample has no noise, and two may be equal by chance.
            full = [segment for segment in held if len(segment.loudness) == 1]
            usual = np.median([segment.held for segment in full]) if full else 0
            full = [segment for segment in full if segment.held >= usual]
        if not full:
            return cls(Baseline(*np.split(np.full(36, np.inf), [12, 24, 30])))
        table = np.concatenate([segment.statistics(0, len(segment.means)) for segment in full])
        resolution = np.min([_resolution_of(segment.joined().samples[:8 * 1024])
                             for segment in full[:4]], axis=0)
        still = ~np.concatenate([windows.implausible(segment, 0) for segment in full])
        # Before a sensor starts it repeats one value, which is no rest.
        started = table[:, :12].any(axis=1)
        fewest = 8   # windows from which the spread of loudness is measured
        if np.count_nonzero(still & started) >= fewest:
            still &= started
        if np.count_nonzero(still) < fewest:
            still[:] = True
        table = table[still]
        loudness = table[:, :12]
        # The quietest eighth of fewer is less than four windows, too few to give a spread.
        if len(table) >= 32:
            baseline, rest = _settle(table, resolution)
        else:
            # Here the quieter half is used, with the spread that follows from the number of
            # samples.
            quieter = np.argsort(loudness.sum(axis=1))[:(len(table) + 1) // 2]
            centre = np.median(loudness[quieter], axis=0)
            # The cube root of a variance of 25 samples has a relative error of sqrt(2 / 25) / 3.
            baseline = Baseline(centre, 0.1 * centre, np.full(6, np.inf), resolution)
            if len(table) < fewest:
                return cls(baseline)
            rest = np.all(loudness <= baseline.loudest, axis=1)
            if np.count_nonzero(rest) >= fewest:
                found = _baseline_of(table[rest], resolution)
                baseline = replace(baseline, wander=found.wander)
        past = table[rest]
        return cls(baseline, baseline.loudness, past[~np.isnan(past).any(axis=1)])

    def exceeds_rest(self, windows: Array, shorter: float = 1.0) -> Bools:
        """Find windows, shape (n, 18), that are louder or wander farther than at rest."""
        # Without a neighbour the wander is NaN, which compares as not wide.
        return np.asarray((np.abs(windows) > self.baseline.limits(shorter)).any(axis=1))

    def refine_resolution(self, segment: Segment, windows: Ints, size: int) -> bool:
        """Look for smaller steps in the rows of `windows`; return whether any were found."""
        # A change by one step of a coarse output is not motion. Some outputs are constant for
        # minutes before they show how small their step is.
        rows = segment.joined().samples
        known = self.baseline.resolution
        smaller = known
        for window in (windows + segment.base - segment.given).tolist():
            near = rows[max(window - 1, 0) * size:(window + 2) * size]
            smaller = np.minimum(smaller, _resolution_of(near))
        if np.array_equal(smaller, known):
            return False
        self.baseline = replace(self.baseline, resolution=smaller)
        return True

    def awake(self, windows: Array) -> Bools:
        """Find windows in which an axis changes that was constant until then."""
        changes = (windows[:, :6] > 0) & np.isinf(self.baseline.resolution)
        return np.asarray(changes.any(axis=1))

    def contrast(self, windows: Array) -> Array:
        """Return the logarithm by which each window is louder; empty if no axis shows it."""
        rest = self.baseline.loudness
        known = (rest > 0) & np.isfinite(rest)
        if not known.any():
            return np.empty(0)
        louder: Array = np.max(windows[:, :12][:, known] / rest[known], axis=1)
        return np.log(np.maximum(louder, 1.0))

    def deeper_rest(self, segment: Segment, first: int, last: int) -> int | None:
        """Find the start of windows far quieter than the baseline, which are the actual rest."""
        # If a recording begins while its vehicle drives, the first baseline is that of driving.
        loud, windows = self.baseline.loudness, segment.loudness[first:last]
        quiet = windows < loud / QUIETER
        if not quiet.any():
            self.quieter = 0
            return None
        # An axis that has become constant is dead.
        alive = (windows > 0) & (loud > 0) & np.isfinite(loud)
        quieter = (np.sum(quiet & alive, axis=1) > 0.5 * alive.sum(axis=1)) & ~np.any(
            windows > self.baseline.loudest, axis=1)
        in_a_row = 6   # quiet windows that are rest: between two bumps of a road there are fewer
        for at in range(first, last):
            self.quieter = self.quieter + 1 if quieter[at - first] else 0
            if self.quieter == in_a_row and at + 1 >= in_a_row:
                return at + 1 - in_a_row
        return None

    def begin_at(self, segment: Segment, first: int, last: int) -> None:
        """Start a new baseline from the windows from array index `first` on."""
        found = _baseline_of(segment.statistics(first, last), self.baseline.resolution)
        # A few windows give a spread only to within a factor of two.
        self.baseline = replace(found, spread=2 * found.spread, wander=2 * found.wander)
        self.first = found.loudness
        self.quieter = 0
        self.past, self.news, self.lately = self.past[:0], self.news[:0], self.lately[:0]

    def learn(self, windows: Array, moving: Bools, beyond: Bools) -> list[float]:
        """Learn from windows at rest; return ratios of new to old noise if it has changed."""
        changes: list[float] = []
        inner = ~np.isnan(windows[:, 12])
        self.news = np.concatenate([self.news, windows[inner & ~moving]])
        # The newest two minutes are half of the next baseline, which thus follows temperature, but
        # not a slow turn.
        if len(self.news) >= 256:
            # With less than four minutes at rest, the threshold scatters.
            self.past, self.news = np.concatenate([self.past, self.news])[-512:], self.news[:0]
            changes += self._adopt(_baseline_of(self.past, self.baseline.resolution))
        if len(self.lately) or moving.any():
            verdict = np.where(beyond, 2.0, moving)
            self.lately = np.concatenate([self.lately, np.column_stack([windows, verdict])[inner]])
            # After a minute, a new level may be the sensor's own. Chosen by judgment.
            if len(self.lately) >= 128:
                changes += self._accept_change()
                self.lately = self.lately[:0]
        return changes

    def _accept_change(self) -> list[float]:
        """Accept a new steady level as the sensor's own, if it is not much louder."""
        verdict = self.lately[:, 18]
        share = float(np.mean(verdict))
        # At a new level, at least one window in twenty is classified as motion.
        if np.any(verdict > 1) or share < 0.05:
            return []
        baseline, still = _settle(self.lately[:, :18], self.baseline.resolution)
        # Three times louder than rest is an engine, not the sensor. Chosen by judgment. An axis
        # that has only begun to give values had no level before.
        little = np.where(self.baseline.loudness > 0, QUIETER * self.baseline.loudest, np.inf)
        # If less than a quarter was classified as motion, it was knocks. The exception is that all
        # windows are similar, as when a single axis has become louder; windows of motion are not.
        if (share < 0.25 and not still.all()) or (
                np.mean(still) <= 0.9 or np.any(baseline.loudness >= little)):
            return []
        self.past, self.news = self.lately[still, :18], self.news[:0]
        return self._adopt(baseline)

    def _adopt(self, baseline: Baseline) -> list[float]:
        """Adopt a new baseline; return the ratio if noise has become much louder or quieter."""
        self.baseline = baseline
        if self.first is None:
            self.first = baseline.loudness
        known = (self.first > 0) & (baseline.loudness > 0)
        ratio = (baseline.loudness[known] / self.first[known]) ** 1.5
        most = max(ratio.tolist(), key=lambda ratio: abs(log(ratio)), default=1.0)
        # Noise that has become three times louder or quieter is reported. Chosen by judgment.
        if abs(log(most)) <= log(3.0):
            return []
        self.first = baseline.loudness
        return [most]


def _settle(windows: Array, resolution: Array) -> tuple[Baseline, Bools]:
    """Find the windows at rest, and their baseline."""
    # The set grows from the quietest eighth until there is a hole of many standard deviations in
    # the distribution of loudness. Wander is NaN at the ends of a segment.
    loudness = windows[:, :12]
    dead = _dead(loudness, resolution)
    percentile = np.nanpercentile if dead.any() else np.percentile
    # The quietest windows are taken for rest: with less rest than that, motion enters the
    # baseline.
    quietest = 12.5
    quiet = percentile(np.where(np.tile(dead, 2), np.nan, loudness), quietest, axis=0)
    noisy = quiet > 0
    rest = np.ones(len(loudness), dtype=bool)
    if noisy.any():
        louder = np.max(loudness[:, noisy] / quiet[noisy], axis=1)
        if not dead.any(axis=1).all():
            # The maximum over fewer axes is lower by chance, and says nothing of the dead ones.
            louder[dead.any(axis=1)] = np.inf
        rest = louder <= np.percentile(louder[np.isfinite(louder)], quietest)
    for _ in range(50):
        baseline = _baseline_of(windows[rest], resolution)
        grown = np.all(loudness <= baseline.loudest, axis=1)
        if np.array_equal(grown, rest):
            break
        rest = grown
    return baseline, rest


def _baseline_of(windows: Array, resolution: Array) -> Baseline:
    """Describe windows at rest, shape (n, 18), by medians."""
    median, dead = np.median, _dead(windows, resolution)
    if dead.any():
        median = np.nanmedian
        windows = np.where(np.tile(dead, 3), np.nan, windows)
    loudness, inner = windows[:, :12], windows[~np.isnan(windows[:, 12:]).all(axis=1), 12:]
    centre = median(loudness, axis=0)
    spread = 1.4826 * median(np.abs(loudness - centre), axis=0)
    wide = np.full(6, np.inf)
    # Of fewer windows the median may be far below the others by chance.
    known = np.count_nonzero(~np.isnan(inner), axis=0) >= 16
    if known.any():
        wide[known] = 1.4826 * median(np.abs(inner[:, known]), axis=0)
    return Baseline(centre, spread, wide, resolution)


def _dead(windows: Array, resolution: Array) -> Bools:
    """Find windows in which an axis is dead, shape (n, 6)."""
    # A fine axis is never constant while others change. Axes that never changed, and coarse ones,
    # are not included.
    still = windows[:, :6] == 0
    dead: Bools = still & ~still.all(axis=1)[:, None] & ~still.all(axis=0)
    for axis in np.flatnonzero(dead.any(axis=0)).tolist():
        noise = float(np.median(windows[~still[:, axis], axis])) ** 1.5
        dead[:, axis] &= noise >= _FINE * resolution[axis]
    return dead


def _resolution_of(samples: Array) -> Array:
    """Return the smallest change between neighbours of each axis, infinite if there is none."""
    change = np.abs(np.diff(samples, axis=0))
    change[change == 0] = np.inf
    smallest: Array = np.min(change, axis=0, initial=np.inf)
    return smallest
