# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The timeline as one streaming stage, shared by the node and by recordings.

Messages are processed in windows of a fixed number, each seen together with the messages that
follow. The outcome therefore does not depend on the blocks they came in. Three parts work one
after the other on the memory that the stage is. Intake chooses the usable messages, placing puts
them on the even grid, and the motion detector leaves out what is not at rest.
"""

from collections.abc import Iterable
from typing import Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.timeline.intake import usable
from imu_allan.timeline.memory import Decision, Memory, Window
from imu_allan.timeline.motion import MotionDetector
from imu_allan.timeline.placing import place
from imu_allan.timeline.stamps import SECOND
from imu_allan.timeline.summary import summarize, TimelineSummary
import numpy as np


class TimelineStage(Memory):
    """
    Converter of messages, in order of arrival, to even samples, in constant memory.

    Parameters
    ----------
    options : TimelineOptions
        Options set by the user.

    `push` returns what is decided, up to some thousand messages late; `flush` returns the rest. To
    look at a running stream, flush a `copy`. An ImuAllanError says that no clock is usable, that
    no axis is provided, or that the stated rate is not the measured one.

    """

    def push(self, block: ImuBlock) -> list[EvenBlock]:
        """Take messages, and return the even samples that are decided by now."""
        if not len(block):
            return []
        if block.frame_id != self.decision.frame_id:
            if self.decision.frame_id is not None:
                self.counts.reject_frame(block.frame_id, len(block))
                return []
            self.decision.frame_id = block.frame_id
        self.pending.append(block)
        blocks: list[EvenBlock] = []
        # 64 later messages must be seen before a message is accepted or rejected: the last of a
        # window are processed in the next one.
        look_ahead = 64
        while self.pending.messages >= (window := self._window):
            if not self._leave_out_start(window):
                blocks += self._process(self.pending.take(window, window - look_ahead))
        return blocks

    def flush(self) -> list[EvenBlock]:
        """Return what is still held back, at the end of a recording."""
        self._leave_out_start(self.pending.messages)
        n = self.pending.messages
        blocks = self._process(self.pending.take(n, n)) if n else []
        if self.motion is not None:
            rest = self.motion.flush()
            blocks += [] if self._keeps_motion else rest
        return blocks

    def break_run(self) -> list[EvenBlock]:
        """Begin a run with the next sample, after an unknown time; return what was held back."""
        blocks = self.flush()
        self.cursor.fresh_run = True
        return blocks

    def power_on(self) -> list[EvenBlock]:
        """Begin a run with the next sample, whose mean may differ; return as `break_run` does."""
        blocks = self.break_run()
        if self.motion is not None:
            self.motion.forget_means()
        return blocks

    def summary(self) -> TimelineSummary:
        """Summarize all messages so far, including those still held back."""
        stage = self.copy()
        try:
            stage.flush()
        except ImuAllanError:
            stage = self
        return summarize(stage)

    @property
    def epoch_ns(self) -> int | None:
        """Stamp of the clock in use at time zero; it changes if the clock jumps."""
        cursor = self.cursor
        if cursor.first_ns is None or self.decision.counted_only:
            return None
        return cursor.last_ns - cursor.elapsed_ns

    @property
    def clock(self) -> Literal['header', 'receive'] | None:
        """Clock whose stamps are used; None until it is finally chosen."""
        return self.decision.clock

    @property
    def at_other_rate(self) -> bool:
        """Whether the latest messages are left out because they come at another rate."""
        return self.cursor.other_rate

    @property
    def left_out_s(self) -> float:
        """Duration in s of all messages left out because they came at another rate."""
        return self.counts.at_other_rate * (self.interval_ns or 0.0) / SECOND

    @property
    def interval_ns(self) -> float | None:
        """Sample interval by the clock in use; None until it is measured."""
        decision = self.decision
        return None if decision.first_interval_ns is None else decision.pace.interval_ns

    @property
    def _window(self) -> int:
        """Messages that are processed at once: 20 s of them, from 4,096 to 16,384."""
        interval_ns = self.decision.first_interval_ns
        if interval_ns is None or 8192 * interval_ns > 20 * SECOND:
            return 4096
        return 8192 if 16_384 * interval_ns > 20 * SECOND else 16_384

    def _leave_out_start(self, most: int) -> int:
        """Drop the messages without any value before the first of `most` that has one."""
        # A driver may send them before it measures. Clock and pace need a whole window after them.
        if self.decision.clock is not None or not most:
            return 0
        window = self.pending.take(most, 0)
        there = np.isfinite(window.samples) & ~np.repeat(window.absent, 3, axis=1)
        first = int(np.argmax(there.any(axis=1)))
        if first:
            self.pending.take(first, first)
            self.counts.messages += first
            self.counts.rejected += first
        return first

    def _process(self, window: Window) -> list[EvenBlock]:
        try:
            return self._at_rest(place(self, usable(self, window)))
        except ImuAllanError:
            # No clock is chosen yet: the next messages may be usable.
            decision = self.decision
            decision.clock, decision.pace, decision.first_interval_ns = None, Decision.pace, None
            raise

    def _at_rest(self, blocks: Iterable[EvenBlock]) -> list[EvenBlock]:
        """Leave out motion, or only detect it; pass blocks on until an interval is known."""
        given: list[EvenBlock] = []
        for block in blocks:
            at_rest = [block]
            if self.decision.first_interval_ns is not None:
                self.motion = self.motion or MotionDetector(
                    self.decision.first_interval_ns / SECOND)
                at_rest = self.motion.push(block)
            given += [block] if self._keeps_motion else at_rest
        return given

    @property
    def _keeps_motion(self) -> bool:
        return self.options.motion == 'keep'
