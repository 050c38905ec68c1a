# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The first stage of a timeline: the choice of the clock and of the usable messages.

The clock, the axes present and the pace are decided from the first messages. After that, messages
with unusable values and duplicates are left out. This is one class because everything rests on
that first decision.
"""

from dataclasses import replace

from imu_allan.arrays import Array, Bools
from imu_allan.errors import ImuAllanError
from imu_allan.state import Record
from imu_allan.timeline.alive import Repeats
from imu_allan.timeline.clock import (
    flaw_of,
    in_order,
    order_stamps,
    overlaps,
    place_in_burst,
    SECOND,
    Stamps,
)
from imu_allan.timeline.foreign_samples import alternates, are_interleaved, LARGEST
from imu_allan.timeline.memory import FASTEST_NS, Memory
from imu_allan.timeline.messages import Messages, Window
from imu_allan.timeline.options import RATE_TOLERANCE
from imu_allan.timeline.pace import (
    follow_a_beat,
    longest_at_one_rate,
    measure_pace,
    Pace,
    pace_of_each,
    spread_about,
)
import numpy as np

_FEWEST_FOR_RATE = 64
"""Fewest stamps that give the rate well enough to contradict the stated one."""


class NoAxes(ImuAllanError):
    """Raised if none of the first messages has a value; later ones may."""


class Intake(Record):
    """Chooses the clock and passes on the usable messages."""

    def __init__(self, memory: Memory) -> None:
        self._memory, self._options, self._counts = memory, memory.options, memory.counts
        self.decision, self.content = memory.decision, memory.content
        self.presence = memory.presence

    def stamps(self, window: Window) -> tuple[Stamps, Stamps]:
        """Return the stamps of the chosen clock, and those of the other one."""
        decision = self.decision
        if decision.counted_only:
            interval = SECOND / (self._options.rate_hz or 1.0)
            # Messages with another frame_id are not samples of this sensor.
            first = self._counts.messages - sum(self._counts.other_frames.values())
            place = np.arange(first, first + len(window.header_ns))
            return np.rint(place * interval).astype(np.int64), window.receive_ns
        if decision.clock == 'header':
            return window.header_ns, window.receive_ns
        return window.receive_ns, window.header_ns

    def usable(self, window: Window) -> Messages:
        """Drop duplicate and frozen messages, and mark those with unusable values."""
        window = replace(window, header_ns=_clipped(window.header_ns),
                         receive_ns=_clipped(window.receive_ns))
        decision, c = self.decision, window.consumed
        # The usual case, in which several searches are not needed.
        all_usable = bool(not window.absent.any() and window.samples.max() < LARGEST
                          and window.samples.min() > -LARGEST)
        repeats = self.content.look(window.samples, c, all_usable)
        if decision.clock is None:
            self._decide(window, repeats)
            self._seek_second_publisher(window, repeats)
        counts = self._counts
        faulty = counts.header.add(window.header_ns[:c])
        counts.receive.add(window.receive_ns[:c])
        if faulty and decision.clock == 'header' and self._options.clock == 'auto':
            self._replace_header_clock(window)
        stamps, other = self.stamps(window)
        away, unusable = self._unusable(window, all_usable)
        twice = self._twice(window, stamps) | repeats.held
        counts.messages += c
        counts.header.last_ns = int(window.header_ns[c - 1])
        counts.receive.last_ns = int(window.receive_ns[c - 1])
        void = repeats.spikes | unusable
        left_out = repeats.frozen | twice
        if void.any() or left_out.any():
            if self.content.frozen_s is None and repeats.frozen[:c].any():
                first = (counts.header if decision.clock == 'header' else counts.receive).first_ns
                begins = int(stamps[np.argmax(repeats.frozen)])
                self.content.frozen_s = max(float(begins - first), 0.0) / SECOND
            # Unusable values are not counted as spikes.
            counts.spikes += int(np.count_nonzero((repeats.spikes & ~unusable)[:c]))
            twice &= ~(void | repeats.frozen)
            left_out = repeats.frozen | twice
            counts.rejected += int(np.count_nonzero((void | repeats.frozen)[:c]))
            counts.duplicates += int(np.count_nonzero(twice[:c]))
        samples = np.where(away, np.nan, window.samples) if away.any() else window.samples
        if repeats.started:
            counts.forget()
            self._memory.motion = None
            decision.restart = self._memory.cursor.fresh_run = True
        messages = Messages(stamps, other, samples, c, void)
        return (messages.pick(~left_out, c - int(np.count_nonzero(left_out[:c])))
                if left_out.any() else messages)

    def _decide(self, window: Window, repeats: Repeats) -> None:
        """Choose clock, axes and pace from the first messages."""
        decision, options = self.decision, self._options
        samples = window.samples
        finite = np.mean(np.isfinite(samples), axis=0)
        declared = np.repeat(np.mean(window.absent, axis=0) <= 0.5, 3)
        present = declared & (finite > 0.5)
        for axis, there in zip(self.presence.axes, present.tolist(), strict=True):
            axis.there = there
        if not present.any() and self.presence.copy().look(
                ~np.isfinite(samples) | np.repeat(window.absent, 3, axis=1),
                window.consumed)[:window.consumed].all():
            self._counts.messages += window.consumed
            self._counts.rejected += window.consumed
            raise NoAxes(
                'the messages carry neither angular velocity nor linear acceleration '
                '(covariance[0] is -1 or every value is NaN): choose another topic')
        for axis, there, provided in zip(
                self.presence.axes, present.tolist(), declared.tolist(), strict=True):
            axis.ever, axis.not_finite = there, provided and not there
        self._choose_clock(window)
        self._counts.header.first_ns = int(window.header_ns[0])
        self._counts.receive.first_ns = int(window.receive_ns[0])
        pace, rising = (None, 0) if decision.counted_only else self._measure(window, repeats)
        if pace is None:
            if options.rate_hz is not None:
                decision.set_pace(Pace(SECOND / options.rate_hz))
            return
        # A table or a log has one time per sample, so there is no clock to choose.
        one = np.array_equal(window.header_ns, window.receive_ns)
        decision.take_pace(pace, one)
        if (options.rate_hz is not None and rising >= _FEWEST_FOR_RATE
                and not options.force_rate):
            measured = SECOND / pace.interval_ns
            if abs(measured / options.rate_hz - 1) > RATE_TOLERANCE + 1 / rising:
                clock, decision.clock = decision.clock, None
                raise ImuAllanError(
                    f'the stated rate is {options.rate_hz:g} Hz, but the '
                    f'{"times" if one else f"{clock} stamps"} advance at {measured:.6g} Hz. Leave '
                    f'out the rate{"" if one else ", choose the other clock (analyze --clock)"}, '
                    'or force the stated rate (analyze --clock none)')

    def _seek_second_publisher(self, window: Window, repeats: Repeats) -> None:
        """Look for a second publisher."""
        decision = self.decision
        rows = ~(repeats.held | repeats.frozen)
        samples = window.samples[rows]
        clocks = [stamps[rows] for stamps in self.stamps(window)]
        seen: list[str] = [alternates(samples)]
        if 'noise' not in seen:
            seen += [are_interleaved(stamps, samples, decision.pace.interval_ns)
                     for stamps in clocks]
        if any(seen):
            # With a clock that is read in batches, a vibration looks like two publishers.
            two = 'noise' in seen or ('apart' in seen and 'half' not in seen)
            decision.remarks['several_publishers' if two else 'alternating'] = {}

    def _choose_clock(self, window: Window) -> None:
        decision, options = self.decision, self._options
        repeats = _repeats(window.samples)
        flaws = {'header': flaw_of(window.header_ns, repeats, bursts=False),
                 'receive': flaw_of(window.receive_ns, repeats, bursts=True)}
        choice = 'header' if options.clock == 'auto' else options.clock
        if flaws[choice] and options.clock == 'auto':
            if not flaws['receive']:
                decision.remarks['receive_clock'] = {'flaw': flaws['header']}
                choice = 'receive'
            elif not flaw_of(window.header_ns, repeats, bursts=True):
                # A coarse clock with several messages per tick is poor, but better than none.
                flaws['header'] = None
        if flaws[choice]:
            if options.rate_hz is None:
                if np.array_equal(window.header_ns, window.receive_ns):
                    # A table or a log has one time per sample, so there is no clock to choose.
                    raise ImuAllanError(f'the times of the samples are {flaws[choice]}: '
                                        'mend them, or state the sample rate (analyze --rate)')
                what = (f'{choice} stamps are {flaws[choice]}: choose the other clock '
                        '(analyze --clock) or' if options.clock != 'auto' else
                        f'header stamps are {flaws["header"]} and receive stamps '
                        f'{flaws["receive"]}:')
                raise ImuAllanError(f'{what} state the sample rate (analyze --rate)')
            decision.counted_only = True
            decision.remarks['counted_samples'] = {'rate_hz': options.rate_hz}
        decision.clock = choice
        if choice == 'header' and not decision.counted_only:
            # Different messages share a stamp more often than by an occasional driver fault.
            tied = (window.header_ns[1:] == window.header_ns[:-1]) & ~repeats
            decision.ticks = int(np.count_nonzero(tied)) > max(2, 1e-3 * len(tied))
            decision.overlaps = overlaps(window.header_ns)

    def _measure(self, window: Window, repeats: Repeats) -> tuple[Pace | None, int]:
        """Measure the pace, by the other clock if only that is even; count the stamps used."""
        decision = self.decision
        # For a polled sensor, only messages with new values show the pace.
        twice = self._twice(window, self.stamps(window)[0])
        rows = ~(repeats.held | repeats.frozen | twice)
        own, other = (stamps[rows] for stamps in self.stamps(window))
        bursts = decision.separates_equal_stamps
        if decision.overlaps:
            own = in_order(own, None, float(np.median(np.diff(own))))
        if repeats.evenly:
            polls = ~(repeats.frozen | twice)
            polled, beside = (stamps[polls] for stamps in self.stamps(window))
            if _none_lost(polled, beside, bursts):
                # Removed repeats leave gaps on both clocks, but no sample is lost.
                return _pace_of(own, None, bursts, each=True)
        pace, count = _pace_of(own, other, bursts)
        if (pace is None or decision.clock != 'header' or self._options.clock != 'auto'
                or len(own) < _FEWEST_FOR_RATE
                or flaw_of(window.receive_ns, _repeats(window.samples), bursts=True)):
            return pace, count
        if _leaps(own, other, pace):
            decision.clock, decision.ticks, decision.overlaps = 'receive', False, False
            decision.remarks['receive_clock'] = {'flaw': 'in leaps'}
            return _pace_of(other, own, bursts=True)
        # A timer that reads a slower sensor reads both clocks. Ticks hide less than 30 % of the
        # samples; beyond, the other clock shows no losses either.
        if (_is_nearly_full(pace, own) or pace.hidden > 0.3
                or (pace.counting and follow_a_beat(own))):
            return pace, count
        second, seen = _pace_of(other, own, bursts=True)
        if second is not None and pace.counting and second.counting:
            # Either clock may hide losses, so the larger bound holds.
            return replace(pace, hidden=max(pace.hidden, second.hidden)), count
        # With a wider spread, a clock is too close to the limit to show single losses.
        if second is None or second.counting or second.spread > 0.2:
            return pace, count
        ratio = second.interval_ns / pace.interval_ns
        # If the clocks run equally fast, they stamp the same samples, and the even one shows which
        # of them are missing.
        speed = float(other[-1] - other[0]) / max(float(own[-1] - own[0]), 1.0)
        # Clocks that disagree by more than 12 % do not stamp the same samples.
        if abs(ratio - 1) > 0.12 < abs(speed - 1):
            return pace, count
        # With one of three dropped, stamps lie 0.17 off a grid of 1.5 intervals. The limits of 0.1
        # and of three times the clock's spread about its own grid are chosen by judgment, as is
        # that of 1 % between the intervals of one grid by two clocks.
        if not pace.counting and not (
                abs(ratio - 1) > 0.01
                and spread_about(other, pace.interval_ns) > max(0.1, 3 * second.spread)):
            # Ticks are an exact grid as well, but the stamps of the other clock do not lie on it.
            return pace, count
        decision.clock, decision.ticks, decision.overlaps = 'receive', False, False
        # No flaw: header stamps are usable, but less suitable.
        decision.remarks['receive_clock'] = {'flaw': None}
        return second, seen

    def _replace_header_clock(self, window: Window) -> None:
        """Switch to receive stamps, in a new run, if header stamps have become unusable."""
        repeats, cursor = _repeats(window.samples), self._memory.cursor
        flaw = flaw_of(window.header_ns, repeats, bursts=False)
        if not flaw or flaw_of(window.receive_ns, repeats, bursts=True):
            return
        self.decision.clock = 'receive'
        self.decision.remarks['clock_changed'] = {
            'flaw': flaw, 'since_s': cursor.elapsed_ns / SECOND}
        if cursor.last_ns is not None:
            cursor.last_ns, cursor.other_ns = cursor.other_ns, cursor.last_ns
        cursor.fresh_run = True

    def _twice(self, window: Window, stamps: Stamps) -> Bools:
        """Find duplicate messages, on a clock where different messages may share a stamp."""
        counts = self._counts
        same = np.zeros(len(stamps), dtype=bool)
        if not self.decision.separates_equal_stamps:
            return same
        tied = stamps[1:] == stamps[:-1]
        if tied.any():
            same[1:] = (tied & (window.header_ns[1:] == window.header_ns[:-1])
                        & _repeats(window.samples))
        last = counts.receive if self.decision.clock == 'receive' else counts.header
        if (len(self._memory.tail) and stamps[0] == last.last_ns
                and int(window.header_ns[0]) == counts.header.last_ns):
            newest = self._memory.tail[-1]
            there = ~np.isnan(newest)
            same[0] = np.array_equal(window.samples[0, there], newest[there])
        return same

    def _unusable(self, window: Window, all_usable: bool) -> tuple[Bools, Bools]:
        """Return the axes that are gone for a while, and messages with other unusable values."""
        counts, presence, c = self._counts, self.presence, window.consumed
        if all_usable and presence.stays(window.samples[:c]):
            return np.zeros((len(window), 6), dtype=bool), np.zeros(len(window), dtype=bool)
        with np.errstate(invalid='ignore'):
            bad: Bools = ~(np.abs(window.samples) < LARGEST)
        declared = np.repeat(window.absent, 3, axis=1)
        gone = presence.look(bad | declared, c)
        counts.absent += int(np.count_nonzero((declared & ~gone)[:c].any(axis=1)))
        spoilt: Bools = np.any((bad | declared) & ~gone, axis=1) | gone.all(axis=1)
        asleep = presence.waking(np.where(bad | gone, np.nan, window.samples), c)
        if asleep[:, 3:].any():
            # The output of a dead accelerometer is not gravity.
            counts.gravity, counts.gravity_samples = [0.0, 0.0, 0.0], 0
        return gone | asleep, spoilt


def _clipped(stamps: Stamps) -> Stamps:
    """Return stamps whose differences do not overflow."""
    farthest_ns = 2**61
    within = -farthest_ns <= stamps.min() and stamps.max() <= farthest_ns
    return stamps if within else np.clip(stamps, -farthest_ns, farthest_ns)


def _pace_of(stamps: Stamps, other: Stamps | None, bursts: bool, each: bool = False,
             ) -> tuple[Pace | None, int]:
    """Measure the pace on the longest run at one rate; also return the number of stamps used."""
    if bursts:
        stamps = stamps + place_in_burst(stamps, None, 0)
    order = order_stamps(stamps, None)
    if order is not None:
        stamps, other = stamps[order.keep], None if other is None else other[order.keep]
        edges = [0, *np.flatnonzero(order.jumps[order.keep]).tolist(), len(stamps)]
        longest = int(np.argmax(np.diff(edges)))
        run = slice(edges[longest], edges[longest + 1])
        stamps, other = stamps[run], None if other is None else other[run]
    part = longest_at_one_rate(stamps)
    return (pace_of_each(stamps[part]) if each else
            measure_pace(stamps[part], None if other is None else other[part])), len(stamps[part])


def _none_lost(stamps: Stamps, other: Stamps, bursts: bool) -> bool:
    """Return whether messages, repeats among them, come without losses."""
    pace, _ = _pace_of(stamps, other, bursts)
    if pace is None or pace.counting:
        return pace is not None and pace.hidden < 0.01
    # However uneven the polls are, all of them are there.
    places = float(stamps[-1] - stamps[0]) / pace.interval_ns + 1
    return abs(len(stamps) - places) < 0.01 * places


def _leaps(own: Stamps, other: Stamps, pace: Pace) -> bool:
    """Return whether stamps are slow and catch up in leaps that the other clock lacks."""
    # This happens if microseconds are written into the nanoseconds field.
    if pace.counting:
        return False
    steps, passed = np.diff(own), np.diff(other)
    near = (steps > 0) & (steps < 1.5 * pace.interval_ns)
    crawl = float(passed[near].sum()) / max(float(steps[near].sum()), 1.0)
    whole = float(other[-1] - other[0]) / max(float(own[-1] - own[0]), 1.0)
    # A replay at another speed keeps that speed throughout. The factor of ten is a judgment.
    # Stamps between two leaps do not show the overall speed, but an impossible rate.
    return crawl > 10 and (whole < 0.1 * crawl or pace.interval_ns < FASTEST_NS)


def _is_nearly_full(pace: Pace, stamps: Stamps) -> bool:
    """Return whether stamps lie close to a grid that has hardly any empty places."""
    places = float(stamps[-1] - stamps[0]) / pace.interval_ns + 1
    return (not pace.counting and pace.spread < 0.05
            and abs(len(stamps) - places) < 0.01 * places)


def _repeats(samples: Array) -> Bools:
    """Return whether each sample but the first equals the one before, absent axes included."""
    same: Bools = np.all((samples[1:] == samples[:-1])
                         | (np.isnan(samples[1:]) & np.isnan(samples[:-1])), axis=1)
    return same
