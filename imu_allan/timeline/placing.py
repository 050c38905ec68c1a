# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The second stage of a timeline: usable messages find their places on the even grid.

Messages are put in order and split where the clock jumps. Lost samples are counted, and segments
at another rate left out (losses.py). Short gaps are interpolated, and long ones listed.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import sqrt

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import EvenBlock, NEIGHBOURS
from imu_allan.timeline.losses import count_steps, EVEN_JITTER, may_change, rate_changes, unpaced
from imu_allan.timeline.memory import Memory, Messages, NEVER_NS
from imu_allan.timeline.pace import measure_pace
from imu_allan.timeline.stamps import order_stamps, place_in_burst, SECOND, Stamps
import numpy as np

_SPARSE = 17
"""One in this many samples enters the mean acceleration, which needs no more. An odd number, for
drivers that fill every second message with zeros."""
_FOLLOWED = 0.01
"""A larger change of the interval within a window is another rate, not drift."""


def _are_even(memory: Memory, messages: Messages) -> bool:
    """Return whether usable messages are one interval apart, the usual case."""
    cursor, decision = memory.cursor, memory.decision
    consumed, interval = messages.consumed, decision.pace.interval_ns
    if (not consumed or messages.void.any() or cursor.fresh_run or cursor.other_rate
            or decision.pace.counting or decision.counted_only):
        return False
    steps = np.diff(messages.stamps, prepend=cursor.last_ns)
    passed = int(messages.stamps[consumed - 1]) - cursor.last_ns
    return bool(steps.min() > (1 - EVEN_JITTER) * interval
                and steps.max() < (1 + EVEN_JITTER) * interval
                and abs(passed - consumed * interval) < 4 * interval)


def place(memory: Memory, messages: Messages) -> Iterator[EvenBlock]:
    """Put messages on the grid, or raise ImuAllanError if no IMU has their pace."""
    if _are_even(memory, messages):
        if memory.decision.separates_equal_stamps:
            newest = int(messages.stamps[messages.consumed - 1])
            memory.cursor.tied_to, memory.cursor.ties = newest, 0
        yield from _put(memory, messages, np.ones(len(messages.stamps), dtype=np.int64))
    elif len(messages.stamps):
        for run in _runs(memory, messages):
            yield from _at_one_rate(memory, run)


def _runs(memory: Memory, messages: Messages) -> Iterator[Messages]:
    """Put messages in order and split them where the clock jumps."""
    cursor, counts, c = memory.cursor, memory.counts, messages.consumed
    if memory.decision.separates_equal_stamps:
        messages = replace(messages, stamps=_untie(memory, messages.stamps, c))
    order = order_stamps(messages.stamps, None if cursor.fresh_run else cursor.last_ns)
    jumps = np.zeros(len(messages.stamps), dtype=bool)
    if order is not None:
        usable = ~messages.void[:c]
        counts.duplicates += int(np.count_nonzero(order.duplicate[:c] & usable))
        early = ~(order.keep | order.duplicate)[:c]
        counts.out_of_order += int(np.count_nonzero(early & usable))
        messages, jumps = messages.pick(order.keep), order.jumps[order.keep]
    c = messages.consumed
    if not c:
        return
    jumps |= _forward_jumps(memory, messages.stamps, messages.other)
    starts = np.flatnonzero(jumps).tolist()
    for first, last in pairwise([0, *(s for s in starts if 0 < s < c), c]):
        if first in starts:
            counts.clock_jumps += 1
            cursor.fresh_run = cursor.jumped = True
        end = next((s for s in starts if s >= last), len(jumps))
        run = messages.pick(slice(first, end))
        if cursor.fresh_run and run.void.any():
            # Unusable messages before the first sample are not missing.
            empty = int(np.argmin(run.void)) if not run.void.all() else len(run.void)
            run = run.pick(slice(empty, None))
        if run.consumed:
            yield run


