# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The timeline as one streaming stage, shared by the node and by recordings.

Messages are worked off in windows of a fixed number, each seen together with the messages that
follow it, so that the outcome does not depend on the blocks they came in. Three parts work one
after the other: intake decides what the messages are, placing puts them on the even grid, and the
motion detector leaves out what is not at rest.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.clock import LOOK_AHEAD, SECOND
from imu_allan.timeline.content import Content
from imu_allan.timeline.counts import Counts
from imu_allan.timeline.decision import Decision
from imu_allan.timeline.excluded import MotionSummary
from imu_allan.timeline.findings import clock_changed
from imu_allan.timeline.intake import Intake
from imu_allan.timeline.late_axes import LateAxes
from imu_allan.timeline.motion import MotionDetector
from imu_allan.timeline.options import TimelineOptions
from imu_allan.timeline.pending import Pending, Window
from imu_allan.timeline.pieces import EvenPiece, Messages
from imu_allan.timeline.placing import Cursor, Placing
from imu_allan.timeline.presence import Presence
from imu_allan.timeline.record import Record, restored, State, state_of
from imu_allan.timeline.summary import summarize, TimelineSummary
import numpy as np
from numpy.typing import NDArray

Axes = tuple[bool, ...]

_MOST_WAITING = 4
"""Detectors of other axes that are kept: with each of two sensors away in turn there are two."""
WINDOW = 4096
"""Messages seen together; the last `LOOK_AHEAD` of them are worked off with the next window."""

_DEFAULTS = TimelineOptions()


@dataclass
class _Saved(Record):
    """All that a stage remembers."""

    options: TimelineOptions
    counts: Counts
    pending: list[ImuBlock]
    decision: Decision
    content: Content
    presence: Presence
    late_axes: LateAxes
    cursor: Cursor
    tail: NDArray[np.float64]
    motion: MotionDetector | None
    waiting: list[MotionDetector]

    def check(self) -> None:
        """Refuse messages whose parts are not as many."""
        for block in self.pending:
            n = len(block)
            if (block.header_ns.shape, block.receive_ns.shape, block.samples.shape,
                    block.absent.shape) != ((n,), (n,), (n, 6), (n, 2)) or (
                    block.numbers is not None and block.numbers.shape != (n,)):
                raise ValueError('messages are missing')
        if self.tail.ndim != 2 or self.tail.shape[1] != 6:
            raise ValueError('the newest samples are not those of six axes')


