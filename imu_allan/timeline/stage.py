# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The timeline as one streaming stage, shared by the node and by recordings.

Messages are worked off in windows of a fixed number, each seen together with the messages that
follow it, so that the outcome does not depend on the blocks they came in.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
import json
from math import sqrt
from typing import Any

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.clock import (
    bounded,
    judge_clock,
    LOOK_AHEAD,
    order_stamps,
    place_in_burst,
    SECOND,
    Stamps,
)
from imu_allan.timeline.grid import (
    bridge,
    count_steps,
    EVEN_JITTER,
    measure_pace,
    NEIGHBOURS,
    Pace,
    rate_changes,
)
from imu_allan.timeline.motion import EvenPiece, MotionDetector, MotionSummary
from imu_allan.timeline.options import TimelineOptions
from imu_allan.timeline.pending import Pending, Window
from imu_allan.timeline.summary import Facts, summarize, TimelineSummary
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WINDOW = 4096
"""Messages seen together; the last `LOOK_AHEAD` of them are worked off with the next window."""

_AXES = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
_LARGEST = 1e9
_RATE_TOLERANCE = 0.02
_CLOCK_STEP_S = 1.0
_NEVER_NS = 5 * 365 * 86400 * SECOND
_SHORTEST_NS = 1e3
_LONGEST_NS = 100.0 * SECOND
_LATELY = 128
_FOLLOW = 0.2
_SPARSE = 16
_FEWEST_FOR_RATE = 64
_NONE = np.empty(0, dtype=np.int64)
_DEFAULTS = TimelineOptions()


@dataclass(frozen=True)
class _Messages:
    """Messages in order on one run of the clock; the first `consumed` are to be placed."""

    stamps: Stamps
    other: Stamps
    samples: Floats
    consumed: int

    def part(self, first: int, last: int, look_ahead: bool) -> '_Messages':
        end = len(self.stamps) if look_ahead else last
        return _Messages(self.stamps[first:end], self.other[first:end], self.samples[first:end],
                         last - first)