def _untie(memory: Memory, stamps: Stamps, consumed: int) -> Stamps:
    """Separate messages with equal stamps by one nanosecond each."""
    cursor = memory.cursor
    since = place_in_burst(stamps, cursor.tied_to, cursor.ties)
    if consumed:
        cursor.tied_to, cursor.ties = int(stamps[consumed - 1]), int(since[consumed - 1])
    return stamps + since


def _forward_jumps(memory: Memory, stamps: Stamps, other: Stamps) -> Bools:
    """Find messages before which this clock, but not the other one, jumped ahead."""
    cursor = memory.cursor
    jumps = np.zeros(len(stamps), dtype=bool)
    interval = memory.decision.pace.interval_ns
    last = int(stamps[0]) if cursor.first_ns is None else cursor.last_ns
    steps = np.diff(stamps, prepend=last)
    for at in np.flatnonzero(steps > memory.decision.least_step_ns).tolist():
        low, high = max(at - 32, 0), min(at + 32, len(stamps) - 1)
        passed = float(other[high] - (other[low] if at else cursor.other_ns))
        usual = (high - low + (0 if at else 1)) * interval
        alive = other[high] != other[low]
        jumps[at] = ((alive and passed < usual + 0.25 * steps[at])
                     or steps[at] + cursor.elapsed_ns > NEVER_NS)
    return jumps


def _at_one_rate(memory: Memory, messages: Messages) -> Iterator[EvenBlock]:
    """Leave out segments whose rate is not the first one, and place the others."""
    cursor, decision = memory.cursor, memory.decision
    if decision.first_interval_ns is None:
        pace = measure_pace(messages.stamps)
        if pace is not None:
            decision.take_pace(pace)
    places, steps = _count(memory, messages)
    c, changes = messages.consumed, [(0, False)]
    tolerated = memory.options.gap_tolerance + 1
    if not decision.counted_only and (cursor.other_rate or may_change(
            messages.stamps[:c], steps[:c], decision.pace, tolerated)):
        changes = rate_changes(places[:c], decision.pace, cursor.other_rate)
        if changes == [(0, True)] and _as_before(memory, messages):
            changes = [(0, False)]
    for (first, other_rate), (last, _) in pairwise([*changes, (c, False)]):
        part = messages.pick(slice(first, last if last < c else None))
        if other_rate:
            _leave_out(memory, part)
        else:
            cursor.other_rate = False
            yield from _put(memory, part, steps if part.consumed == c else _count(memory, part)[1])


def _as_before(memory: Memory, messages: Messages) -> bool:
    """Return whether messages together have the previous rate, which outages hide in parts."""
    pace = measure_pace(messages.stamps[:messages.consumed])
    return pace is not None and abs(
        pace.interval_ns / memory.decision.pace.interval_ns - 1) < _FOLLOWED


def _leave_out(memory: Memory, messages: Messages) -> None:
    """Reject messages that come at another rate."""
    cursor, counts = memory.cursor, memory.counts
    n = messages.consumed
    counts.rejected += int(np.count_nonzero(~messages.void[:n]))
    if not counts.changed_rate_hz and n > 1:
        counts.rate_changed_s = cursor.elapsed_at(messages.stamps, 0) / SECOND
        pace = measure_pace(messages.stamps[:n])
        counts.changed_rate_hz = SECOND / pace.interval_ns if pace else 0.0
    counts.at_other_rate += n
    cursor.other_rate = True


def _count(memory: Memory, messages: Messages) -> tuple[Array, Ints]:
    """Return stamps in intervals since the last sample placed, and grid steps between them."""
    stamps, cursor, pace = messages.stamps, memory.cursor, memory.decision.pace
    # The first message of a run lies one place after the last, and is not late.
    new = cursor.fresh_run
    since, late_ns = (stamps - stamps[0], pace.interval_ns) if new else (
        stamps - cursor.last_ns, cursor.late_ns)
    places = (since.astype(np.float64) + late_ns) / pace.interval_ns
    return places, count_steps(places, pace, 0.0 if new else late_ns / pace.interval_ns, new)


