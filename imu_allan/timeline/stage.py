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
from dataclasses import replace
from typing import Any, Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.state import Record, restored, State, state_of
from imu_allan.timeline.clock import LOOK_AHEAD, SECOND
from imu_allan.timeline.intake import Intake
from imu_allan.timeline.memory import Memory
from imu_allan.timeline.messages import EvenPiece, Messages, NONE_VOID, Pending, Window
from imu_allan.timeline.motion import MotionDetector
from imu_allan.timeline.options import TimelineOptions
from imu_allan.timeline.placing import Placing
from imu_allan.timeline.summary import summarize, TimelineSummary
import numpy as np
from numpy.typing import NDArray

Axes = tuple[bool, ...]

WINDOW = 4096
"""Messages seen together; the last `LOOK_AHEAD` of them are worked off with the next window."""

_DEFAULTS = TimelineOptions()


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
        self._pending = Pending()
        self._use(Memory(options))

    def _use(self, memory: Memory) -> None:
        self._memory = memory
        self._intake, self._placing = Intake(memory), Placing(memory)

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
                self._memory.counts.reject_frame(block.frame_id, len(block))
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
        if self._memory.motion is not None:
            rest = self._memory.motion.flush()
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
        memory = self._memory
        return state_of(replace(memory, blocks=self._pending.joined()))

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
            memory = restored(Memory, state)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ImuAllanError(f'saved timeline is damaged: {error}') from error
        stage = cls()
        for block in memory.blocks:
            stage._pending.append(block)
        memory.blocks = []
        stage._use(memory)
        return stage

    def summary(self) -> TimelineSummary:
        """Tell what was seen of every message so far, those still held back included."""
        stage = self
        if self._pending or (self._memory.motion is not None and self._memory.motion.holds_back):
            stage = self.copy()
            try:
                stage.flush()
            except ImuAllanError:
                stage = self
        return summarize(stage._memory, len(stage._pending))

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
        decision = self._intake.decision
        return None if decision.first_interval_ns is None else decision.pace.interval_ns

    def _work_off(self, window: Window) -> list[EvenBlock]:
        intake, placing = self._intake, self._placing
        if intake.decision.clock is not None:
            stamps, other = intake.stamps(window)
            if placing.is_even(stamps, window.consumed) and intake.is_clean(window):
                intake.count_even(window)
                return self._at_rest([placing.place_even(
                    Messages(stamps, other, window.samples, window.consumed, NONE_VOID))])
        return self._at_rest(placing.place(intake.usable(window)))

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
            if self._memory.motion is None:
                self._memory.motion = MotionDetector(first_interval_ns / SECOND, _axes_of(piece))
            elif self._memory.motion.axes != _axes_of(piece):
                # What is known of the rest of some axes is not that of others.
                at_rest += self._memory.motion.flush()
                self._memory.motion = self._memory.motion.of_axes(_axes_of(piece))
            at_rest += self._memory.motion.push(piece)
            blocks += [] if self._keeps_motion else at_rest
        return self._marked(blocks)

    @property
    def _keeps_motion(self) -> bool:
        return self._memory.options.motion == 'keep'

    def _marked(self, blocks: list[EvenBlock]) -> list[EvenBlock]:
        """Let the first block after a restart say so."""
        if blocks and self._intake.decision.restart:
            self._intake.decision.restart = False
            blocks[0] = replace(blocks[0], restart=True)
        return blocks


def _axes_of(piece: EvenPiece) -> Axes:
    """Tell which axes a piece has."""
    return tuple(np.isfinite(piece.samples[0]).tolist())
