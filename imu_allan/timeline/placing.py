# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The second stage of a timeline: usable messages find their places on the even grid.

Messages are put in order and split where the clock jumps. Segments at another rate are left out,
steps on the grid are counted, short gaps interpolated, and long ones listed. This is one class
because every step moves the same cursor.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import sqrt

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import EvenBlock, NEIGHBOURS
from imu_allan.state import Record
from imu_allan.timeline.alive import SPARSE
from imu_allan.timeline.clock import (
    in_order,
    order_stamps,
    place_in_burst,
    SECOND,
    Stamps,
)
from imu_allan.timeline.grid import (
    count_steps,
    even_blocks,
    EVEN_JITTER,
    RATE_BLOCK,
    rate_changes,
)
from imu_allan.timeline.memory import Memory
from imu_allan.timeline.messages import Messages
from imu_allan.timeline.pace import measure_pace, Pace
import numpy as np

_NEVER_NS = 5 * 365 * 86400 * SECOND
"""No recording lasts five years: a longer step is a stamp fault, whatever the other clock
shows."""
_LATELY = 128
"""Latest messages, from which lateness and jitter are measured: some seconds at common rates."""
_FOLLOWED = 0.01
"""A larger change of the interval within a window is another rate, not drift."""


class Placing(Record):
    """Places usable messages on the grid."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._options, self._counts = memory.options, memory.counts
        self._decision, self.cursor = memory.decision, memory.cursor

    def _are_even(self, messages: Messages) -> bool:
        """Return whether usable messages are one interval apart, the usual case."""
        cursor, decision = self.cursor, self._decision
        stamps, consumed, interval = messages.stamps, messages.consumed, decision.pace.interval_ns
        if (not consumed or messages.void.any() or cursor.last_ns is None or cursor.fresh_run
                or cursor.other_rate or decision.pace.counting or decision.counted_only):
            return False
        first = int(stamps[0]) - cursor.last_ns
        steps = stamps[1:] - stamps[:-1]
        least, most = (1 - EVEN_JITTER) * interval, (1 + EVEN_JITTER) * interval
        return bool(
            least < first < most
            and (not len(steps) or (least < steps.min() and steps.max() < most))
            and abs(int(stamps[consumed - 1]) - cursor.last_ns - consumed * interval)
            < 4 * interval)

    def _place_even(self, messages: Messages) -> EvenBlock:
        """Fast path of `place` for messages that `_are_even` accepts."""
        cursor, stamps, c = self.cursor, messages.stamps, messages.consumed
        assert cursor.last_ns is not None
        if self._decision.separates_equal_stamps:
            cursor.tied_to, cursor.ties = int(stamps[c - 1]), 0
        begins = cursor.elapsed_ns + int(stamps[0]) - cursor.last_ns
        block = EvenBlock(messages.samples[:c], cursor.index + 1, start_s=begins / SECOND)
        passed = int(stamps[c - 1]) - cursor.last_ns
        lately = stamps[max(c - _LATELY, 0):c]
        late = ((lately - lately[-1]) / self._decision.pace.interval_ns
                + np.arange(len(lately) - 1, -1, -1))
        self._advance(messages, late, passed, c, passed, c)
        return block

    def place(self, messages: Messages) -> Iterator[EvenBlock]:
        """Put messages on the grid, or raise ImuAllanError if no IMU has their pace."""
        if self._are_even(messages):
            yield self._place_even(messages)
        elif len(messages.stamps):
            for run in self._runs(messages):
                yield from self._at_one_rate(run)

    def _runs(self, messages: Messages) -> Iterator[Messages]:
        """Put messages in order and split them where the clock jumps."""
        cursor, counts, c = self.cursor, self._counts, messages.consumed
        if self._decision.separates_equal_stamps:
            messages = replace(messages, stamps=self._untie(messages.stamps, c))
        order = order_stamps(messages.stamps, None if cursor.fresh_run else cursor.last_ns)
        jumps = np.zeros(len(messages.stamps), dtype=bool)
        if order is not None:
            usable = ~messages.void[:c]
            counts.duplicates += int(np.count_nonzero(order.duplicate[:c] & usable))
            early = ~(order.keep | order.duplicate)[:c]
            counts.out_of_order += int(np.count_nonzero(early & usable))
            c = int(np.count_nonzero(order.keep[:c]))
            messages, jumps = messages.pick(order.keep, c), order.jumps[order.keep]
        if not c:
            return
        jumps |= self._forward_jumps(messages.stamps, messages.other)
        starts = np.flatnonzero(jumps).tolist()
        for first, last in pairwise([0, *(s for s in starts if 0 < s < c), c]):
            if first in starts:
                counts.clock_jumps += 1
                cursor.fresh_run = cursor.jumped = True
            end = next((s for s in starts if s >= last), len(jumps))
            run = messages.pick(slice(first, end), last - first)
            if cursor.begins and run.void.any():
                # Unusable messages before the first sample are not missing.
                empty = int(np.argmin(run.void)) if not run.void.all() else len(run.void)
                run = run.pick(slice(empty, None), max(run.consumed - empty, 0))
            if run.consumed:
                yield run

    def _untie(self, stamps: Stamps, consumed: int) -> Stamps:
        """Separate messages with equal stamps by one nanosecond each."""
        cursor = self.cursor
        if self._decision.overlaps:
            stamps = in_order(stamps, cursor.tied_to, self._decision.pace.interval_ns)
        since = place_in_burst(stamps, cursor.tied_to, cursor.ties)
        if consumed:
            cursor.tied_to, cursor.ties = int(stamps[consumed - 1]), int(since[consumed - 1])
        return stamps + since

    def _forward_jumps(self, stamps: Stamps, other: Stamps) -> Bools:
        """Find messages before which this clock, but not the other one, jumped ahead."""
        cursor = self.cursor
        jumps = np.zeros(len(stamps), dtype=bool)
        interval = self._decision.pace.interval_ns
        # A jump of one clock alone by more than a second is a step of that clock.
        limit = max(SECOND, min(200 * interval, _NEVER_NS))
        last = cursor.last_ns if cursor.last_ns is not None else int(stamps[0])
        steps = np.diff(stamps, prepend=last)
        for at in np.flatnonzero(steps > limit).tolist():
            low, high = max(at - 32, 0), min(at + 32, len(stamps) - 1)
            passed = float(other[high] - (other[low] if at else cursor.other_ns))
            usual = (high - low + (0 if at else 1)) * interval
            alive = other[high] != other[low]
            jumps[at] = ((alive and passed < usual + 0.25 * steps[at])
                         or steps[at] + cursor.elapsed_ns > _NEVER_NS)
        return jumps

    def _at_one_rate(self, messages: Messages) -> Iterator[EvenBlock]:
        """Leave out segments whose rate is not the first one, and place the others."""
        cursor, decision = self.cursor, self._decision
        if decision.first_interval_ns is None:
            pace = measure_pace(messages.stamps)
            if pace is not None:
                decision.take_pace(pace, np.array_equal(messages.stamps, messages.other))
        c, steps = messages.consumed, self._steps(messages)
        if not decision.counted_only and (cursor.other_rate
                                          or self._rate_uncertain(messages, steps)):
            changes = rate_changes(self._places(messages)[:c], decision.pace, cursor.other_rate)
            if len(changes) > 1 or (changes[0][1] and not self._as_before(messages)):
                yield from self._split_by_rate(messages, changes)
                return
            cursor.other_rate = False
            self._note_uneven(messages, steps)
        yield from self._put(messages, steps)

    def _as_before(self, messages: Messages) -> bool:
        """Return whether messages together have the previous rate, which outages hide in parts."""
        pace = measure_pace(messages.stamps[:messages.consumed])
        return pace is not None and abs(
            pace.interval_ns / self._decision.pace.interval_ns - 1) < _FOLLOWED

    def _split_by_rate(self, messages: Messages,
                       changes: list[tuple[int, bool]]) -> Iterator[EvenBlock]:
        ends = [first for first, _ in changes[1:]] + [messages.consumed]
        for (first, other_rate), last in zip(changes, ends, strict=True):
            end = len(messages.stamps) if last == messages.consumed else last
            part = messages.pick(slice(first, end), last - first)
            if part.consumed and other_rate:
                self._leave_out(part)
            elif part.consumed:
                self.cursor.other_rate = False
                yield from self._put(part, self._steps(part))

    def _leave_out(self, messages: Messages) -> None:
        """Reject messages that come at another rate."""
        cursor, counts = self.cursor, self._counts
        n = messages.consumed
        counts.rejected += int(np.count_nonzero(~messages.void[:n]))
        if not counts.changed_rate_hz and n > 1:
            since = (0 if cursor.last_ns is None
                     else cursor.elapsed_ns + int(messages.stamps[0]) - cursor.last_ns)
            counts.rate_changed_s = since / SECOND
            pace = measure_pace(messages.stamps[:n])
            counts.changed_rate_hz = SECOND / pace.interval_ns if pace else 0.0
        counts.at_other_rate += n
        cursor.other_rate = True

    def _places(self, messages: Messages) -> Array:
        """Return stamps in intervals since the last sample placed."""
        cursor, interval = self.cursor, self._decision.pace.interval_ns
        if cursor.fresh_run or cursor.last_ns is None:
            since, late = messages.stamps - messages.stamps[0], interval
        else:
            since, late = messages.stamps - cursor.last_ns, cursor.late_ns
        places: Array = (since.astype(np.float64) + late) / interval
        return places

    def _steps(self, messages: Messages) -> Ints:
        """Count grid steps to each message from the one before."""
        cursor, pace = self.cursor, self._decision.pace
        late = 0.0 if cursor.begins else cursor.late_ns / pace.interval_ns
        return count_steps(self._places(messages), pace, late, cursor.begins)

    def _passed(self, stamps: Stamps, steps: Ints) -> tuple[float, int, int]:
        """Return elapsed intervals, grid places and number of messages, each without gaps."""
        pace, steps = self._decision.pace, steps[1:]
        passed = np.diff(stamps)
        short = ~_gaps(passed, steps, self._options.gap_tolerance + 1, pace)
        return (float(passed[short].sum()) / pace.interval_ns, int(steps[short].sum()),
                int(np.count_nonzero(short)))

    def _disagree(self, passed: float, counted: int, messages: int) -> bool:
        """Return whether elapsed and counted intervals differ by more than jitter explains."""
        pace = self._decision.pace
        width = sqrt(12) * pace.spread if pace.counting else 0.0
        return abs(passed - counted) > 4 + width + 0.003 * messages

    def _note_uneven(self, messages: Messages, steps: Ints) -> None:
        """Record rates that differ too little, or too briefly, for messages to be left out."""
        counts, c = self._counts, messages.consumed
        stamps, steps = messages.stamps[:c], steps[:c]
        whole = self._uneven_rate(stamps, steps)
        if whole is None:
            return
        # A difference for some seconds is small in the whole, so parts of 256 messages are
        # checked, too. At least `_LATELY` of these must be free of gaps.
        parts = [self._uneven_rate(stamps[first:first + 256], steps[first:first + 256])
                 for first in range(0, c, 128)]
        rates = [SECOND / self._decision.pace.interval_ns, whole, *filter(None, parts)]
        counts.lowest_rate_hz = min(counts.lowest_rate_hz or whole, *rates)
        counts.highest_rate_hz = max(counts.highest_rate_hz, *rates)

    def _uneven_rate(self, stamps: Stamps, steps: Ints) -> float | None:
        """Return the rate of messages, or None if it is unchanged or they are too few."""
        passed, counted, unbroken = self._passed(stamps, steps)
        if counted < _LATELY or passed <= 0 or not self._disagree(passed, counted, unbroken):
            return None
        return SECOND / self._decision.pace.interval_ns * counted / passed

    def _rate_uncertain(self, messages: Messages, steps: Ints) -> bool:
        c = messages.consumed
        if c < 2:
            return False
        passed, counted, unbroken = self._passed(messages.stamps[:c], steps[:c])
        if self._disagree(passed, counted, c) or counted - unbroken > 0.25 * c:
            return True
        # Half the rate for some of the messages looks like every second one lost.
        blocks = steps[1:c][:(c - 1) // RATE_BLOCK * RATE_BLOCK].reshape(-1, RATE_BLOCK)
        return bool(np.any(np.count_nonzero(blocks > 1, axis=1) >= RATE_BLOCK // 2))

    def _put(self, messages: Messages, steps: Ints) -> list[EvenBlock]:
        """Put messages on the grid and update the counts."""
        cursor, counts = self.cursor, self._counts
        empty = 0
        if messages.void.any():
            used = ~messages.void
            rows = np.flatnonzero(used[:messages.consumed])
            empty = int(rows[-1]) + 1 - len(rows) if len(rows) else 0
            messages = messages.pick(used, len(rows))
            steps = np.diff(np.cumsum(steps)[used], prepend=0)
        c, stamps = messages.consumed, messages.stamps
        if not c:
            return []
        interval = self._decision.pace.interval_ns
        new_run = cursor.begins
        if new_run:
            self._begin_run(int(stamps[0]), int(messages.other[0]), interval)
            steps[0] = 1
            self._memory.tail = np.empty((0, 6))
        reference = int(stamps[0]) if new_run or cursor.last_ns is None else cursor.last_ns
        tolerated = self._options.gap_tolerance + 1
        known = steps[:c]
        index = cursor.index + np.cumsum(known)
        missing = int(index[-1]) - cursor.index - c
        elapsed = stamps[:c] - (reference - cursor.elapsed_ns)
        behind = np.diff(elapsed, prepend=cursor.elapsed_ns)
        if missing:
            for at in np.flatnonzero(known > tolerated).tolist():
                lasts = int(behind[at])
                counts.list_gap(int(elapsed[at]) - lasts + interval, max(lasts - interval, 0.0))
        left_out_ns, left_out = _unpaced(behind, known, tolerated, self._decision.pace)
        paced_ns = int(elapsed[-1]) - cursor.elapsed_ns - left_out_ns
        paced_steps = int(index[-1]) - cursor.index - (1 if new_run else 0) - left_out
        counts.missing += missing - empty
        if missing:
            blocks = even_blocks(self._memory.tail, messages.samples, steps, index, elapsed,
                                 interval, tolerated, new_run)
            counts.interpolated += sum(len(block.interpolated) for block in blocks)
        else:
            blocks = [EvenBlock(messages.samples[:c], cursor.index + 1, new_run=new_run,
                                start_s=float(elapsed[0]) / SECOND)]
        lately = slice(max(c - _LATELY, 0), c)
        late = (elapsed[lately] - elapsed[-1]) / interval - (index[lately] - index[-1])
        self._advance(messages, late, int(elapsed[-1]) - cursor.elapsed_ns,
                      int(index[-1]) - cursor.index, paced_ns, paced_steps)
        return blocks

    def _advance(self, messages: Messages, late: Array, passed_ns: int, places: int,
                 paced_ns: int, paced_steps: int) -> None:
        """Update counts and cursor; `late` is how late recent stamps are relative to the last."""
        cursor, counts, c = self.cursor, self._counts, messages.consumed
        interval = self._decision.pace.interval_ns
        counts.samples += c
        counts.paced_ns += paced_ns
        counts.paced_steps += paced_steps
        cursor.elapsed_ns += passed_ns
        cursor.index += places
        cursor.last_ns, cursor.other_ns = int(messages.stamps[c - 1]), int(messages.other[c - 1])
        cursor.late_ns = -float(np.sort(late)[len(late) // 2]) * interval
        mean = float(np.add.reduce(late)) / len(late)
        cursor.jitter = sqrt(max(float(np.dot(late, late)) / len(late) - mean * mean, 0.0))
        self._memory.tail = (
            messages.samples[c - NEIGHBOURS:c] if c >= NEIGHBOURS else
            np.concatenate([self._memory.tail, messages.samples[:c]])[-NEIGHBOURS:])
        if all(axis.ever for axis in self._memory.presence.axes[3:]):
            some = messages.samples[:c:SPARSE, 3:]
            gone = np.flatnonzero(np.isnan(some).any(axis=1))
            if len(gone):
                # An axis was absent for a while, and may have been dead before.
                some = some[int(gone[-1]) + 1:]
            counts.gravity = (np.array(counts.gravity) + some.sum(axis=0)).tolist()
            counts.gravity_samples += len(some)
        if paced_steps > _LATELY and not self._decision.counted_only:
            lately_ns = paced_ns / paced_steps
            if abs(lately_ns / interval - 1) < _FOLLOWED:
                # Only part of the change is followed: an oscillator drifts slowly, jitter does
                # not.
                self._decision.pace = replace(
                    self._decision.pace, interval_ns=interval + 0.2 * (lately_ns - interval))

    def _begin_run(self, stamp: int, other: int, interval: float) -> None:
        """Continue the time at the first message of a run, by the clock that did not jump."""
        cursor = self.cursor
        cursor.fresh_run, jumped = False, cursor.jumped
        cursor.jumped = False
        if cursor.last_ns is None:
            cursor.first_ns = stamp
            return
        passed = stamp - cursor.last_ns
        if jumped or not 0 < passed < _NEVER_NS - cursor.elapsed_ns:
            passed = other - cursor.other_ns
            if not 0 < passed < _NEVER_NS - cursor.elapsed_ns:
                passed = round(interval)
        if passed > (self._options.gap_tolerance + 1.5) * interval:
            self._counts.list_gap(cursor.elapsed_ns + interval, passed - interval)
        cursor.elapsed_ns += passed


def _gaps(passed: Ints, steps: Ints, tolerated: int, pace: Pace) -> Bools:
    """Find long gaps, as opposed to single messages that are as late as a gap is long."""
    far: Bools = steps > tolerated
    # If only the message is late, time and places differ by three intervals or more.
    return far if pace.counting else far & (
        np.abs(passed / pace.interval_ns - steps) < 3.0)


def _unpaced(passed: Ints, steps: Ints, tolerated: int, pace: Pace) -> tuple[int, int]:
    """Return the time and places to exclude from the rate: gaps, and places beside them."""
    # Up to 64 steps are counted correctly at any rate near the true one, and help to measure it.
    gaps = _gaps(passed, steps, tolerated if pace.counting else 64, pace)
    if not pace.counting and np.count_nonzero(gaps) * SPARSE < len(gaps):
        # With jitter, a place of a gap may be counted up to three steps beside it.
        beside = np.flatnonzero(gaps)[:, None] + np.arange(-3, 4)
        gaps[np.clip(beside, 0, len(gaps) - 1)] = True
    # With uneven stamps, the pause before a batch is not part of the gap.
    time = np.rint(steps * pace.interval_ns).astype(np.int64) if pace.counting else passed
    return int(time[gaps].sum()), int(steps[gaps].sum())