def _put(memory: Memory, messages: Messages, steps: Ints) -> list[EvenBlock]:
    """Put messages on the grid and update the counts."""
    cursor, counts = memory.cursor, memory.counts
    empty = 0
    if messages.void.any():
        used = ~messages.void
        rows = np.flatnonzero(used[:messages.consumed])
        empty = int(rows[-1]) + 1 - len(rows) if len(rows) else 0
        messages = messages.pick(used)
        steps = np.diff(np.cumsum(steps)[used], prepend=0)
    c, stamps = messages.consumed, messages.stamps
    if not c:
        return []
    interval = memory.decision.pace.interval_ns
    new_run = cursor.fresh_run
    if new_run:
        _begin_run(memory, int(stamps[0]), int(messages.other[0]), interval)
        steps[0] = 1
    known, places = steps[:c], int(steps[:c].sum())
    elapsed = stamps[:c] - (cursor.last_ns - cursor.elapsed_ns)
    left_out_ns = left_out = 0
    if places == c:
        blocks = [EvenBlock(messages.samples[:c], cursor.index + 1, new_run=new_run,
                            start_s=float(elapsed[0]) / SECOND)]
    else:
        tolerated = memory.options.gap_tolerance + 1
        behind = np.diff(elapsed, prepend=cursor.elapsed_ns)
        for at in np.flatnonzero(known > tolerated).tolist():
            lasts = int(behind[at])
            counts.list_gap(int(elapsed[at]) - lasts + interval, max(lasts - interval, 0.0))
        left_out_ns, left_out = unpaced(behind, known, tolerated, memory.decision.pace)
        blocks = _even_blocks(memory.tail, messages.samples, steps,
                              cursor.index + np.cumsum(known), elapsed, interval, tolerated,
                              new_run)
        counts.interpolated += sum(len(block.interpolated) for block in blocks)
    counts.missing += places - c - empty
    # Lateness and jitter are measured from some seconds of messages at common rates.
    lately = slice(max(c - 128, 0), c)
    latest = np.cumsum(known[lately])
    late = (elapsed[lately] - elapsed[-1]) / interval - (latest - latest[-1])
    passed_ns = int(elapsed[-1]) - cursor.elapsed_ns
    _advance(memory, messages, late, passed_ns, places, passed_ns - left_out_ns,
             places - new_run - left_out)
    return blocks


