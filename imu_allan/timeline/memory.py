# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""All that a timeline remembers; its parts work on one memory, which is what is saved."""

from dataclasses import dataclass, field

from imu_allan.block import ImuBlock
from imu_allan.state import Record
from imu_allan.timeline.alive import Content, LateAxes, Presence
from imu_allan.timeline.counts import Counts
from imu_allan.timeline.decision import Decision
from imu_allan.timeline.motion import MotionDetector
from imu_allan.timeline.options import TimelineOptions
import numpy as np
from numpy.typing import NDArray


@dataclass
class Cursor(Record):
    """
    Where on the grid a timeline stands.

    Attributes
    ----------
    first_ns, last_ns : int or None
        Stamps of the first sample placed and of the last.
    other_ns : int
        The last one's stamp of the other clock.
    late_ns : float
        How far the last stamp lies behind its place.
    jitter : float or None
        Standard deviation of the latest stamps about their places, in intervals.
    tied_to : int or None, ties : int
        Last receive stamp, and how many messages before shared it.
    index : int
        Place of the last sample.
    elapsed_ns : int
        Time since the first sample, which goes on where the clock jumps.
    fresh_run, jumped : bool
        The next sample begins a new run; because the clock jumped.
    other_rate : bool
        The messages come at another rate than the first ones.
    number : int or None
        Publication number of the last message, where it tells how many were lost behind it.

    """

    first_ns: int | None = None
    last_ns: int | None = None
    other_ns: int = 0
    late_ns: float = 0.0
    jitter: float | None = None
    tied_to: int | None = None
    ties: int = 0
    index: int = -1
    elapsed_ns: int = 0
    fresh_run: bool = False
    jumped: bool = False
    other_rate: bool = False
    number: int | None = None

    @property
    def begins(self) -> bool:
        """Whether the next sample is the first of its run."""
        return self.fresh_run or self.last_ns is None


@dataclass
class Memory(Record):
    """
    All that a timeline remembers but messages that wait.

    Attributes
    ----------
    tail : ndarray, shape (t, 6)
        The last samples placed in this run.
    motion : MotionDetector or None
        None before the first sample.
    waiting : list of MotionDetector
        Those that wait for their axes to come back.
    blocks : list of ImuBlock
        Messages that wait, where they are saved.

    """

    options: TimelineOptions
    counts: Counts = field(default_factory=Counts)
    decision: Decision = field(default_factory=Decision)
    content: Content = field(default_factory=Content)
    presence: Presence = field(default_factory=Presence)
    late_axes: LateAxes = field(default_factory=LateAxes)
    cursor: Cursor = field(default_factory=Cursor)
    tail: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 6)))
    motion: MotionDetector | None = None
    waiting: list[MotionDetector] = field(default_factory=list)
    blocks: list[ImuBlock] = field(default_factory=list)

    @property
    def excursions(self) -> list[list[float]]:
        """Slow turns that were not cut out, where motion is not to be kept."""
        return ([] if self.motion is None or self.options.motion == 'keep'
                else self.motion.excursions)

    def check(self) -> None:
        """Refuse messages whose parts are not as many."""
        for block in self.blocks:
            n = len(block)
            if (block.header_ns.shape, block.receive_ns.shape, block.samples.shape,
                    block.absent.shape) != ((n,), (n,), (n, 6), (n, 2)) or (
                    block.numbers is not None and block.numbers.shape != (n,)):
                raise ValueError('messages are missing')
