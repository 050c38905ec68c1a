# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The first stage of a timeline: what is decided from the first messages, and usable messages.

The axes present, the clock and the pace are decided first. After that, messages with unusable
values and duplicates are left out.
"""

from dataclasses import replace

from imu_allan.arrays import Array, Bools
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.choose_clock import (
    choose_clock,
    measure_first_pace,
    replace_header_clock,
    stamps_of,
    step_of_header,
)
from imu_allan.timeline.memory import Memory, Messages, Window
from imu_allan.timeline.stamps import SECOND, Stamps
from imu_allan.timeline.values import alternates, LARGEST, repeated, Repeats
import numpy as np


class NoAxes(ImuAllanError):
    """Raised if none of the first messages has a value; later ones may."""


def usable(memory: Memory, window: Window) -> Messages:
    """Drop duplicate and frozen messages, and mark those with unusable values."""
    # Differences of stamps beyond these would overflow.
    ends_ns = -2**61, 2**61
    window = replace(window, header_ns=np.clip(window.header_ns, *ends_ns),
                     receive_ns=np.clip(window.receive_ns, *ends_ns))
    decision = memory.decision
    # The usual case, in which several searches are not needed.
    all_usable = bool(not window.absent.any() and window.samples.max() < LARGEST
                      and window.samples.min() > -LARGEST)
    c, values = window.consumed, window.samples
    if not all_usable:
        values = np.where(np.all(window.absent, axis=1, keepdims=True), np.nan, values)
    repeats = memory.content.look(values, c, all_usable, memory.options.polled)
    if decision.clock is None:
        _decide(memory, window, repeats)
        # A driver may send one of its sensors in every second message.
        declared = np.where(np.repeat(window.absent, 3, axis=1), np.nan, window.samples)
        if alternates(declared[~(repeats.held | repeats.frozen)]):
            decision.remarks['several_publishers'] = {}
    counts = memory.counts
    faulty = counts.header.add(window.header_ns[:c])
    counts.receive.add(window.receive_ns[:c])
    if (faulty and decision.clock == 'header' and memory.options.clock == 'auto'
            and not decision.counted_only):
        replace_header_clock(memory, window)
    stamps, other = stamps_of(memory, window)
    samples, unusable = _values(memory, window, all_usable)
    void = repeats.spikes | unusable
    twice = (_twice(memory, window, stamps) | repeats.held) & ~(void | repeats.frozen)
    if memory.content.frozen_s is None and repeats.frozen[:c].any():
        begins_ns = memory.cursor.elapsed_at(stamps, int(np.argmax(repeats.frozen)))
        memory.content.frozen_s = max(begins_ns, 0) / SECOND
    counts.messages += c
    # Unusable values are not counted as spikes.
    counts.spikes += int(np.count_nonzero((repeats.spikes & ~unusable)[:c]))
    counts.rejected += int(np.count_nonzero((void | repeats.frozen)[:c]))
    counts.duplicates += int(np.count_nonzero(twice[:c]))
    counts.header.first_ns += step_of_header(memory, window)
    counts.header.last_ns = int(window.header_ns[c - 1])
    counts.receive.last_ns = int(window.receive_ns[c - 1])
    messages, left_out = Messages(stamps, other, samples, c, void), repeats.frozen | twice
    return messages.pick(~left_out) if left_out.any() else messages


def _decide(memory: Memory, window: Window, repeats: Repeats) -> None:
    """Choose clock, axes and pace from the first messages."""
    provided = window.provided
    if provided.any(axis=0).all() and not provided.all(axis=1).any():
        raise ImuAllanError('each message has one sensor only, gyroscope or accelerometer: name '
                            'the topic twice, as gyro_topic and as accel_topic')
    samples = window.samples
    finite = np.mean(np.isfinite(samples), axis=0)
    declared = np.repeat(np.mean(window.absent, axis=0) <= 0.5, 3)
    present = declared & (finite > 0.5)
    if not present.any():
        memory.counts.messages += window.consumed
        memory.counts.rejected += window.consumed
        raise NoAxes(
            'the messages carry neither angular velocity nor linear acceleration '
            '(covariance[0] is -1 or every value is NaN): choose another topic')
    memory.decision.present = present.tolist()
    memory.decision.not_finite = (declared & ~present).tolist()
    choose_clock(window, memory.decision, memory.options)
    memory.counts.header.first_ns = int(window.header_ns[0])
    memory.counts.receive.first_ns = int(window.receive_ns[0])
    twice = _twice(memory, window, stamps_of(memory, window)[0])
    measure_first_pace(memory, window, repeats, twice)


def _twice(memory: Memory, window: Window, stamps: Stamps) -> Bools:
    """Find duplicate messages, on a clock where different messages may share a stamp."""
    same = np.zeros(len(stamps), dtype=bool)
    if not memory.decision.separates_equal_stamps:
        return same
    tied = stamps[1:] == stamps[:-1]
    if tied.any():
        same[1:] = (tied & (window.header_ns[1:] == window.header_ns[:-1])
                    & repeated(window.samples))
    last_ns, counts = memory.counts.of(memory.decision.clock).last_ns, memory.counts
    if len(memory.tail) and (stamps[0], window.header_ns[0]) == (last_ns, counts.header.last_ns):
        # The message before is the last of another window.
        newest = memory.tail[-1]
        there = ~np.isnan(newest)
        same[0] = np.array_equal(window.samples[0, there], newest[there])
    return same


def _values(memory: Memory, window: Window, all_usable: bool) -> tuple[Array, Bools]:
    """Return samples, NaN on axes not used, and the messages that lack a value of the others."""
    used = np.array(memory.decision.present)
    if all_usable and used.all():
        return window.samples, np.zeros(len(window), dtype=bool)
    with np.errstate(invalid='ignore'):
        there = (np.abs(window.samples) < LARGEST) & ~np.repeat(window.absent, 3, axis=1)
    memory.counts.other_axes += int(np.count_nonzero(
        (there != used)[:window.consumed].any(axis=1)))
    return np.where(used, window.samples, np.nan), np.any(used & ~there, axis=1)
