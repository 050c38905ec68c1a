# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The timeline as one streaming stage, shared by the node and by recordings.

Messages are worked off in windows of a fixed number, each seen together with the messages that
follow it, so that the outcome does not depend on the blocks they came in.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import asdict, dataclass, field
from itertools import pairwise
import json
from typing import Any, Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.result import Remark, Span, Timeline
from imu_allan.timeline.clock import (
    iso_time,
    judge_clock,
    LOOK_AHEAD,
    order_stamps,
    SECOND,
    Stamps,
)
from imu_allan.timeline.grid import bridge, count_steps, measure_pace, NEIGHBOURS, Pace
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Clock = Literal['header', 'receive']

WINDOW = 4096
"""Messages worked off together, the last `LOOK_AHEAD` of them again with the next window."""

LISTED_SPANS = 1000
"""Gaps and motion spans that are listed one by one."""

_LARGEST = 1e9
_RATE_TOLERANCE = 0.02
_GRAVITY = 9.80665
_GRAVITY_TOLERANCE = 0.5
_CLOCK_STEP_S = 1.0


@dataclass(frozen=True)
class TimelineOptions:
    """
    What the user may decide about the timeline.

    Attributes
    ----------
    clock : {'auto', 'header', 'receive'}
        Which stamps to use; 'auto' takes header stamps unless they are unusable.
    rate_hz : float or None
        Stated sample rate, which overrides the measured one.
    force_rate : bool
        Use the stated rate even if the measured one differs by more than 2 %.
    gap_tolerance : int
        Gaps of up to so many samples are bridged by the local mean.
    motion : {'exclude', 'keep'}
        Whether motion and knocks are cut out.

    """

    clock: Literal['auto', 'header', 'receive'] = 'auto'
    rate_hz: float | None = None
    force_rate: bool = False
    gap_tolerance: int = 5
    motion: Literal['exclude', 'keep'] = 'exclude'


@dataclass(frozen=True)
class TimelineSummary:
    """
    What was seen of the messages so far.

    Attributes
    ----------
    timeline : Timeline
        The part that goes into the result. `samples` counts the messages that found their place
        on the grid, those in motion among them; `missing` counts all empty places between them,
        bridged or in a listed gap.
    clock : {'header', 'receive'} or None
        None before a message came, and where samples are only counted (no usable stamps).
    frame_id : str or None
        header.frame_id of the messages used.
    start_time : str or None
        ISO-8601 time of the first sample.
    remarks : tuple of Remark
        Findings the user should know about.
    present : tuple of bool, length 6
        Whether each axis is there; the others are NaN in every block.
    messages : int
        Messages seen, rejected ones included.
    bridged : int
        Missing samples that were bridged by the local mean.
    measured_rate_hz : float or None
        Rate by the clock, whatever rate was stated.
    jitter_s : float or None
        Standard deviation of the stamps about the grid, lately.
    header_repeats, header_backward, receive_repeats, receive_backward : int
        Stamps equal to, or before, the stamp of the message before, on either clock.
    clock_jumps : int
        Jumps of the clock and changes from one clock to the other.
    excluded_s : float
        Total duration of motion that was cut out.
    moving : bool
        Motion was seen within the last seconds.
    mostly_motion : bool
        More than half of the samples are motion: the rest is no recording at rest.

    """

    timeline: Timeline
    clock: Clock | None
    frame_id: str | None
    start_time: str | None
    remarks: tuple[Remark, ...]
    present: tuple[bool, ...]
    messages: int = 0
    bridged: int = 0
    measured_rate_hz: float | None = None
    jitter_s: float | None = None
    header_repeats: int = 0
    header_backward: int = 0
    receive_repeats: int = 0
    receive_backward: int = 0
    clock_jumps: int = 0
    excluded_s: float = 0.0
    moving: bool = False
    mostly_motion: bool = False


