# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The first stage of a timeline: the choice of the clock and of the usable messages.

The axes present, the pace and the clock are decided from the first messages: header stamps,
receive stamps, or a count at the stated rate. After that, messages with unusable values and
duplicates are left out. If header stamps become unusable later, receive stamps replace them.
"""

from dataclasses import replace

from imu_allan.arrays import Array, Bools
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.memory import (
    Decision,
    FASTEST_NS,
    Memory,
    Messages,
    RATE_TOLERANCE,
    TimelineOptions,
    Window,
)
from imu_allan.timeline.pace import (
    longest_at_one_rate,
    measure_pace,
    Pace,
    pace_of_each,
    PHASE_GROUP,
    spread_about,
)
from imu_allan.timeline.stamps import flaw_of, order_stamps, place_in_burst, SECOND, Stamps
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
    repeats = memory.content.look(values, c, all_usable)
    if decision.clock is None:
        _decide(memory, window, repeats)
        # A driver may send its two sensors in turn.
        declared = np.where(np.repeat(window.absent, 3, axis=1), np.nan, window.samples)
        if alternates(declared[~(repeats.held | repeats.frozen)]):
            decision.remarks['several_publishers'] = {}
    counts = memory.counts
    faulty = counts.header.add(window.header_ns[:c])
    counts.receive.add(window.receive_ns[:c])
    if faulty and decision.clock == 'header' and memory.options.clock == 'auto':
        _replace_header_clock(memory, window)
    stamps, other = _stamps_of(memory, window)
    samples, unusable = _values(memory, window, all_usable)
    void = repeats.spikes | unusable
    twice = (_twice(memory, window, stamps) | repeats.held) & ~(void | repeats.frozen)
    if memory.content.frozen_s is None and repeats.frozen[:c].any():
        begins = int(stamps[np.argmax(repeats.frozen)])
        first = (counts.header if decision.clock == 'header' else counts.receive).first_ns
        memory.content.frozen_s = max(float(begins - first), 0.0) / SECOND
    counts.messages += c
    # Unusable values are not counted as spikes.
    counts.spikes += int(np.count_nonzero((repeats.spikes & ~unusable)[:c]))
    counts.rejected += int(np.count_nonzero((void | repeats.frozen)[:c]))
    counts.duplicates += int(np.count_nonzero(twice[:c]))
    counts.header.last_ns = int(window.header_ns[c - 1])
    counts.receive.last_ns = int(window.receive_ns[c - 1])
    messages, left_out = Messages(stamps, other, samples, c, void), repeats.frozen | twice
    return messages.pick(~left_out) if left_out.any() else messages


def _decide(memory: Memory, window: Window, repeats: Repeats) -> None:
    """Choose clock, axes and pace from the first messages."""
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
    _choose_clock(window, memory.decision, memory.options)
    memory.counts.header.first_ns = int(window.header_ns[0])
    memory.counts.receive.first_ns = int(window.receive_ns[0])
    twice = _twice(memory, window, _stamps_of(memory, window)[0])
    _measure_first_pace(memory, window, repeats, twice)


def _twice(memory: Memory, window: Window, stamps: Stamps) -> Bools:
    """Find duplicate messages, on a clock where different messages may share a stamp."""
    same = np.zeros(len(stamps), dtype=bool)
    if not memory.decision.separates_equal_stamps:
        return same
    tied = stamps[1:] == stamps[:-1]
    if tied.any():
        same[1:] = (tied & (window.header_ns[1:] == window.header_ns[:-1])
                    & repeated(window.samples))
    header, receive = memory.counts.header, memory.counts.receive
    last_ns = (header if memory.decision.clock == 'header' else receive).last_ns
    if len(memory.tail) and (stamps[0], window.header_ns[0]) == (last_ns, header.last_ns):
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


def _stamps_of(memory: Memory, window: Window) -> tuple[Stamps, Stamps]:
    """Return the stamps of the chosen clock, and those of the other one."""
    if memory.decision.counted_only:
        interval = SECOND / (memory.options.rate_hz or 1.0)
        # Messages with another frame_id are not samples of this sensor.
        first = memory.counts.messages - sum(memory.counts.other_frames.values())
        place = np.arange(first, first + len(window))
        return np.rint(place * interval).astype(np.int64), window.receive_ns
    if memory.decision.clock == 'header':
        return window.header_ns, window.receive_ns
    return window.receive_ns, window.header_ns


def _choose_clock(window: Window, decision: Decision, options: TimelineOptions) -> None:
    """Choose the clock by the first messages, or raise ImuAllanError if none is usable."""
    repeats = repeated(window.samples)
    flaws = {'header': flaw_of(window.header_ns, repeats, bursts=False),
             'receive': flaw_of(window.receive_ns, repeats, bursts=True)}
    choice = 'header' if options.clock == 'auto' else options.clock
    one = decision.one_clock = np.array_equal(window.header_ns, window.receive_ns)
    if flaws['header'] and options.clock == 'auto' and not (
            one and flaws['header'] == 'out of order'):
        if not flaws['receive']:
            decision.use_receive(flaws['header'])
            return
        if not flaw_of(window.header_ns, repeats, bursts=True):
            # A coarse clock with several messages per tick is poor, but better than none.
            flaws['header'] = None
    if flaws[choice]:
        if options.rate_hz is None:
            if one:
                raise ImuAllanError(f'the times of the samples are {flaws[choice]}: '
                                    'mend them, or state the sample rate (analyze --rate)')
            what = (f'{choice} stamps are {flaws[choice]}: choose the other clock '
                    '(analyze --clock) or' if options.clock != 'auto' else
                    f'header stamps are {flaws["header"]} and receive stamps '
                    f'{flaws["receive"]}:')
            raise ImuAllanError(f'{what} state the sample rate (analyze --rate)')
        decision.counted_only = True
        decision.remarks['counted_samples'] = {'rate_hz': options.rate_hz}
    elif choice == 'header':
        # Different messages share a stamp more often than by an occasional driver fault.
        tied = (window.header_ns[1:] == window.header_ns[:-1]) & ~repeats
        decision.ticks = int(np.count_nonzero(tied)) > max(2, 1e-3 * len(tied))
    decision.clock = choice


def _measure_first_pace(memory: Memory, window: Window, repeats: Repeats, twice: Bools) -> None:
    """Measure the pace by the first messages, or raise ImuAllanError if it cannot be right."""
    decision, options = memory.decision, memory.options
    pace = None if decision.counted_only else _pace_by_either(memory, window, repeats, twice)
    if pace is None:
        if options.rate_hz is not None:
            decision.set_pace(Pace(SECOND / options.rate_hz))
        return
    decision.take_pace(pace)
    # Fewer stamps do not give the rate well enough to contradict the stated one.
    if options.rate_hz is None or options.force_rate or pace.messages < PHASE_GROUP:
        return
    measured, one = SECOND / pace.interval_ns, decision.one_clock
    if abs(measured / options.rate_hz - 1) > RATE_TOLERANCE + 1 / pace.messages:
        raise ImuAllanError(
            f'the stated rate is {options.rate_hz:g} Hz, but the '
            f'{"times" if one else f"{decision.clock} stamps"} advance at {measured:.6g} Hz. '
            f'Leave out the rate{"" if one else ", choose the other clock (analyze --clock)"}, '
            'or force the stated rate (analyze --clock none)')


def _pace_by_either(memory: Memory, window: Window, repeats: Repeats, twice: Bools) -> Pace | None:
    """Measure the pace, and take receive stamps for the clock if only they are even."""
    decision = memory.decision
    # For a polled sensor, only messages with new values show the pace.
    rows = ~(repeats.held | repeats.frozen | twice)
    own, other = (stamps[rows] for stamps in _stamps_of(memory, window))
    bursts = decision.separates_equal_stamps
    if repeats.evenly:
        polls = ~(repeats.frozen | twice)
        polled, beside = (stamps[polls] for stamps in _stamps_of(memory, window))
        pace = _pace_of(polled, beside, bursts)
        if pace is not None and _is_full(polled, pace.interval_ns):
            # Removed repeats leave gaps on both clocks, but no sample is lost.
            return _pace_of(own, other, bursts, each=True)
    pace = _pace_of(own, other, bursts)
    if (pace is None or decision.clock != 'header' or memory.options.clock != 'auto'
            or len(own) < PHASE_GROUP
            or flaw_of(window.receive_ns, repeated(window.samples), bursts=True)):
        return pace
    if pace.interval_ns <= FASTEST_NS:
        decision.use_receive('too fast')
        return _pace_of(other, own, bursts=True)
    speed = float(other[-1] - other[0]) / max(float(own[-1] - own[0]), 1.0)
    # A timer that reads a slower sensor reads both clocks. Ticks hide less than 30 % of the
    # samples; beyond, the other clock shows no losses either.
    if pace.hidden > 0.3 or pace.beat or (
            not pace.counting and pace.spread < 0.05 and _is_full(own, pace.interval_ns)):
        return pace
    second = _pace_of(other, own, bursts=True)
    if second is not None and pace.counting and second.counting:
        # Either clock may hide losses, so the larger bound holds.
        return replace(pace, hidden=max(pace.hidden, second.hidden))
    # With a wider spread, a clock is too close to the limit to show single losses.
    if second is None or second.counting or second.spread > 0.2:
        return pace
    ratio = second.interval_ns / pace.interval_ns
    # If the clocks run equally fast, they stamp the same samples, and the even one shows which of
    # them are missing. Clocks that disagree by more than 12 % do not stamp the same samples.
    if abs(ratio - 1) > 0.12 < abs(speed - 1):
        return pace
    # With one of three dropped, stamps lie 0.17 off a grid of 1.5 intervals. The limits of 0.1
    # and of three times the clock's spread about its own grid are chosen by judgment, as is
    # that of 1 % between the intervals of one grid by two clocks.
    if not pace.counting and not (
            abs(ratio - 1) > 0.01
            and spread_about(other, pace.interval_ns) > max(0.1, 3 * second.spread)):
        # Ticks are an exact grid as well, but the stamps of the other clock do not lie on it.
        return pace
    # No flaw: header stamps are usable, but less suitable.
    decision.use_receive(None)
    return second


def _replace_header_clock(memory: Memory, window: Window) -> None:
    """Switch to receive stamps, in a new run, if header stamps have become unusable."""
    decision, cursor, repeats = memory.decision, memory.cursor, repeated(window.samples)
    flaw = flaw_of(window.header_ns, repeats, bursts=False)
    if not flaw or flaw_of(window.receive_ns, repeats, bursts=True):
        return
    decision.clock = 'receive'
    decision.remarks['clock_changed'] = {'flaw': flaw, 'since_s': cursor.elapsed_ns / SECOND}
    cursor.last_ns, cursor.other_ns = cursor.other_ns, cursor.last_ns
    cursor.fresh_run = True


def _pace_of(stamps: Stamps, other: Stamps, bursts: bool, each: bool = False) -> Pace | None:
    """Measure the pace on the longest run at one rate; with `each`, no sample is lost."""
    if bursts:
        stamps = stamps + place_in_burst(stamps, None, 0)
    order = order_stamps(stamps, None)
    if order is not None:
        stamps, other = stamps[order.keep], other[order.keep]
        edges = [0, *np.flatnonzero(order.jumps[order.keep]).tolist(), len(stamps)]
        longest = int(np.argmax(np.diff(edges)))
        run = slice(edges[longest], edges[longest + 1])
        stamps, other = stamps[run], other[run]
    part = longest_at_one_rate(stamps)
    pace = pace_of_each(stamps[part]) if each else measure_pace(stamps[part], other[part])
    return pace and replace(pace, messages=len(stamps[part]))


def _is_full(stamps: Stamps, interval_ns: float) -> bool:
    """Return whether hardly any place between the first and the last stamp is empty."""
    places = float(stamps[-1] - stamps[0]) / interval_ns + 1
    return abs(len(stamps) - places) < 0.01 * places