def _advance(memory: Memory, messages: Messages, late: Array, passed_ns: int, places: int,
             paced_ns: int, paced_steps: int) -> None:
    """Update counts and cursor; `late` is how late recent stamps are relative to the last."""
    cursor, counts, c = memory.cursor, memory.counts, messages.consumed
    interval = memory.decision.pace.interval_ns
    counts.samples += c
    counts.paced_ns += paced_ns
    counts.paced_steps += paced_steps
    cursor.elapsed_ns += passed_ns
    cursor.index += places
    cursor.last_ns, cursor.other_ns = int(messages.stamps[c - 1]), int(messages.other[c - 1])
    cursor.late_ns = -float(np.sort(late)[len(late) // 2]) * interval
    mean = float(np.add.reduce(late)) / len(late)
    cursor.jitter = sqrt(max(float(np.dot(late, late)) / len(late) - mean * mean, 0.0))
    memory.tail = (
        messages.samples[c - NEIGHBOURS:c] if c >= NEIGHBOURS else
        np.concatenate([memory.tail, messages.samples[:c]])[-NEIGHBOURS:])
    if all(memory.decision.present[3:]):
        some = messages.samples[:c:_SPARSE, 3:]
        counts.gravity = (np.array(counts.gravity) + some.sum(axis=0)).tolist()
        counts.gravity_samples += len(some)
    if paced_steps > 128 and not memory.decision.counted_only:
        lately_ns = paced_ns / paced_steps
        if abs(lately_ns / interval - 1) < _FOLLOWED:
            # Only part of the change is followed: an oscillator drifts slowly, jitter does not.
            memory.decision.pace = replace(
                memory.decision.pace, interval_ns=interval + 0.2 * (lately_ns - interval))


def _begin_run(memory: Memory, stamp: int, other: int, interval: float) -> None:
    """Continue the time at the first message of a run, by the clock that did not jump."""
    cursor = memory.cursor
    passed = stamp - cursor.last_ns
    if cursor.first_ns is None:
        cursor.first_ns, passed = stamp, 0
    elif cursor.jumped or not 0 < passed < NEVER_NS - cursor.elapsed_ns:
        passed = other - cursor.other_ns
        if not 0 < passed < NEVER_NS - cursor.elapsed_ns:
            passed = round(interval)
    if passed > (memory.options.gap_tolerance + 1.5) * interval:
        memory.counts.list_gap(cursor.elapsed_ns + interval, passed - interval)
    cursor.elapsed_ns += passed
    cursor.last_ns = stamp
    cursor.fresh_run = cursor.jumped = False
    memory.tail = np.empty((0, 6))


def interpolate(samples: Array, at: Ints, segment: Ints) -> Array:
    """Return, for gaps before rows `at`, the mean of up to 8 samples on each side."""
    # Only samples of the same unbroken segment are used.
    around = at[:, None] + np.arange(-NEIGHBOURS, NEIGHBOURS)
    valid = (around >= 0) & (around < len(samples))
    around = np.clip(around, 0, len(samples) - 1)
    valid &= segment[around] == segment[at][:, None]
    weight = valid / valid.sum(axis=1, keepdims=True)
    # Averaged relative to the sample after the gap, so that equal values give exactly that value.
    behind = samples[at]
    means: Array = behind + np.einsum('gk,gki->gi', weight, samples[around] - behind[:, None])
    return means


def _even_blocks(tail: Array, samples: Array, steps: Ints, index: Ints, elapsed_ns: Ints,
                 interval_ns: float, tolerated: int, new_run: bool) -> list[EvenBlock]:
    """Return the samples with an `index` as blocks; the others are only neighbours."""
    # `tail` holds the samples before. Steps of up to `tolerated` are interpolated, longer ones end
    # a block.
    c = len(index)
    known = np.concatenate([tail, samples[:c + NEIGHBOURS]])
    gaps = np.flatnonzero((steps[:c] > 1) & (steps[:c] <= tolerated))
    segment = np.zeros(len(known), dtype=np.int64)
    segment[len(tail):] = np.cumsum(steps[:c + NEIGHBOURS] > tolerated)
    lengths = steps[gaps] - 1
    means = np.repeat(interpolate(known, gaps + len(tail), segment), lengths, axis=0)
    ends = np.cumsum(lengths)
    holes = np.repeat(index[gaps] - ends, lengths) + np.arange(int(ends[-1]) if len(ends) else 0)
    breaks = np.flatnonzero(steps[:c] > tolerated).tolist()
    blocks = []
    for first, last in pairwise([0, *(at for at in breaks if at > 0), c]):
        begins, end = int(index[first]), int(index[last - 1]) + 1
        if steps[first] <= tolerated:
            begins -= int(steps[first]) - 1
        rows = np.empty((end - begins, 6))
        rows[index[first:last] - begins] = samples[first:last]
        low, high = np.searchsorted(holes, begins), np.searchsorted(holes, end)
        rows[holes[low:high] - begins] = means[low:high]
        start_ns = float(elapsed_ns[first]) - (int(index[first]) - begins) * interval_ns
        blocks.append(EvenBlock(rows, begins, holes[low:high] - begins, new_run and first == 0,
                                start_s=start_ns / SECOND))
    return blocks
