# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Choice of the clock: header stamps, receive stamps, or a count at the stated rate.

It is chosen from the first messages, with the pace of its stamps. If header stamps become unusable
later, receive stamps replace them.
"""

from dataclasses import replace
from math import exp

from imu_allan.arrays import Bools
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.memory import (
    Decision,
    FASTEST_NS,
    LONGEST_QUEUE_NS,
    Memory,
    RATE_TOLERANCE,
    TimelineOptions,
    Window,
)
from imu_allan.timeline.pace import (
    COUNTING_SPREAD,
    longest_at_one_rate,
    measure_pace,
    Pace,
    pace_of_each,
    PHASE_GROUP,
    spread_about,
)
from imu_allan.timeline.stamps import flaw_of, order_stamps, place_in_burst, SECOND, Stamps
from imu_allan.timeline.values import repeated, Repeats
import numpy as np


def choose_clock(window: Window, decision: Decision, options: TimelineOptions) -> None:
    """Choose the clock by the first messages, or raise ImuAllanError if none is usable."""
    one = decision.one_clock = np.array_equal(window.header_ns, window.receive_ns)
    decision.first_speed = _speed_of(window.header_ns, window.receive_ns)
    if options.force_rate and options.rate_hz is not None:
        decision.clock = 'header'
        decision.count_samples(options.rate_hz)
        return
    repeats = repeated(window.samples)
    flaws = {'header': flaw_of(window.header_ns, repeats, bursts=False),
             'receive': flaw_of(window.receive_ns, repeats, bursts=True)}
    choice = 'header' if options.clock == 'auto' else options.clock
    if flaws['header'] and options.clock == 'auto' and not (
            one and flaws['header'] == 'out of order'):
        if not (one or flaws['receive']):
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
        decision.count_samples(options.rate_hz)
    elif choice == 'header':
        # Different messages share a stamp more often than by an occasional driver fault. A clock
        # that stands still for a while shows only one such stamp.
        tied = (window.header_ns[1:] == window.header_ns[:-1]) & ~repeats
        shared = np.count_nonzero(tied & np.diff(tied, prepend=False))
        decision.ticks = int(shared) > max(2, 1e-3 * len(tied))
    decision.clock = choice


def measure_first_pace(memory: Memory, window: Window, repeats: Repeats, twice: Bools) -> None:
    """Measure the pace by the first messages, or raise ImuAllanError if it cannot be right."""
    decision, options = memory.decision, memory.options
    pace = None if decision.counted_only else _pace_by_either(memory, window, repeats, twice)
    if pace is None:
        if options.rate_hz is not None:
            decision.set_pace(Pace(SECOND / options.rate_hz))
        return
    decision.take_pace(pace)
    # Fewer stamps do not give the rate well enough to contradict the stated one.
    if options.rate_hz is None or pace.messages < PHASE_GROUP:
        return
    measured, one = SECOND / pace.interval_ns, decision.one_clock
    if abs(measured / options.rate_hz - 1) > RATE_TOLERANCE + 1 / pace.messages:
        raise ImuAllanError(
            f'the stated rate is {options.rate_hz:g} Hz, but the '
            f'{"times" if one else f"{decision.clock} stamps"} advance at {measured:.6g} Hz. '
            f'Leave out the rate{"" if one else ", choose the other clock (analyze --clock)"}, '
            'or count samples at the stated rate (analyze --clock none)')


def _speed_of(stamps: Stamps, received: Stamps) -> float:
    """Return how fast stamps run, compared with those received; 1 unless all quarters agree."""
    # Messages from a queue are received within one or two quarters of the time, or all at once:
    # within 0.3 s, chosen by judgment. Batches fit into no such quarters.
    time = np.maximum.accumulate(received - received[0])
    edges = np.array([0, 0.2, 0.45, 0.72, 1]) * time[-1]
    passed = np.diff(np.interp(edges, time, stamps - stamps[0]))
    if time[-1] < 0.3 * SECOND or passed.min() <= 0:
        return 1.0
    speeds = np.log(passed / np.diff(edges))
    return exp(speeds.mean()) if np.ptp(speeds) <= np.abs(speeds).min() else 1.0


def step_of_header(memory: Memory, window: Window) -> int:
    """Return by how much header stamps step ahead of receive stamps, apart from their speed."""
    # A step of either clock, and what waited in a queue longer than usual, is no speed.
    counts = memory.counts
    rows = np.linspace(0, window.consumed - 1, 9).astype(int)
    own, received = (
        np.diff(stamps[rows], prepend=stamps[0] if last_ns is None else last_ns)
        for stamps, last_ns in ((window.header_ns, counts.header.last_ns),
                                (window.receive_ns, counts.receive.last_ns)))
    both = np.maximum(np.minimum(own, received), 0)
    if abs(own.sum() - received.sum()) <= LONGEST_QUEUE_NS or not both.any():
        return 0
    # The median by the time that passed on both clocks: it passes beside a step, or a queue.
    speeds = own / np.maximum(received, 1)
    order = np.argsort(speeds)
    passed = np.cumsum(both[order])
    usual = float(speeds[order][np.searchsorted(passed, passed[-1] / 2)])
    step = min((round(own.sum() - speed * received.sum())
                for speed in (usual, memory.decision.first_speed)), key=abs)
    return step if abs(step) > max(LONGEST_QUEUE_NS, memory.decision.least_step_ns) else 0


def _pace_by_either(memory: Memory, window: Window, repeats: Repeats, twice: Bools) -> Pace | None:
    """Measure the pace, and take receive stamps for the clock if only they are even."""
    decision = memory.decision
    # For a polled sensor, only messages with new values show the pace.
    rows = ~(repeats.held | repeats.frozen | twice)
    own, other = (stamps[rows] for stamps in stamps_of(memory, window))
    bursts = decision.separates_equal_stamps
    pace, known = _pace_of(own, other, bursts), memory.options.polled
    if pace is not None and (repeats.evenly or known):
        polls = ~(repeats.frozen | twice)
        polled, beside = (stamps[polls] for stamps in stamps_of(memory, window))
        polling = _pace_of(polled, beside, bursts)
        if polling is not None and (
                # A slower sensor is not on the grid of the messages that repeat it.
                abs(pace.interval_ns / polling.interval_ns - 1) < RATE_TOLERANCE if known
                else _is_full(polled, polling.interval_ns)):
            # Removed repeats leave gaps on both clocks, but no sample is lost.
            return _pace_of(own, other, bursts, each=True)
    if (pace is None or decision.clock != 'header' or memory.options.clock != 'auto'
            or len(own) < PHASE_GROUP
            or flaw_of(window.receive_ns, repeated(window.samples), bursts=True)):
        return pace
    if pace.interval_ns <= FASTEST_NS:
        decision.use_receive('too fast')
        return _pace_of(other, own, bursts=True)
    # Ticks hide less than 30 % of the samples; beyond, the other clock shows no losses either.
    if pace.hidden > 0.3 or (
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
    # A timer reads both clocks. If the header stamps lie far closer to its grid, they show better
    # that its empty places are no losses.
    if pace.counting and 1 - ratio > pace.hidden and (
            3 * spread_about(own, second.interval_ns) < second.spread):
        return pace
    # With one of three dropped, stamps lie 0.17 off a grid of 1.5 intervals. The limits of 0.1
    # and of three times the clock's spread about its own grid are chosen by judgment, as is
    # that of 1 % between the intervals of one grid by two clocks.
    if not pace.counting and pace.spread < 0.2 and not (
            abs(ratio - 1) > 0.01 and spread_about(other, pace.interval_ns) > np.clip(
                3 * second.spread, 0.1, COUNTING_SPREAD)):
        # Ticks are an exact grid as well, but the stamps of the other clock do not lie on it.
        return pace
    # No flaw: header stamps are usable, but less suitable.
    decision.use_receive(None)
    return second


def replace_header_clock(memory: Memory, window: Window) -> None:
    """Switch to receive stamps, in a new run, if header stamps have become unusable."""
    decision, cursor, repeats = memory.decision, memory.cursor, repeated(window.samples)
    flaw = flaw_of(window.header_ns, repeats, bursts=False)
    if not flaw or decision.one_clock or flaw_of(window.receive_ns, repeats, bursts=True):
        return
    decision.clock = 'receive'
    decision.remarks['clock_changed'] = {'flaw': flaw, 'since_s': cursor.elapsed_ns / SECOND}
    cursor.last_ns, cursor.other_ns = cursor.other_ns, cursor.last_ns
    cursor.fresh_run = True


def stamps_of(memory: Memory, window: Window) -> tuple[Stamps, Stamps]:
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