@dataclass
class _Facts:
    """Counts and conclusions that only grow; all plain numbers and text."""

    messages: int = 0
    samples: int = 0
    missing: int = 0
    bridged: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    rejected: int = 0
    header_repeats: int = 0
    header_backward: int = 0
    receive_repeats: int = 0
    receive_backward: int = 0
    clock_jumps: int = 0
    gaps: int = 0
    gap_ns: int = 0
    listed_gaps: list[tuple[float, float]] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    other_frames: dict[str, int] = field(default_factory=dict)
    frame_id: str | None = None
    clock: str | None = None
    counted_only: bool = False
    present: list[bool] | None = None
    first_ns: int | None = None
    first_receive_ns: int = 0
    interval_ns: float | None = None
    spread: float = 0.0
    counting: bool = False
    paced_ns: int = 0
    paced_steps: int = 0
    last_header: int | None = None
    last_receive: int | None = None
    last_ns: int | None = None
    other_ns: int = 0
    late_ns: float = 0.0
    tied_to: int | None = None
    ties: int = 0
    index: int = -1
    elapsed_ns: int = 0
    fresh_run: bool = False
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])


@dataclass(frozen=True)
class _Window:
    """Messages as they came; the first `consumed` of them are to be worked off."""

    header: Stamps
    receive: Stamps
    samples: Floats
    absent: Bools
    consumed: int


