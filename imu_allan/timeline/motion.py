# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Detection and removal of motion and knocks, and a look for slow turns.

Rows are collected in segments and measured in windows. When the neighbours of a window are known,
it is judged against the level of rest, and then kept, or cut out with a margin. Slow turns and
tilts are too slow for that: the mean moves away and comes back.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import inf, log

from imu_allan.arrays import Array, Bools, runs
from imu_allan.block import EvenBlock
from imu_allan.result import LISTED_SPANS
from imu_allan.state import Record
from imu_allan.timeline.rest_level import QUIETER, RestLevel, Segment, Windows
import numpy as np

_LEAST_TURN = np.array([0.004] * 3 + [0.04] * 3)
"""In rad/s and m/s^2: no bias moves this far and back within two minutes. Chosen by judgment."""


@dataclass
class SlowTurns(Record):
    """Times during which the mean of an axis had moved away."""

    # Sum of the means of the windows in the newest block, and number of these windows.
    sums: Array = field(default_factory=lambda: np.zeros(6))
    windows: int = 0
    # Start in seconds and mean of each axis, for the latest blocks, shape (blocks, 7).
    blocks: Array = field(default_factory=lambda: np.empty((0, 7)))
    # Start and duration in seconds, number of the axis, and size in its unit.
    found: list[list[float]] = field(default_factory=list)

    def take(self, means: Array, start_s: float, window_s: float) -> None:
        """Add the means of windows at rest, shape (n, 6), of which the first is at `start_s`."""
        new = []
        in_block = 8   # windows of half a second: a slow turn lasts longer
        ends = range(in_block - self.windows, len(means), in_block)
        for first, last in pairwise([0, *ends, len(means)]):
            self.sums = self.sums + means[first:last].sum(axis=0)
            self.windows += last - first
            if self.windows == in_block:
                new.append([start_s + (last - in_block) * window_s, *self.sums / in_block])
                self.sums, self.windows = np.zeros(6), 0
        # Where all are near each other, none of the new ones is back from an excursion.
        suspect = bool(new) and bool((np.ptp(np.vstack([self.blocks, new])[:, 1:], axis=0)
                                      > _LEAST_TURN).any())
        for block in new:
            # A mean that takes more than 32 blocks, two minutes, to come back is drift.
            self.blocks = np.vstack([self.blocks[-31:], block])
            if suspect:
                self._look(in_block * window_s)

    def _look(self, block_s: float) -> None:
        """Record an excursion if the newest block is back from one."""
        starts, level = self.blocks[:, 0], self.blocks[:, 1:]
        # Less than half a minute does not show the usual change.
        if len(level) < 8:
            return
        usual = np.median(np.abs(np.diff(level, axis=0)), axis=0)
        size = level - level[-1]
        # A random walk does not jump by 14 times its usual change.
        far = np.abs(size) > np.maximum(_LEAST_TURN, 14.0 * usual)
        for axis in np.flatnonzero(far.any(axis=0)).tolist():
            away = np.flatnonzero(far[:, axis])
            peak = float(size[away[np.argmax(np.abs(size[away, axis]))], axis])
            # The mean returns to within 0.3 of the excursion from the level before.
            before = np.flatnonzero(np.abs(size[:away[0], axis]) < 0.3 * abs(peak))
            first, last = int(away[0]), int(away[-1])
            edges = (size[min(first + 1, last), axis] - size[max(first - 2, 0), axis],
                     size[max(last - 1, first), axis] - size[min(last + 2, len(size) - 1), axis])
            # The excursion begins and ends within three blocks.
            if (not len(before) or far[-2, axis]
                    or min(abs(edge) for edge in edges) < 0.7 * abs(peak)):
                continue
            # With more than ten, the recording is one of motion.
            if len(self.found) < 10:
                begins = float(starts[first])
                self.found.append([begins, float(starts[last]) + block_s - begins, axis, peak])
            self.blocks = self.blocks[-1:]
            return