class TimelineStage:
    """
    Even samples out of messages as they came, in constant memory.

    Parameters
    ----------
    options : TimelineOptions
        What the user decided.

    Notes
    -----
    `push` gives what is decided, up to some thousand messages late; `flush` gives the rest. For a
    look at a running stream flush a `copy`.

    """

    def __init__(self, options: TimelineOptions = _DEFAULTS) -> None:
        self._options = options
        self._pending = Pending()
        self._ready: list[EvenBlock] = []
        self._tail = np.empty((0, 6))
        self._facts = Facts()
        self._motion: MotionDetector | None = None

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
        blocks, self._ready = self._ready, []
        if n == 0:
            return blocks
        if block.frame_id != facts.frame_id:
            if facts.frame_id is not None:
                self._reject_frame(block.frame_id, n)
                return blocks
            facts.frame_id = block.frame_id
        self._pending.append(block)
        while len(self._pending) >= WINDOW:
            blocks += self._work_off(self._pending.take(WINDOW, WINDOW - LOOK_AHEAD))
        return blocks

    def flush(self) -> list[EvenBlock]:
        """
        Give what is still held back, at the end of a recording.

        Raises
        ------
        ImuAllanError
            As `push`.

        """
        blocks = self._work_off_pending()
        if self._motion is not None:
            blocks += self._motion.flush()
        return blocks

    def break_run(self) -> None:
        """Let the next sample begin a new run, after an interruption of unknown length."""
        self._ready = self._work_off_pending()
        self._facts.fresh_run = True

    def copy(self) -> 'TimelineStage':
        """Give an independent copy; arrays are shared, for they are never written to."""
        twin = TimelineStage(self._options)
        twin._pending = self._pending.copy()
        twin._ready, twin._tail = list(self._ready), self._tail
        twin._facts = self._facts.copy()
        twin._motion = self._motion.copy() if self._motion is not None else None
        return twin

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Everything needed to go on later, as a flat dict of arrays."""
        window = self._pending.look(len(self._pending))
        text = json.dumps({'options': asdict(self._options), 'facts': vars(self._facts)})
        state = {'facts': np.array(text), 'header_ns': window.header,
                 'receive_ns': window.receive, 'samples': window.samples,
                 'absent': window.absent, 'tail': self._tail}
        if self._motion is not None:
            state |= self._motion.to_state()
        return state

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
            stage._facts = Facts.from_plain(plain['facts'])
            samples = np.asarray(state['samples'], dtype=np.float64).reshape(-1, 6)
            n = len(samples)
            if n:
                stage._pending.append(ImuBlock(
                    np.asarray(state['header_ns'], dtype=np.int64).reshape(n),
                    np.asarray(state['receive_ns'], dtype=np.int64).reshape(n),
                    samples, np.asarray(state['absent'], dtype=bool).reshape(n, 2),
                    stage._facts.frame_id or ''))
            stage._tail = np.asarray(state['tail'], dtype=np.float64).reshape(-1, 6)
            if 'motion' in state:
                stage._motion = MotionDetector.from_state(state)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ImuAllanError(f'saved timeline is damaged: {error}') from error
        return stage

    def summary(self) -> TimelineSummary:
        """Tell what was seen of every message so far, those still held back included."""
        stage = self
        if self._pending or (self._motion is not None and self._motion.holds_back):
            stage = self.copy()
            try:
                stage.flush()
            except ImuAllanError:
                stage = self
        motion = stage._motion.summary if stage._motion is not None else MotionSummary()
        return summarize(stage._facts, self._options, motion, len(stage._pending))

    def _reject_frame(self, frame_id: str, messages: int) -> None:
        facts = self._facts
        facts.messages += messages
        facts.rejected += messages
        known = frame_id in facts.other_frames or len(facts.other_frames) < 9
        name = frame_id if known else '...'
        facts.other_frames[name] = facts.other_frames.get(name, 0) + messages

    def _work_off_pending(self) -> list[EvenBlock]:
        blocks, self._ready = self._ready, []
        if self._pending:
            n = len(self._pending)
            blocks += self._work_off(self._pending.take(n, n))
        return blocks

    def _work_off(self, window: Window) -> list[EvenBlock]:
        facts = self._facts
        if facts.clock is not None and self._is_even(window):
            return self._put_even(window)
        window = Window(bounded(window.header), bounded(window.receive), window.samples,
                        window.absent, window.consumed)
        if facts.clock is None:
            self._decide(window)
        c = window.consumed
        repeats, backward = _stamp_faults(window.header[:c], facts.last_header)
        facts.header_repeats += repeats
        facts.header_backward += backward
        if (repeats or backward) and facts.clock == 'header' and self._options.clock == 'auto':
            self._doubt_header(window)
        repeats, backward = _stamp_faults(window.receive[:c], facts.last_receive)
        facts.receive_repeats += repeats
        facts.receive_backward += backward

        stamps, other = self._stamps(window)
        unusable = self._unusable(window)
        twice = self._twice(window, stamps) if facts.clock == 'receive' else None
        facts.messages += c
        facts.last_header = int(window.header[c - 1])
        facts.last_receive = int(window.receive[c - 1])
        rows = None
        if unusable is not None or twice is not None:
            unusable = np.zeros(len(stamps), dtype=bool) if unusable is None else unusable
            twice = np.zeros(len(stamps), dtype=bool) if twice is None else twice & ~unusable
            facts.rejected += int(np.count_nonzero(unusable[:c]))
            facts.duplicates += int(np.count_nonzero(twice[:c]))
            rows = np.flatnonzero(~(unusable | twice))
        return self._order(window, stamps, other, rows)

    def _is_even(self, window: Window) -> bool:
        """Tell whether nothing at all is wrong with the messages, as is usual."""
        facts = self._facts
        if (facts.last_ns is None or facts.fresh_run or facts.other_rate or facts.counting
                or facts.counted_only or facts.interval_ns is None
                or not all(facts.present or [False]) or window.absent.any()):
            return False
        stamps, interval, c = self._stamps(window)[0], facts.interval_ns, window.consumed
        first = int(stamps[0]) - facts.last_ns
        steps = stamps[1:] - stamps[:-1]
        least, most = (1 - EVEN_JITTER) * interval, (1 + EVEN_JITTER) * interval
        return bool(
            least < first < most
            and (not len(steps) or (least < steps.min() and steps.max() < most))
            and abs(int(stamps[c - 1]) - facts.last_ns - c * interval) < 4 * interval
            and window.samples.max() < _LARGEST and window.samples.min() > -_LARGEST)

    def _put_even(self, window: Window) -> list[EvenBlock]:
        """Put messages without any fault on the grid."""
        facts, c = self._facts, window.consumed
        stamps, other = self._stamps(window)
        assert facts.last_ns is not None
        assert facts.interval_ns is not None
        if facts.clock == 'header':
            repeats, backward = _stamp_faults(other[:c], facts.last_receive)
            facts.receive_repeats += repeats
            facts.receive_backward += backward
        else:
            repeats, backward = _stamp_faults(other[:c], facts.last_header)
            facts.header_repeats += repeats
            facts.header_backward += backward
            facts.tied_to, facts.ties = int(stamps[c - 1]), 0
        facts.messages += c
        facts.last_header = int(window.header[c - 1])
        facts.last_receive = int(window.receive[c - 1])
        begins = facts.elapsed_ns + int(stamps[0]) - facts.last_ns
        piece = EvenPiece(window.samples[:c], facts.index + 1, begins / SECOND, False, _NONE)
        passed = int(stamps[c - 1]) - facts.last_ns
        lately = stamps[max(c - _LATELY, 0):c]
        late = (lately - lately[-1]) / facts.interval_ns + np.arange(len(lately) - 1, -1, -1)
        messages = _Messages(stamps, other, window.samples, c)
        return self._advance(messages, [piece], late, passed, c, passed, c)

    def _decide(self, window: Window) -> None:
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
            missing = ', '.join(name for name, gone
                                in zip(_AXES, declared & ~present, strict=True) if gone)
            facts.remarks['axis_not_finite'] = f'{missing}: NaN or infinite, left out'
        self._choose_clock(window)
        facts.first_receive_ns = int(window.receive[0])
        stated = None if options.rate_hz is None else SECOND / options.rate_hz
        if facts.counted_only:
            facts.interval_ns, facts.spread, facts.counting = stated, 0.0, False
            return
        stamps, _ = self._stamps(window)
        since = place_in_burst(stamps, None, 0) if facts.clock == 'receive' else None
        if since is not None:
            stamps = stamps + since
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
        self._take_pace(pace)
        if (options.rate_hz is not None and len(rising) >= _FEWEST_FOR_RATE
                and not options.force_rate):
            measured = SECOND / pace.interval_ns
            if abs(measured / options.rate_hz - 1) > _RATE_TOLERANCE + 1 / len(rising):
                facts.clock = None
                raise ImuAllanError(
                    f'the stated rate is {options.rate_hz:g} Hz, but the {facts.clock} stamps '
                    f'advance at {measured:.6g} Hz: leave out the rate, choose the other clock, '
                    'or force the stated rate')

    def _take_pace(self, pace: Pace) -> None:
        facts = self._facts
        if not _SHORTEST_NS < pace.interval_ns < _LONGEST_NS:
            clock, facts.clock = facts.clock, None
            raise ImuAllanError(
                f'the {clock} stamps advance by {pace.interval_ns / SECOND:.3g} s from message to '
                'message, as those of no IMU do: choose the other clock')
        facts.interval_ns, facts.spread, facts.counting = (
            pace.interval_ns, pace.spread, pace.counting)

    def _choose_clock(self, window: Window) -> None:
        facts, options = self._facts, self._options
        repeats = _repeats(window.samples)
        quality = {'header': judge_clock(window.header, repeats, bursts=False),
                   'receive': judge_clock(window.receive, repeats, bursts=True)}
        choice = 'header' if options.clock == 'auto' else options.clock
        if not quality[choice].usable and options.clock == 'auto' and quality['receive'].usable:
            facts.remarks['receive_clock'] = (
                f'header stamps are {quality["header"].flaw}: receive stamps are used')
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

    def _doubt_header(self, window: Window) -> None:
        """Go on by receive stamps where header stamps have become unusable."""
        facts = self._facts
        repeats = _repeats(window.samples)
        header = judge_clock(window.header, repeats, bursts=False)
        if header.usable or not judge_clock(window.receive, repeats, bursts=True).usable:
            return
        facts.clock = 'receive'
        if facts.last_ns is not None:
            facts.last_ns, facts.other_ns = facts.other_ns, facts.last_ns
        facts.fresh_run = True
        facts.remarks['clock_changed'] = (
            f'header stamps are {header.flaw} from about {facts.elapsed_ns / SECOND:.6g} s on: '
            'receive stamps are used from there')

    def _stamps(self, window: Window) -> tuple[Stamps, Stamps]:
        """Stamps of the chosen clock, and of the other one."""
        facts = self._facts
        if facts.counted_only:
            interval = SECOND / (self._options.rate_hz or 1.0)
            place = np.arange(facts.messages, facts.messages + len(window.header))
            return np.rint(place * interval).astype(np.int64), window.receive
        if facts.clock == 'header':
            return window.header, window.receive
        return window.receive, window.header

    def _twice(self, window: Window, stamps: Stamps) -> Bools | None:
        """Messages that came twice, by a clock on which different messages share stamps."""
        facts = self._facts
        if facts.counted_only:
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

    def _unusable(self, window: Window) -> Bools | None:
        """Messages with NaN, infinite or absurd values, or with fields declared absent."""
        samples = window.samples
        present = np.array(self._facts.present)
        bad: Bools | None = None
        if window.absent.any():
            declared = window.absent & np.array([present[:3].any(), present[3:].any()])
            if declared.any():
                bad = np.any(declared, axis=1)
        if not (present.all() and samples.max() < _LARGEST and samples.min() > -_LARGEST):
            with np.errstate(invalid='ignore'):
                wild: Bools = ~np.all(np.abs(samples[:, present]) < _LARGEST, axis=1)
            if wild.any():
                bad = wild if bad is None else bad | wild
        return bad

    def _order(self, window: Window, stamps: Stamps, other: Stamps,
               rows: Ints | None) -> list[EvenBlock]:
        """Order the usable messages and split them where the clock jumps."""
        facts, c = self._facts, window.consumed
        samples = window.samples
        if rows is not None:
            c = int(np.searchsorted(rows, c))
            stamps, other, samples = stamps[rows], other[rows], samples[rows]
        if not len(stamps):
            return []
        if facts.clock == 'receive' and not facts.counted_only:
            stamps = self._untie(stamps, c)
        order = order_stamps(stamps, None if facts.fresh_run else facts.last_ns)
        jumps = np.zeros(len(stamps), dtype=bool)
        if order is not None:
            facts.duplicates += int(np.count_nonzero(order.duplicate[:c]))
            facts.out_of_order += int(np.count_nonzero(order.out_of_order[:c]))
            c = int(np.count_nonzero(order.keep[:c]))
            jumps = order.jumps[order.keep]
            stamps, other = stamps[order.keep], other[order.keep]
            samples = samples[order.keep]
        if not c:
            return []
        if not all(facts.present or ()):
            samples = samples.copy()
            samples[:, ~np.array(facts.present)] = np.nan
        jumps |= self._forward_jumps(stamps, other)
        starts = np.flatnonzero(jumps).tolist()
        blocks: list[EvenBlock] = []
        for first, last in pairwise([0, *(s for s in starts if 0 < s < c), c]):
            if first in starts:
                facts.clock_jumps += 1
                facts.fresh_run = facts.jumped = True
            end = next((s for s in starts if s >= last), len(stamps))
            blocks += self._pace(_Messages(stamps[first:end], other[first:end],
                                           samples[first:end], last - first))
        return blocks

    def _untie(self, stamps: Stamps, consumed: int) -> Stamps:
        """Let messages received together follow each other by a nanosecond."""
        facts = self._facts
        since = place_in_burst(stamps, facts.tied_to, facts.ties)
        if since is None:
            since = np.zeros(len(stamps), dtype=np.int64)
        if consumed:
            facts.tied_to, facts.ties = int(stamps[consumed - 1]), int(since[consumed - 1])
        return stamps + since

    def _forward_jumps(self, stamps: Stamps, other: Stamps) -> Bools:
        """Messages before which this clock, but not the other one, leapt ahead."""
        facts = self._facts
        jumps = np.zeros(len(stamps), dtype=bool)
        interval = facts.interval_ns or 1.0
        limit = max(_CLOCK_STEP_S * SECOND, min(200 * interval, _NEVER_NS))
        last = facts.last_ns if facts.last_ns is not None else int(stamps[0])
        steps = np.diff(stamps, prepend=last)
        for at in np.flatnonzero(steps > limit).tolist():
            low, high = max(at - 32, 0), min(at + 32, len(stamps) - 1)
            passed = float(other[high] - (other[low] if at else facts.other_ns))
            usual = (high - low + (0 if at else 1)) * interval
            alive = other[high] != other[low]
            jumps[at] = ((alive and passed < usual + 0.25 * steps[at])
                         or steps[at] + facts.elapsed_ns > _NEVER_NS)
        return jumps

    def _pace(self, messages: _Messages) -> list[EvenBlock]:
        """Leave out stretches at another rate than the first one; place the others."""
        facts = self._facts
        if facts.interval_ns is None:
            pace = measure_pace(messages.stamps)
            if pace is not None:
                self._take_pace(pace)
        steps = self._steps(messages)
        c = messages.consumed
        if not facts.counted_only and (facts.other_rate or self._rate_doubtful(messages, steps)):
            changes = rate_changes(self._places(messages)[:c], facts.counting, facts.other_rate)
            if len(changes) > 1 or changes[0][1]:
                return self._split_by_rate(messages, changes)
            facts.other_rate = False
        return self._put(messages, steps)

    def _split_by_rate(self, messages: _Messages,
                       changes: list[tuple[int, bool]]) -> list[EvenBlock]:
        facts = self._facts
        blocks: list[EvenBlock] = []
        ends = [first for first, _ in changes[1:]] + [messages.consumed]
        for (first, other_rate), last in zip(changes, ends, strict=True):
            part = messages.part(first, last, look_ahead=last == messages.consumed)
            if other_rate:
                self._leave_out(part)
                continue
            facts.other_rate = False
            blocks += self._put(part, self._steps(part))
        return blocks

    def _leave_out(self, messages: _Messages) -> None:
        """Reject messages that come at another rate."""
        facts = self._facts
        n = messages.consumed
        facts.rejected += n
        if not facts.at_other_rate and n > 1 and facts.last_ns is not None:
            since = facts.elapsed_ns + int(messages.stamps[0]) - facts.last_ns
            facts.rate_changed_s = since / SECOND
            pace = measure_pace(messages.stamps[:n])
            facts.changed_rate_hz = SECOND / pace.interval_ns if pace else 0.0
        facts.at_other_rate += n
        facts.other_rate = True

    def _places(self, messages: _Messages) -> Floats:
        """Stamps in intervals from the last sample placed."""
        facts = self._facts
        interval = facts.interval_ns or 1.0
        if facts.fresh_run or facts.last_ns is None:
            since, late = messages.stamps - messages.stamps[0], interval
        else:
            since, late = messages.stamps - facts.last_ns, facts.late_ns
        places: Floats = (since.astype(np.float64) + late) / interval
        return places

    def _steps(self, messages: _Messages) -> Ints:
        facts = self._facts
        interval = facts.interval_ns or 1.0
        new_run = facts.fresh_run or facts.last_ns is None
        return count_steps(self._places(messages), Pace(interval, facts.spread, facts.counting),
                           late=0.0 if new_run else facts.late_ns / interval, new_run=new_run)

    def _rate_doubtful(self, messages: _Messages, steps: Ints) -> bool:
        c = messages.consumed
        if c < 2:
            return False
        short = steps[1:c] <= self._options.gap_tolerance + 1
        counted = int(steps[1:c][short].sum())
        passed = float(np.diff(messages.stamps[:c])[short].sum()) / (
            self._facts.interval_ns or 1.0)
        return (abs(passed - counted) > 4 + 0.003 * c
                or counted - int(np.count_nonzero(short)) > 0.25 * c)

    def _put(self, messages: _Messages, steps: Ints) -> list[EvenBlock]:
        """Put messages on the grid and bring the counts up to date."""
        facts, options = self._facts, self._options
        c, stamps, other = messages.consumed, messages.stamps, messages.other
        if not c:
            return []
        interval = facts.interval_ns or 1.0
        new_run = facts.fresh_run or facts.last_ns is None
        if new_run:
            self._begin_run(int(stamps[0]), int(other[0]), interval)
            steps[0] = 1
            self._tail = np.empty((0, 6))
        reference = int(stamps[0]) if new_run or facts.last_ns is None else facts.last_ns
        tolerated = options.gap_tolerance + 1
        known = steps[:c]
        index = facts.index + np.cumsum(known)
        missing = int(index[-1]) - facts.index - c
        elapsed = stamps[:c] - (reference - facts.elapsed_ns)
        behind = np.diff(elapsed, prepend=facts.elapsed_ns)
        breaks = np.flatnonzero(known > tolerated) if missing else np.empty(0, dtype=np.intp)
        paced_ns, paced_steps = int(elapsed[-1]) - facts.elapsed_ns, int(index[-1]) - facts.index
        if new_run:
            paced_steps -= 1
        for at in breaks.tolist():
            lasts = int(behind[at])
            paced_ns, paced_steps = paced_ns - lasts, paced_steps - int(known[at])
            facts.list_gap(int(elapsed[at]) - lasts + interval, max(lasts - interval, 0.0))
        facts.missing += missing
        if missing:
            pieces = self._pieces(messages.samples, steps, index, elapsed, c, new_run)
        else:
            pieces = [EvenPiece(messages.samples[:c], facts.index + 1, float(elapsed[0]) / SECOND,
                                new_run, _NONE)]
        lately = slice(max(c - _LATELY, 0), c)
        late = (elapsed[lately] - elapsed[-1]) / interval - (index[lately] - index[-1])
        return self._advance(messages, pieces, late, int(elapsed[-1]) - facts.elapsed_ns,
                             int(index[-1]) - facts.index, paced_ns, paced_steps)

    def _advance(self, messages: _Messages, pieces: list[EvenPiece], late: Floats,
                 passed_ns: int, places: int, paced_ns: int, paced_steps: int
                 ) -> list[EvenBlock]:
        """Bring the counts up to date; `late`: the latest stamps against the last, in places."""
        facts, c = self._facts, messages.consumed
        interval = facts.interval_ns or 1.0
        facts.samples += c
        facts.paced_ns += paced_ns
        facts.paced_steps += paced_steps
        facts.elapsed_ns += passed_ns
        facts.index += places
        facts.last_ns, facts.other_ns = int(messages.stamps[c - 1]), int(messages.other[c - 1])
        facts.late_ns = -float(np.sort(late)[len(late) // 2]) * interval
        mean = float(np.add.reduce(late)) / len(late)
        facts.jitter = sqrt(max(float(np.dot(late, late)) / len(late) - mean * mean, 0.0))
        self._tail = (messages.samples[c - NEIGHBOURS:c] if c >= NEIGHBOURS else
                      np.concatenate([self._tail, messages.samples[:c]])[-NEIGHBOURS:])
        if all((facts.present or [False])[3:]):
            some = messages.samples[:c:_SPARSE, 3:]
            facts.gravity = [a + b for a, b
                             in zip(facts.gravity, some.sum(axis=0).tolist(), strict=True)]
            facts.gravity_samples += len(some)
        if paced_steps > _LATELY and not facts.counted_only:
            lately_ns = paced_ns / paced_steps
            if abs(lately_ns / interval - 1) < 0.5 * _RATE_TOLERANCE:
                facts.interval_ns = interval + _FOLLOW * (lately_ns - interval)
        return self._without_motion(pieces, interval)

    def _begin_run(self, stamp: int, other: int, interval: float) -> None:
        """Let time go on at the first message of a run, by the clock that did not jump."""
        facts = self._facts
        facts.fresh_run, jumped = False, facts.jumped
        facts.jumped = False
        if facts.first_ns is None or facts.last_ns is None:
            facts.first_ns = stamp
            return
        passed = stamp - facts.last_ns
        if jumped or not 0 < passed < _NEVER_NS - facts.elapsed_ns:
            passed = other - facts.other_ns
            if not 0 < passed < _NEVER_NS - facts.elapsed_ns:
                passed = round(interval)
        if passed > (self._options.gap_tolerance + 1.5) * interval:
            facts.list_gap(facts.elapsed_ns + interval, passed - interval)
        facts.elapsed_ns += passed

    def _pieces(self, samples: Floats, steps: Ints, index: Ints, elapsed: Ints, c: int,
                new_run: bool) -> list[EvenPiece]:
        """Bridge short gaps, split at the others."""
        facts = self._facts
        interval = facts.interval_ns or 1.0
        tolerated = self._options.gap_tolerance + 1
        known = np.concatenate([self._tail, samples[:c + NEIGHBOURS]])
        tail = len(self._tail)
        gaps = np.flatnonzero((steps[:c] > 1) & (steps[:c] <= tolerated))
        stretch = np.zeros(len(known), dtype=np.int64)
        stretch[tail:] = np.cumsum(steps[:c + NEIGHBOURS] > tolerated)
        lengths = steps[gaps] - 1
        means = np.repeat(bridge(known, gaps + tail, stretch), lengths, axis=0)
        ends = np.cumsum(lengths)
        holes = (np.repeat(index[gaps] - ends, lengths)
                 + np.arange(int(ends[-1]) if len(ends) else 0))
        facts.bridged += len(holes)
        breaks = np.flatnonzero(steps[:c] > tolerated).tolist()
        pieces = []
        for first, last in pairwise([0, *(at for at in breaks if at > 0), c]):
            begins, end = int(index[first]), int(index[last - 1]) + 1
            if steps[first] <= tolerated:
                begins -= int(steps[first]) - 1
            rows = np.empty((end - begins, 6))
            rows[index[first:last] - begins] = samples[first:last]
            low, high = np.searchsorted(holes, begins), np.searchsorted(holes, end)
            rows[holes[low:high] - begins] = means[low:high]
            start_s = (float(elapsed[first]) - (int(index[first]) - begins) * interval) / SECOND
            pieces.append(EvenPiece(rows, begins, start_s, new_run and first == 0,
                                    holes[low:high]))
        return pieces

    def _without_motion(self, pieces: list[EvenPiece], interval: float) -> list[EvenBlock]:
        facts = self._facts
        if self._options.motion == 'keep' or facts.interval_ns is None:
            return [piece.block() for piece in pieces]
        if self._motion is None:
            self._motion = MotionDetector(interval / SECOND)
        blocks: list[EvenBlock] = []
        for piece in pieces:
            blocks += self._motion.push(piece)
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