class TimelineStage:
    """
    Even samples out of messages as they came, in constant memory.

    Parameters
    ----------
    options : TimelineOptions

    Notes
    -----
    `push` gives what is decided, up to some thousand messages late; `flush` gives the rest. For a
    look at a running stream flush a `copy`.

    """

    def __init__(self, options: TimelineOptions = TimelineOptions()) -> None:
        self._options = options
        self._pending: list[ImuBlock] = []
        self._pending_messages = 0
        self._tail = np.empty((0, 6))
        self._facts = _Facts()

    def push(self, block: ImuBlock) -> list[EvenBlock]:
        """
        Take messages, give the even samples that are decided by now.

        Raises
        ------
        ImuAllanError
            If no clock is usable, no axis is provided, or the stated rate is not the measured one.

        """
        facts = self._facts
        n = len(block)
        if n == 0:
            return []
        if block.frame_id != facts.frame_id:
            if facts.frame_id is not None:
                self._reject_frame(block.frame_id, n)
                return []
            facts.frame_id = block.frame_id
        self._pending.append(block)
        self._pending_messages += n
        blocks: list[EvenBlock] = []
        while self._pending_messages >= WINDOW:
            blocks += self._work_off(self._window(WINDOW, WINDOW - LOOK_AHEAD))
        return blocks

    def flush(self) -> list[EvenBlock]:
        """Give what is still held back, at the end of a recording."""
        if not self._pending_messages:
            return []
        n = self._pending_messages
        return self._work_off(self._window(n, n))

    def break_run(self) -> None:
        """Let the next sample begin a new run, after an interruption of unknown length."""
        self._facts.fresh_run = True

    def copy(self) -> 'TimelineStage':
        """Give an independent copy; arrays are shared, for they are never written to."""
        twin = shallow_copy(self)
        twin._pending = list(self._pending)
        twin._facts = _Facts(**asdict(self._facts))
        return twin

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Everything needed to go on later, as a flat dict of arrays."""
        window = self._joined(self._pending_messages)
        text = json.dumps({'options': asdict(self._options), 'facts': asdict(self._facts)})
        return {'facts': np.array(text), 'header_ns': window.header,
                'receive_ns': window.receive, 'samples': window.samples,
                'absent': window.absent, 'tail': self._tail}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> 'TimelineStage':
        """
        Go on from `to_state`.

        Raises
        ------
        ImuAllanError
            If `state` is not what `to_state` gave.

        """
        try:
            plain = json.loads(str(state['facts']))
            stage = cls(TimelineOptions(**plain['options']))
            stage._facts = _Facts(**plain['facts'])
            samples = np.asarray(state['samples'], dtype=np.float64).reshape(-1, 6)
            n = len(samples)
            if n:
                stage._pending = [ImuBlock(
                    np.asarray(state['header_ns'], dtype=np.int64).reshape(n),
                    np.asarray(state['receive_ns'], dtype=np.int64).reshape(n),
                    samples, np.asarray(state['absent'], dtype=bool).reshape(n, 2),
                    stage._facts.frame_id or '')]
            stage._pending_messages = n
            stage._tail = np.asarray(state['tail'], dtype=np.float64).reshape(-1, 6)
        except (KeyError, TypeError, ValueError) as error:
            raise ImuAllanError(f'saved timeline is damaged: {error}') from error
        return stage

    def summary(self) -> TimelineSummary:
        """Tell what was seen so far; messages still held back are only in `messages`."""
        facts = self._facts
        measured = (facts.paced_steps / facts.paced_ns * SECOND if facts.paced_ns > 0 else None)
        rate = self._options.rate_hz or measured
        duration_ns = facts.elapsed_ns + (SECOND / rate if rate and facts.samples else 0.0)
        timeline = Timeline(
            sample_rate_hz=rate, samples=facts.samples, duration_s=duration_ns / SECOND,
            missing=facts.missing, duplicates=facts.duplicates,
            out_of_order=facts.out_of_order, rejected=facts.rejected,
            gaps=tuple(Span(*gap) for gap in facts.listed_gaps))
        start = None
        if facts.first_ns is not None and not facts.counted_only:
            start = iso_time(max(facts.first_ns, facts.first_receive_ns)
                             if facts.first_ns < 20 * 365 * 86400 * SECOND else facts.first_ns)
        interval = facts.interval_ns
        return TimelineSummary(
            timeline=timeline,
            clock=None if facts.counted_only else facts.clock,  # type: ignore[arg-type]
            frame_id=facts.frame_id,
            start_time=start,
            remarks=self._remarks(),
            present=tuple(facts.present or [True] * 6),
            messages=facts.messages + self._pending_messages,
            bridged=facts.bridged,
            measured_rate_hz=None if facts.counted_only else measured,
            jitter_s=(facts.spread * interval / SECOND
                      if interval is not None and not facts.counted_only else None),
            header_repeats=facts.header_repeats, header_backward=facts.header_backward,
            receive_repeats=facts.receive_repeats, receive_backward=facts.receive_backward,
            clock_jumps=facts.clock_jumps)

    def _remarks(self) -> tuple[Remark, ...]:
        facts = self._facts
        remarks = dict(facts.remarks)
        if facts.gaps > len(facts.listed_gaps):
            remarks['gaps_not_listed'] = (
                f'{facts.gaps} gaps of {facts.gap_ns / SECOND:.6g} s in all; only the first '
                f'{len(facts.listed_gaps)} are listed')
        total = facts.samples + facts.bridged
        if total and facts.bridged > 0.05 * total:
            remarks['many_missing'] = (
                f'{facts.bridged / total:.0%} of the samples are missing and bridged by the '
                'local mean: record with a deeper queue or reliable delivery')
        if facts.other_frames:
            others = ', '.join(f'{name!r} ({count} messages)'
                               for name, count in facts.other_frames.items())
            remarks['several_frames'] = (
                f'several publishers on one topic: messages of frame_id {facts.frame_id!r} are '
                f'used, those of {others} rejected')
        if facts.samples and facts.present and all(facts.present[3:]):
            size = float(np.linalg.norm(facts.gravity)) / facts.samples
            if abs(size - _GRAVITY) > _GRAVITY_TOLERANCE:
                hint = ('; is it in units of g?' if abs(size - 1) < 0.05
                        else '; has gravity been removed?' if size < 0.5 else '')
                remarks['gravity'] = (
                    f'the mean acceleration is {size:.4g} m/s^2, not about 9.81{hint}')
        return tuple(Remark(code, message) for code, message in remarks.items())

    def _reject_frame(self, frame_id: str, messages: int) -> None:
        facts = self._facts
        facts.messages += messages
        facts.rejected += messages
        name = frame_id if frame_id in facts.other_frames or len(facts.other_frames) < 9 else '...'
        facts.other_frames[name] = facts.other_frames.get(name, 0) + messages

    def _joined(self, n: int) -> _Window:
        """Give the first `n` pending messages."""
        blocks, have = [], 0
        for block in self._pending:
            blocks.append(block)
            have += len(block)
            if have >= n:
                break
        if len(blocks) == 1:
            block = blocks[0]
            return _Window(block.header_ns[:n], block.receive_ns[:n], block.samples[:n],
                           block.absent[:n], n)
        if not blocks:
            return _Window(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 6)),
                           np.empty((0, 2), bool), 0)
        return _Window(np.concatenate([b.header_ns for b in blocks])[:n],
                       np.concatenate([b.receive_ns for b in blocks])[:n],
                       np.concatenate([b.samples for b in blocks])[:n],
                       np.concatenate([b.absent for b in blocks])[:n], n)

    def _window(self, n: int, consumed: int) -> _Window:
        """Give the first `n` pending messages and let go of `consumed` of them."""
        window = self._joined(n)
        left = consumed
        while left:
            block = self._pending[0]
            if len(block) <= left:
                left -= len(block)
                del self._pending[0]
                continue
            self._pending[0] = ImuBlock(block.header_ns[left:], block.receive_ns[left:],
                                        block.samples[left:], block.absent[left:],
                                        block.frame_id)
            left = 0
        self._pending_messages -= consumed
        return _Window(window.header, window.receive, window.samples, window.absent, consumed)

    def _work_off(self, window: _Window) -> list[EvenBlock]:
        facts = self._facts
        if facts.clock is None:
            self._decide(window)
        c = window.consumed
        facts.messages += c
        repeats, backward = _stamp_faults(window.header[:c], facts.last_header)
        facts.header_repeats += repeats
        facts.header_backward += backward
        if (repeats or backward) and facts.clock == 'header' and self._options.clock == 'auto':
            self._doubt_header(window)
        repeats, backward = _stamp_faults(window.receive[:c], facts.last_receive)
        facts.receive_repeats += repeats
        facts.receive_backward += backward

        stamps, other = self._stamps(window)
        same = self._repeated(window, stamps)
        facts.last_header = int(window.header[c - 1])
        facts.last_receive = int(window.receive[c - 1])
        rows = np.arange(len(stamps))
        bad = self._unusable(window)
        if same is not None:
            facts.duplicates += int(np.count_nonzero(same[:c] & ~(bad[:c] if bad is not None
                                                                  else False)))
            bad = same if bad is None else bad | same
        if bad is not None:
            rows = np.flatnonzero(~bad)
            facts.rejected += int(np.count_nonzero(bad[:c]))
            if same is not None:
                facts.rejected -= int(np.count_nonzero(same[:c]))
        return self._place(window, stamps, other, rows)

    def _decide(self, window: _Window) -> None:
        """Choose clock, axes and pace from the first messages."""
        facts, options = self._facts, self._options
        samples = window.samples
        finite = np.mean(np.isfinite(samples), axis=0)
        declared = np.repeat(np.mean(window.absent, axis=0) <= 0.5, 3)
        present = declared & (finite > 0.5)
        if not present.any():
            raise ImuAllanError(
                'the messages carry neither angular velocity nor linear acceleration '
                '(covariance[0] is -1 or every value is NaN): choose another topic')
        facts.present = [bool(axis) for axis in present]
        if np.any(declared & ~present):
            names = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
            missing = ', '.join(name for name, gone in zip(names, declared & ~present, strict=True)
                                if gone)
            facts.remarks['axis_not_finite'] = f'{missing}: NaN or infinite, left out'
        self._choose_clock(window)
        facts.first_receive_ns = int(window.receive[0])
        stated = None if options.rate_hz is None else SECOND / options.rate_hz
        if facts.counted_only:
            facts.interval_ns, facts.spread, facts.counting = stated, 0.0, False
            return
        stamps, _ = self._stamps(window)
        order = order_stamps(stamps, None)
        rising = stamps if order is None else stamps[order.keep]
        if order is not None and order.jumps.any():
            starts = np.append(np.flatnonzero(order.jumps[order.keep]), len(rising))
            starts = np.insert(starts, 0, 0)
            longest = int(np.argmax(np.diff(starts)))
            rising = rising[starts[longest]:starts[longest + 1]]
        pace = measure_pace(rising)
        if pace is None:
            facts.interval_ns = stated
            return
        facts.interval_ns, facts.spread, facts.counting = (
            pace.interval_ns, pace.spread, pace.counting)
        if options.rate_hz is not None and len(rising) >= 8 and not options.force_rate:
            measured = SECOND / pace.interval_ns
            if abs(measured / options.rate_hz - 1) > _RATE_TOLERANCE:
                raise ImuAllanError(
                    f'the stated rate is {options.rate_hz:g} Hz, but the {facts.clock} stamps '
                    f'advance at {measured:.6g} Hz: leave out the rate, choose the other clock, '
                    'or force the stated rate')

    def _choose_clock(self, window: _Window) -> None:
        facts, options = self._facts, self._options
        repeats = _repeats(window.samples)
        quality = {'header': judge_clock(window.header, repeats, bursts=False),
                   'receive': judge_clock(window.receive, repeats, bursts=True)}
        choice = 'header' if options.clock == 'auto' else options.clock
        if not quality[choice].usable and options.clock == 'auto' and quality['receive'].usable:
            facts.remarks['receive_clock'] = (
                f'header stamps are {quality["header"].flaw}: receive stamps are used, whose '
                'jitter does not harm the curve')
            choice = 'receive'
        if not quality[choice].usable:
            if options.rate_hz is None:
                what = (f'{choice} stamps are {quality[choice].flaw}' if options.clock != 'auto'
                        else f'header stamps are {quality["header"].flaw} and receive stamps '
                             f'{quality["receive"].flaw}')
                raise ImuAllanError(f'{what}: choose another clock or state the sample rate')
            facts.counted_only = True
            facts.remarks['counted_samples'] = (
                f'no usable stamps: samples are counted at the stated {options.rate_hz:g} Hz, '
                'and missing ones cannot be seen')
        facts.clock = choice

    def _doubt_header(self, window: _Window) -> None:
        """Go on by receive stamps where header stamps have become unusable."""
        facts = self._facts
        repeats = _repeats(window.samples)
        header = judge_clock(window.header, repeats, bursts=False)
        if header.usable or not judge_clock(window.receive, repeats, bursts=True).usable:
            return
        facts.clock = 'receive'
        facts.clock_jumps += 1
        facts.fresh_run = True
        facts.last_ns = None
        facts.remarks['clock_changed'] = (
            f'header stamps are {header.flaw} from {facts.elapsed_ns / SECOND:.6g} s on: receive '
            'stamps are used from there')

    def _stamps(self, window: _Window) -> tuple[Stamps, Stamps]:
        """Stamps of the chosen clock, and of the other one."""
        facts = self._facts
        if facts.counted_only:
            first = facts.messages - window.consumed if facts.messages else 0
            assert facts.interval_ns is not None or self._options.rate_hz is not None
            interval = facts.interval_ns or SECOND / (self._options.rate_hz or 1.0)
            counted = np.rint((first + np.arange(len(window.header))) * interval)
            return counted.astype(np.int64), window.receive
        if facts.clock == 'header':
            return window.header, window.receive
        return window.receive, window.header

    def _repeated(self, window: _Window, stamps: Stamps) -> Bools | None:
        """Messages that came twice, by a clock on which different messages share stamps."""
        facts = self._facts
        if facts.clock != 'receive' or facts.counted_only:
            return None
        tied = np.empty(len(stamps), dtype=bool)
        tied[0] = stamps[0] == facts.last_receive
        np.equal(stamps[1:], stamps[:-1], out=tied[1:])
        if not tied.any():
            return None
        same = np.zeros(len(stamps), dtype=bool)
        same[1:] = tied[1:] & (window.header[1:] == window.header[:-1]) & _repeats(window.samples)
        if tied[0] and len(self._tail):
            same[0] = (int(window.header[0]) == facts.last_header
                       and bool(np.array_equal(window.samples[0], self._tail[-1])))
        return same if same.any() else None

    def _unusable(self, window: _Window) -> Bools | None:
        """Messages with NaN, infinite or absurd values, or fields declared absent."""
        facts = self._facts
        samples = window.samples
        flat = samples.reshape(-1)
        present = np.array(facts.present)
        groups = [bool(present[:3].any()), bool(present[3:].any())]
        bad: Bools | None = None
        if window.absent[:, groups].any():
            bad = window.absent[:, groups].any(axis=1)
        if not (present.all() and np.dot(flat, flat) < _LARGEST ** 2):
            with np.errstate(invalid='ignore'):
                wild = ~np.all(np.abs(samples[:, present]) < _LARGEST, axis=1)
            if wild.any():
                bad = wild if bad is None else bad | wild
        return bad

    def _place(self, window: _Window, stamps: Stamps, other: Stamps,
               rows: Ints) -> list[EvenBlock]:
        """Order the usable messages, split them where the clock jumps, put them on the grid."""
        facts, c = self._facts, window.consumed
        if not len(rows):
            return []
        whole = len(rows) == len(stamps)
        samples = window.samples
        if not whole:
            stamps, other, samples = stamps[rows], other[rows], samples[rows]
            c = int(np.searchsorted(rows, c))
        if facts.clock == 'receive' and not facts.counted_only:
            stamps = self._untie(stamps, c)
        jumps = np.zeros(len(stamps), dtype=bool)
        order = order_stamps(stamps, facts.last_ns)
        if order is not None:
            facts.duplicates += int(np.count_nonzero(order.duplicate[:c]))
            facts.out_of_order += int(np.count_nonzero(order.out_of_order[:c]))
            keep = order.keep
            c = int(np.count_nonzero(keep[:c]))
            stamps, other, samples = stamps[keep], other[keep], samples[keep]
            jumps = order.jumps[keep]
        if not c:
            return []
        if facts.interval_ns is not None:
            jumps |= self._forward_jumps(stamps, other)
        starts = np.flatnonzero(jumps)
        edges = [0, *(int(s) for s in starts if 0 < s < c), c]
        if len(starts) and starts[0] == 0:
            facts.fresh_run = True
            facts.clock_jumps += 1
        blocks: list[EvenBlock] = []
        for number, (first, last) in enumerate(pairwise(edges)):
            if number:
                facts.fresh_run = True
                facts.clock_jumps += 1
            end = next((int(s) for s in starts if s >= last), len(stamps))
            blocks += self._stretch(stamps[first:end], other[first:end], samples[first:end],
                                    last - first)
        return blocks

    def _untie(self, stamps: Stamps, consumed: int) -> Stamps:
        """Let messages received together follow each other by a nanosecond."""
        facts = self._facts
        joins = facts.tied_to is not None and int(stamps[0]) == facts.tied_to
        tied = stamps[1:] == stamps[:-1]
        if not joins and not tied.any():
            since = np.zeros(len(stamps), dtype=np.int64)
        else:
            position = np.arange(len(stamps))
            begins = np.concatenate([[0], np.where(tied, 0, position[1:])])
            since = position - np.maximum.accumulate(begins)
            if joins:
                since[:len(stamps) if tied.all() else int(np.argmin(tied)) + 1] += facts.ties + 1
        if consumed:
            facts.tied_to, facts.ties = int(stamps[consumed - 1]), int(since[consumed - 1])
        return stamps + since

    def _forward_jumps(self, stamps: Stamps, other: Stamps) -> Bools:
        """Messages before which this clock, but not the other one, leapt ahead."""
        facts = self._facts
        jumps = np.zeros(len(stamps), dtype=bool)
        interval = facts.interval_ns or 1.0
        limit = max(_CLOCK_STEP_S * SECOND, 200 * interval)
        steps = np.empty(len(stamps), dtype=np.int64)
        steps[0] = stamps[0] - facts.last_ns if facts.last_ns is not None else 0
        steps[1:] = np.diff(stamps)
        for at in np.flatnonzero(steps > limit).tolist():
            low, high = max(at - 32, 0), min(at + 32, len(stamps) - 1)
            passed = float(other[high] - other[low]) if at else float(
                other[high] - facts.other_ns)
            usual = (high - low + (0 if at else 1)) * interval
            alive = other[high] != other[low]
            jumps[at] = ((alive and passed < usual + 0.25 * steps[at])
                         or steps[at] > 10 * 365 * 86400 * SECOND)
        return jumps

    def _stretch(self, stamps: Stamps, other: Stamps, samples: Floats,
                 consumed: int) -> list[EvenBlock]:
        """Place messages of one run of the clock."""
        facts, options = self._facts, self._options
        c = consumed
        new_run = facts.fresh_run or facts.last_ns is None
        if facts.interval_ns is None:
            pace = measure_pace(stamps)
            if pace is not None:
                facts.interval_ns, facts.spread = pace.interval_ns, pace.spread
                facts.counting = pace.counting
        interval = facts.interval_ns or 1.0
        pace = Pace(interval, facts.spread, facts.counting)
        if new_run:
            if facts.first_ns is None:
                facts.first_ns = int(stamps[0])
            else:
                passed = int(other[0]) - facts.other_ns
                facts.elapsed_ns += passed if 0 < passed < 1e15 else int(interval)
            reference, late = int(stamps[0]), interval
        else:
            assert facts.last_ns is not None
            reference, late = facts.last_ns, facts.late_ns
        places = ((stamps - reference).astype(np.float64) + late) / interval
        steps = count_steps(places, pace)
        if new_run:
            steps[0] = 1
        behind = np.diff(stamps, prepend=reference)[:c]
        index = facts.index + np.cumsum(steps[:c])

        tolerated = options.gap_tolerance + 1
        paced = steps[:c] <= tolerated
        if new_run:
            paced[0] = False
        facts.paced_steps += int(steps[:c][paced].sum())
        facts.paced_ns += int(behind[paced].sum())
        breaks = np.flatnonzero(steps[:c] > tolerated)
        start_ns = facts.elapsed_ns - reference
        for at in breaks:
            begins = start_ns + int(stamps[at]) - int(behind[at]) + interval
            lasts = max(float(behind[at]) - interval, 0.0)
            facts.gaps += 1
            facts.gap_ns += int(lasts)
            if len(facts.listed_gaps) < LISTED_SPANS:
                facts.listed_gaps.append((begins / SECOND, lasts / SECOND))
        missing = int((steps[:c] - 1).sum())
        facts.missing += missing
        facts.samples += c

        elapsed = facts.elapsed_ns + int(stamps[c - 1]) - reference
        lately = (stamps[max(c - 128, 0):c] - stamps[c - 1]) / interval
        residual = lately - (index[max(c - 128, 0):c] - index[-1])
        facts.late_ns = -float(np.median(residual)) * interval
        facts.last_ns = int(stamps[c - 1])
        facts.other_ns = int(other[c - 1])
        facts.elapsed_ns = elapsed
        first_index = facts.index + 1
        facts.index = int(index[-1])
        facts.fresh_run = False

        usable = samples[:c]
        if facts.present and not all(facts.present):
            samples = samples.copy()
            samples[:, ~np.array(facts.present)] = np.nan
            usable = samples[:c]
        if facts.present and all(facts.present[3:]):
            sums = usable[:, 3:].sum(axis=0)
            facts.gravity = [a + float(b) for a, b in zip(facts.gravity, sums, strict=True)]
        if new_run:
            self._tail = np.empty((0, 6))
        if missing == 0:
            blocks = [EvenBlock(usable, first_index, 0, new_run)]
        else:
            blocks = self._fill(samples, steps, index, c, new_run)
        self._tail = (usable[-NEIGHBOURS:] if c >= NEIGHBOURS else
                      np.concatenate([self._tail, usable])[-NEIGHBOURS:])
        return blocks

    def _fill(self, samples: Floats, steps: Ints, index: Ints, c: int,
              new_run: bool) -> list[EvenBlock]:
        """Bridge short gaps, split at the others."""
        facts = self._facts
        tolerated = self._options.gap_tolerance + 1
        tail = len(self._tail)
        known = np.concatenate([self._tail, samples[:c + NEIGHBOURS]])
        gaps = np.flatnonzero((steps[:c] > 1) & (steps[:c] <= tolerated))
        stretch = np.zeros(len(known), dtype=np.int64)
        stretch[tail:] = np.cumsum(steps[:c + NEIGHBOURS] > tolerated)
        means = bridge(known, gaps + tail, stretch)
        lengths = steps[gaps] - 1
        breaks = np.flatnonzero(steps[:c] > tolerated)
        edges = [0, *(int(b) for b in breaks if b > 0), c]
        blocks = []
        for first, last in pairwise(edges):
            inside = (gaps >= first) & (gaps < last)
            begins = (int(index[first]) if steps[first] > tolerated
                      else int(index[first]) - int(steps[first]) + 1)
            rows = np.empty((int(index[last - 1]) - begins + 1, 6))
            rows[index[first:last] - begins] = samples[first:last]
            bridged = int(lengths[inside].sum())
            if bridged:
                ends = np.repeat(index[gaps[inside]] - begins, lengths[inside])
                back = np.concatenate([np.arange(length, 0, -1) for length in lengths[inside]])
                rows[ends - back] = np.repeat(means[inside], lengths[inside], axis=0)
            facts.bridged += bridged
            blocks.append(EvenBlock(rows, begins, bridged, new_run and first == 0))
        return blocks


def _stamp_faults(stamps: Stamps, last: int | None) -> tuple[int, int]:
    """Count stamps equal to, and before, the one before."""
    steps = np.diff(stamps) if last is None else np.diff(stamps, prepend=last)
    if not len(steps) or steps.min() > 0:
        return 0, 0
    return int(np.count_nonzero(steps == 0)), int(np.count_nonzero(steps < 0))


def _repeats(samples: Floats) -> Bools:
    """Whether each sample but the first equals the one before."""
    same: Bools = np.all(samples[1:] == samples[:-1], axis=1)
    return same