@dataclass
class Spans(Record):
    """Spans of rows that were cut out, or kept."""

    # Start and duration in seconds of the first spans.
    listed: tuple[tuple[float, float], ...] = ()
    # Number, rows and duration of all spans, and duration of the longest.
    count: int = 0
    rows: int = 0
    total_s: float = 0.0
    longest_s: float = 0.0
    # Grid place and time at which the newest span ends, and its duration.
    end: int = -1
    end_s: float = -inf
    lasts_s: float = 0.0

    def add(self, first: int, rows: int, start_s: float, duration_s: float) -> None:
        """Record rows, as part of the span before if they follow it directly."""
        if first == self.end and self.count:
            self.lasts_s += duration_s
            if self.count == len(self.listed):
                self.listed = (*self.listed[:-1], (self.listed[-1][0], self.lasts_s))
        else:
            self.count += 1
            self.lasts_s = duration_s
            if len(self.listed) < LISTED_SPANS:
                self.listed = (*self.listed, (start_s, duration_s))
        self.end, self.end_s = first + rows, start_s + duration_s
        self.rows += rows
        self.total_s += duration_s
        self.longest_s = max(self.longest_s, self.lasts_s)


@dataclass
class MotionSummary(Record):
    """What was cut out as motion, what was kept as rest, and how much louder motion is."""

    # Spans of motion, with their margins, and of rest.
    cut: Spans = field(default_factory=Spans)
    kept: Spans = field(default_factory=Spans)
    struck: int = 0  # rows in windows in motion, without the margins
    # Whether the newest motion ended less than five seconds before the newest row.
    moving: bool = False
    # Sum of the logarithms by which windows in motion are louder than rest, and number of these
    # windows.
    louder: float = 0.0
    compared: int = 0
    # When the noise level changed for good, and ratio of new to old standard deviation.
    changes: tuple[tuple[float, float], ...] = ()

    @property
    def seen(self) -> int:
        """Rows decided on."""
        return self.cut.rows + self.kept.rows

    @property
    def contrast(self) -> float:
        """Mean logarithm by which windows in motion are louder than rest."""
        return self.louder / max(self.compared, 1)

    def all_cut(self, end: int, windows: int) -> 'MotionSummary':
        """Return a summary with all rows up to a grid place as motion: rest begins only there."""
        total_s = self.cut.total_s + self.kept.total_s
        cut = Spans(((0.0, total_s),), 1, self.seen, total_s, total_s, end, self.cut.end_s,
                    total_s)
        return MotionSummary(cut, struck=self.seen, moving=self.moving,
                             louder=windows * log(QUIETER), compared=windows)