class TimelineStage(Record):
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
        self._counts = Counts()
        self._intake = Intake(options, self._counts)
        self._placing = Placing(options, self._counts, self._intake.decision)
        self._motion: MotionDetector | None = None
        # Those that wait for their axes to come back.
        self._waiting: list[MotionDetector] = []

    def push(self, block: ImuBlock) -> list[EvenBlock]:
        """
        Take messages, give the even samples that are decided by now.

        Raises
        ------
        ImuAllanError
            If no clock is usable, no axis is provided, or the stated rate is not the measured one.

        """
        if not len(block):
            return []
        decision = self._intake.decision
        if block.frame_id != decision.frame_id:
            if decision.frame_id is not None:
                self._counts.reject_frame(block.frame_id, len(block))
                # The numbers are those of all messages of a publisher.
                decision.numbered = False
                return []
            decision.frame_id = block.frame_id
        self._pending.append(block)
        blocks: list[EvenBlock] = []
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
        n = len(self._pending)
        blocks = self._work_off(self._pending.take(n, n)) if n else []
        if self._motion is not None:
            rest = self._motion.flush()
            blocks += [] if self._keeps_motion else self._marked(rest)
        return blocks

    def break_run(self) -> list[EvenBlock]:
        """
        Let the next sample begin a new run, after an interruption of unknown length.

        Returns
        -------
        list of EvenBlock
            What was still held back, as by `flush`.

        Raises
        ------
        ImuAllanError
            As `push`.

        """
        blocks = self.flush()
        self._placing.cursor.fresh_run = True
        return blocks

    def to_state(self) -> State:
        """Everything needed to go on later, as a flat dict of arrays."""
        intake, placing = self._intake, self._placing
        return state_of(_Saved(
            self._options, self._counts, self._pending.joined(intake.decision.frame_id or ''),
            intake.decision, intake.content, intake.presence, intake.late_axes, placing.cursor,
            placing.tail, self._motion, self._waiting))

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
            saved = restored(_Saved, state)
            stage = cls(saved.options)
            for block in saved.pending:
                stage._pending.append(block)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ImuAllanError(f'saved timeline is damaged: {error}') from error
        intake = stage._intake = Intake(saved.options, saved.counts)
        intake.decision, intake.content = saved.decision, saved.content
        intake.presence, intake.late_axes = saved.presence, saved.late_axes
        stage._counts = saved.counts
        stage._placing = Placing(saved.options, saved.counts, saved.decision)
        stage._placing.cursor, stage._placing.tail = saved.cursor, saved.tail
        stage._motion, stage._waiting = saved.motion, saved.waiting
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
        detector = stage._motion
        motion = detector.summary if detector is not None else MotionSummary()
        intake = stage._intake
        return summarize(stage._counts, intake.decision, intake.content, intake.presence,
                         intake.late_axes, stage._placing.cursor, self._options, motion,
                         len(stage._pending),
                         [] if detector is None or self._keeps_motion else
                         detector.excursions)

    @property
    def epoch_ns(self) -> int | None:
        """Stamp of the clock in use at time zero; another one after the clock has jumped."""
        cursor = self._placing.cursor
        if cursor.last_ns is None or self._intake.decision.counted_only:
            return None
        return cursor.last_ns - cursor.elapsed_ns

    @property
    def clock(self) -> Literal['header', 'receive'] | None:
        """Stamps in use; None as long as none are chosen for good."""
        return self._intake.decision.clock

    @property
    def interval_ns(self) -> float | None:
        """Time from one sample to the next, by the clock."""
        return self._intake.decision.interval_ns

    def _work_off(self, window: Window) -> list[EvenBlock]:
        intake, placing = self._intake, self._placing
        if intake.decision.clock is not None:
            stamps, other = intake.stamps(window)
            if placing.is_even(stamps, window.consumed) and intake.is_clean(window):
                intake.count_even(window)
                return self._at_rest([placing.place_even(
                    Messages(stamps, other, window.samples, window.consumed))])
        window, repeats, flaw = intake.look(window)
        if flaw:
            intake.decision.remarks |= clock_changed(flaw, placing.cursor.elapsed_ns / SECOND)
            placing.change_clock()
        messages = intake.usable(window, repeats, placing.newest)
        if repeats.woke:
            self._counts.forget()
            self._motion, self._waiting = None, []
            intake.decision.restart = placing.cursor.fresh_run = True
        return self._at_rest(placing.place(messages))

    def _at_rest(self, pieces: Iterable[EvenPiece]) -> list[EvenBlock]:
        """Leave out motion, or only look for it; not before a window has a length."""
        blocks: list[EvenBlock] = []
        if self._intake.presence.changed:
            interval_s = self._intake.decision.pace.interval_ns / SECOND
            pieces = [part for piece in pieces for part in piece.by_axes(interval_s)]
        for piece in pieces:
            first_interval_ns = self._intake.decision.first_interval_ns
            if self._keeps_motion or first_interval_ns is None:
                blocks.append(piece.block())
            if first_interval_ns is None:
                continue
            at_rest: list[EvenBlock] = []
            if self._motion is None:
                self._motion = MotionDetector(first_interval_ns / SECOND, _axes_of(piece))
            elif self._intake.presence.changed:
                at_rest += self._judge_by(_axes_of(piece))
            at_rest += self._motion.push(piece)
            blocks += [] if self._keeps_motion else at_rest
        return self._marked(blocks)

    @property
    def _keeps_motion(self) -> bool:
        return self._options.motion == 'keep'

    def _judge_by(self, axes: Axes) -> list[EvenBlock]:
        """Go on with the detector of some axes: what it knows of rest is not that of others."""
        before = self._motion
        assert before is not None
        if axes == before.axes:
            return []
        blocks = before.flush()
        if before.knows_rest:
            self._waiting = [*self._waiting, before][-_MOST_WAITING:]
        found = next((motion for motion in self._waiting if motion.axes == axes), None)
        if found is None:
            found = MotionDetector(before.interval_s, axes)
        else:
            self._waiting = [motion for motion in self._waiting if motion is not found]
        found.follow(before)
        self._motion = found
        return blocks

    def _marked(self, blocks: list[EvenBlock]) -> list[EvenBlock]:
        """Let the first block after a restart say so."""
        if blocks and self._intake.decision.restart:
            self._intake.decision.restart = False
            blocks[0] = replace(blocks[0], restart=True)
        return blocks


def _axes_of(piece: EvenPiece) -> Axes:
    """Tell which axes a piece has."""
    return tuple(np.isfinite(piece.samples[0]).tolist())
