# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decide whether incoming messages belong to the IMU of the current run.

An IMU is recognized by its frame_id and by the rate of its messages.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.node.state_file import UnusableState
from imu_allan.state import Record
from imu_allan.timeline import TimelineSummary
from imu_allan.timeline.memory import RATE_TOLERANCE
from imu_allan.timeline.pace import measure_pace
import numpy as np

LOOK_S = 2.0
"""Messages are held back this long, until they show whether the IMU is another one. At 100 Hz
these are 200 messages, which suffice in most cases."""
LONGEST_LOOK_S = 10.0
"""Longest time to hold messages back; jitter has averaged out, so their rate is conclusive."""
FEWEST_MESSAGES = 16
"""A jitter of half an interval changes the measured rate of 16 messages by 5 %."""
_MOST_MESSAGES = 20_000
"""10 s at 2 kHz, 1.3 MB; a faster sensor is recognized by this many messages sooner."""


@dataclass
class Known(Record):
    """What is known of an IMU from its messages."""

    frame_id: str | None = None
    clock: str | None = None  # stamps that the rate is measured by
    rate_hz: float | None = None  # of messages: if the sensor is polled, above that of samples
    is_sure: bool = False  # whether `rate_hz` is final
    # GIDs of the publishers of the topic since its driver was started.
    publishers: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._recent: list[ImuBlock] = []

    def see(self, blocks: Sequence[ImuBlock]) -> None:
        """Take in messages of this IMU."""
        if self.frame_id is None:
            self.frame_id = blocks[0].frame_id
        self._recent += [block for block in blocks if block.frame_id == self.frame_id]
        # The rate of 400 messages is known to 1 %; a slow sensor takes longer for them.
        while len(self._recent) > 1 and (messages(self._recent) > _MOST_MESSAGES or (
                self.lasted_s(self._recent[1:]) > LONGEST_LOOK_S
                and messages(self._recent[1:]) > 400)):
            self._recent.pop(0)

    def learn(self, clock: str | None) -> None:
        """Take over the clock that a fit has chosen; measure the rate until it is certain."""
        if clock is None:
            return
        self.is_sure &= clock == self.clock
        self.clock = clock
        if not self.is_sure and (rate := self.measured_hz(self._recent)):
            self.rate_hz = rate
            self.is_sure = (messages(self._recent) >= _MOST_MESSAGES // 2
                            or self.lasted_s(self._recent) > 0.9 * LONGEST_LOOK_S)

    def take_over(self, summary: TimelineSummary) -> None:
        """Take over rate and clock from the timeline, which excludes messages by them."""
        timeline = summary.timeline
        # The messages of a polled sensor come faster than its samples.
        if timeline.duplicates < 0.1 * timeline.samples:
            self.clock, self.rate_hz = summary.clock, timeline.sample_rate_hz
            self.is_sure = self.rate_hz is not None

    def another(self, blocks: Sequence[ImuBlock]) -> 'Known':
        """Return what the first messages of another IMU show of it."""
        other = Known(frame_id=blocks[-1].frame_id, clock=self.clock)
        other.rate_hz = other.measured_hz(blocks) or None
        return other

    def may_be_another(self, blocks: Sequence[ImuBlock]) -> bool:
        """Return whether the next messages need a closer check; cheap in the normal case."""
        if self.frame_id is None:
            return False
        if all(block.frame_id != self.frame_id for block in blocks):
            return True
        if any(block.frame_id != self.frame_id for block in blocks) or not self.rate_hz:
            # Messages with another frame_id say nothing about the rate.
            return False
        # The measured rate of few messages varies with jitter, by so many intervals.
        for some, jitter in (blocks, 4), ([*self._recent, *blocks], 1):
            stamps = self._stamps(some)
            if len(stamps) < FEWEST_MESSAGES:
                continue
            span_s = float(stamps[-1] - stamps[0]) * 1e-9
            counted = (len(stamps) - 1) / span_s if span_s > 0 else 0.0
            allowed = RATE_TOLERANCE + jitter / len(stamps)
            if (abs(counted / self.rate_hz - 1) > allowed
                    and self._rate_difference(some) > allowed):
                return True
        return False

    def mismatch(self, blocks: Sequence[ImuBlock]) -> UnusableState | None:
        """Return why messages are not from this IMU; None if they may be."""
        frame_id = blocks[-1].frame_id
        if self.frame_id is not None and all(b.frame_id != self.frame_id for b in blocks):
            return UnusableState('frame_id', f'it is of frame_id {self.frame_id!r}, '
                                 f'the messages now have {frame_id!r}')
        if self._rate_difference(blocks) > RATE_TOLERANCE:
            return UnusableState('rate', f'it is of {self.rate_hz:.4g} Hz, the messages now '
                                 f'come at {self.measured_hz(blocks):.4g} Hz')
        return None

    def suffices(self, blocks: Sequence[ImuBlock], seconds: float) -> bool:
        """Return whether there are enough messages to decide if they are from this IMU."""
        count, lasted = messages(blocks), self.lasted_s(blocks)
        if count >= _MOST_MESSAGES:
            return True
        if count < FEWEST_MESSAGES or lasted < seconds:
            return False
        # A small difference may be random, or hide a real one; jitter does not cause 30 %.
        by_chance = 0.4 * RATE_TOLERANCE < self._rate_difference(blocks) < 0.3
        return lasted >= LONGEST_LOOK_S or not by_chance

    def lasted_s(self, blocks: Sequence[ImuBlock]) -> float:
        """Return the seconds that messages span by stamps or by receive times, the longer one."""
        return max(float(last - first) * 1e-9 for first, last in (
            (blocks[0].receive_ns[0], blocks[-1].receive_ns[-1]),
            (self._stamps(blocks[:1])[0], self._stamps(blocks[-1:])[-1])))

    def measured_hz(self, blocks: Sequence[ImuBlock]) -> float:
        """Return the rate of messages by the clock; 0 if there are too few."""
        # A repeated message counts once.
        stamps = np.unique(self._stamps(blocks)) if blocks else np.empty(0, np.int64)
        pace = measure_pace(stamps) if len(stamps) >= FEWEST_MESSAGES else None
        return 1e9 / pace.interval_ns if pace is not None and pace.interval_ns > 0 else 0.0

    def _rate_difference(self, blocks: Sequence[ImuBlock]) -> float:
        measured = self.measured_hz(blocks) if self.rate_hz else 0.0
        # Compares intervals, as the timeline does.
        return abs(self.rate_hz / measured - 1) if measured and self.rate_hz else 0.0

    def _stamps(self, blocks: Sequence[ImuBlock]) -> Ints:
        return np.concatenate([block.receive_ns if self.clock == 'receive' else block.header_ns
                               for block in blocks])


def messages(blocks: Sequence[ImuBlock]) -> int:
    """Return the number of messages."""
    return sum(len(block) for block in blocks)


def in_parts(blocks: Sequence[ImuBlock], most: int) -> Iterator[list[ImuBlock]]:
    """Yield messages in parts of `most`, the last of which may be smaller."""
    part: list[ImuBlock] = []
    for block in blocks:
        first = 0
        while first < len(block):
            last = first + most - messages(part)
            part.append(block.part(slice(first, last)))
            first = last
            if messages(part) == most:
                yield part
                part = []
    if part:
        yield part