@dataclass
class MotionDetector(Record):
    """Removes motion and knocks, with a delay of some windows, in constant memory."""

    interval_s: float  # sample interval; a window is half a second, at least 25 rows
    _level: RestLevel | None = None
    summary: MotionSummary = field(default_factory=MotionSummary)
    turns: SlowTurns = field(default_factory=SlowTurns)  # slow turns, which are not cut out
    held: list[Segment] = field(default_factory=list)  # rows not yet decided on
    _run_pending: bool = False
    _void: bool = False

    @cached_property
    def _windows(self) -> Windows:
        return Windows(self.interval_s)

    def forget_means(self) -> None:
        """Compare later means with none from before, as the sensor may have other ones now."""
        self.turns = SlowTurns(found=self.turns.found)

    def push(self, block: EvenBlock) -> list[EvenBlock]:
        """Take even rows, and return those decided to be at rest."""
        last = self.held[-1] if self.held else None
        if (last is None or last.closed or block.new_run
                or block.first_index != last.blocks[-1].end):
            if last is not None:
                last.closed = True
            last = Segment(block.first_index, block.start_s, block.new_run)
            self.held.append(last)
        last.start_s = block.start_s - (block.first_index - last.first_index) * self.interval_s
        last.blocks.append(block)
        return self._decide(final=False)

    def flush(self) -> list[EvenBlock]:
        """Decide on all rows held back, and return those at rest."""
        if self.held:
            self.held[-1].closed = True
        return self._decide(final=True)

    def _decide(self, final: bool) -> list[EvenBlock]:
        # Windows held back, the quieter of which make the first baseline.
        at_start = 128
        if self._level is None:
            windows = sum(segment.held // self._windows.size for segment in self.held)
            rows = sum(segment.held for segment in self.held)
            if windows < at_start and rows < 2 * at_start * self._windows.size and not final:
                return []
        for segment in self.held:
            self._windows.measure(segment)
        level = self._level = self._level or RestLevel.of(self.held, self._windows)
        blocks: list[EvenBlock] = []
        for segment in self.held:
            self._judge(segment, level)
            blocks += self._give(segment)
        self.held = [segment for segment in self.held if not segment.closed]
        return blocks

    def _judge(self, segment: Segment, level: RestLevel) -> None:
        """Decide on the windows whose neighbours are known."""
        windows = self._windows
        first = len(segment.moving)
        last = len(segment.means) - (0 if segment.closed else 1)
        if last <= first:
            return
        found = segment.statistics(first, last)
        short = segment.given == 0 and segment.held < windows.size
        shorter = windows.size / segment.held if short else 1.0
        beyond = windows.implausible(segment, first)[:last - first]
        moving = beyond | level.exceeds_rest(found, shorter)
        unclear = moving | level.awake(found)
        if unclear.any() and level.refine_resolution(
                segment, np.flatnonzero(unclear) + first, windows.size):
            moving = beyond | level.exceeds_rest(found, shorter)
        segment.moving = np.concatenate([segment.moving, moving])
        if not short and (begins := level.deeper_rest(segment, first, last)) is not None:
            self._begin_at_rest(segment, level, begins, last)
            return
        if moving.any():
            louder = level.contrast(found[moving])
            self.summary.louder += float(louder.sum())
            self.summary.compared += len(louder)
        if not short:
            self._follow(segment, first, moving)
            time_s = windows.time(segment, segment.base + last)
            for ratio in level.learn(found, moving, beyond):
                # A sensor whose noise changes more than ten times has no level at all.
                self.summary.changes = (*self.summary.changes[:9], (time_s, ratio))

    def _follow(self, segment: Segment, first: int, moving: Bools) -> None:
        """Look for slow turns within each rest: after motion, another mean is another attitude."""
        for begin, end in runs(moving[1:] != moving[:-1], len(moving)):
            if moving[begin]:
                self.forget_means()
            else:
                self.turns.take(
                    segment.means[first + begin:first + end],
                    self._windows.time(segment, segment.base + first + begin),
                    self._windows.size * self.interval_s)

    def _begin_at_rest(self, segment: Segment, level: RestLevel, first: int, last: int) -> None:
        """Take windows from array index `first` on as rest, and all before as motion."""
        level.begin_at(segment, first, last)
        self._void = True
        self.turns = SlowTurns()
        segment.moving[:first] = True
        segment.moving[first:] = (
            self._windows.implausible(segment, first)[:last - first]
            | level.exceeds_rest(segment.statistics(first, last)))
        self.summary = self.summary.all_cut(
            segment.first_index + segment.given * self._windows.size,
            max(self.summary.seen // self._windows.size, 1))

    def _give(self, segment: Segment) -> list[EvenBlock]:
        """Return the rows at rest of the windows whose margin is known."""
        size = self._windows.size
        judged = segment.base + len(segment.moving)
        margin = 2   # windows, or one second, to settle; chosen by judgment
        upto = judged if segment.closed else judged - margin
        count = upto - segment.given
        if count <= 0:
            return []
        context = segment.given - segment.base
        near = np.convolve(segment.moving, np.ones(2 * margin + 1), 'full')[margin:]
        cut = near[context:context + count] > 0.5
        held = segment.joined()
        length = min(count * size, len(held))
        blocks = []
        for left, right in runs(cut[1:] != cut[:-1], len(cut)):
            part = held.part(left * size, min(right * size, length),
                             self._windows.time(segment, segment.given + left))
            place = part.first_index, len(part), part.start_s, len(part) * self.interval_s
            self._run_pending |= segment.new_run
            segment.new_run = False
            if cut[left]:
                self.summary.cut.add(*place)
            else:
                blocks.append(replace(
                    part, new_run=self._run_pending, restart=self._void,
                    after_motion=part.first_index == self.summary.cut.end))
                self._run_pending = self._void = False
                self.summary.kept.add(*place)
        struck = int(np.count_nonzero(segment.moving[context:context + count])) * size
        newest = self._windows.time(segment, segment.given) + length * self.interval_s
        self.summary.struck += min(struck, length)
        # Reported for five seconds, so that it does not flicker as somebody walks by.
        self.summary.moving = newest - self.summary.cut.end_s < 5.0
        segment.blocks = [held.part(length, len(held), held.start_s)]
        segment.given = upto
        # The next windows are compared with those that are kept here.
        drop = max(upto - margin - self._windows.farthest - 1 - segment.base, 0)
        segment.base += drop
        segment.means = segment.means[drop:]
        segment.loudness = segment.loudness[drop:]
        segment.moving = segment.moving[drop:]
        return blocks
