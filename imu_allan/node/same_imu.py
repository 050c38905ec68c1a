# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether messages are those of the IMU that a run is about, or have come before.

An IMU is known by its frame_id, by the rate of its messages and, where another publisher sends
them, by the level of its noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import UnusableState
from imu_allan.recordings.same_recording import is_kept
from imu_allan.result import Source
from imu_allan.state import Record
from imu_allan.timeline.options import RATE_TOLERANCE
from imu_allan.timeline.pace import measure_pace
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LOOK_S = 2.0
"""At 100 Hz 200 messages, which show another IMU in most cases; all of them wait so long."""
LONGEST_LOOK_S = 10.0
"""Jitter has averaged out by then: the rate counts as it is."""
FEWEST_MESSAGES = 16
"""A jitter of half an interval moves the rate of 16 messages by 5 %."""
_MOST_MESSAGES = 20_000
"""10 s at 2 kHz, 1.3 MB; a faster sensor is recognized by as many messages sooner."""
_GROUP = 64
"""Samples whose level is one number."""
_FEWEST_GROUPS = 4
"""Fewer do not show how much they scatter. A judgment."""
LEVEL_MESSAGES = _FEWEST_GROUPS * _GROUP + 1
"""Fewer show no level."""
_FIRST = 8
"""Samples that are remembered from the start: a repetition is seen at once."""
_MOST = 2048
"""Samples that are remembered in all, 110 kB, chosen by their stamps: of a repetition whose start
got lost one of the next few is among them, a hundred of a day at 100 Hz thousands later."""
_SHORTEST_NS = 1_000_000_000
"""A recording is longer; stamps that stand still are another fault."""


@dataclass
class Known(Record):
    """What is known of an IMU by its messages."""

    frame_id: str | None = None
    clock: str | None = None  # by whose stamps the rate is measured
    rate_hz: float | None = None  # of messages: of a sensor that is polled more than of samples
    is_sure: bool = False  # about the rate
    levels: Floats = field(default_factory=lambda: np.empty((0, 6)))
    # Identities of who has published the topic since its driver was started.
    publishers: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._recent: list[ImuBlock] = []

    def see(self, blocks: Sequence[ImuBlock]) -> None:
        """Take in messages that are of this IMU."""
        if self.frame_id is None:
            self.frame_id = blocks[0].frame_id
        own = [block for block in blocks if block.frame_id == self.frame_id]
        if own:
            # Of 20 s at 200 Hz.
            self.levels = np.concatenate([self.levels, _levels(own)])[-64:]
            self._recent += own
        while len(self._recent) > 1 and (messages(self._recent) > _MOST_MESSAGES
                                         or self.lasted_s(self._recent[1:]) > LONGEST_LOOK_S):
            self._recent.pop(0)

    def learn(self, source: Source) -> None:
        """Take from a result by which stamps, and measure the rate until that is sure."""
        if source.clock is None:
            return
        if source.clock != self.clock:
            self.is_sure = False
        self.clock = source.clock
        if not self.is_sure and (rate := self.measured_hz(self._recent)):
            self.rate_hz = rate
            self.is_sure = (messages(self._recent) >= _MOST_MESSAGES // 2
                            or self.lasted_s(self._recent) > 0.9 * LONGEST_LOOK_S)

    def another(self, blocks: Sequence[ImuBlock]) -> 'Known':
        """Learn another IMU by its first messages."""
        other = Known(frame_id=blocks[-1].frame_id, clock=self.clock)
        other.rate_hz = other.measured_hz(blocks) or None
        return other

    def may_be_another(self, blocks: Sequence[ImuBlock]) -> bool:
        """Return, cheaply where nothing is wrong, whether the next messages want a look."""
        if self.frame_id is None or not blocks:
            return False
        if all(block.frame_id != self.frame_id for block in blocks):
            return True
        if any(block.frame_id != self.frame_id for block in blocks) or not self.rate_hz:
            # What is of the other frame_id says nothing about the rate.
            return False
        for some in (blocks, [*self._recent, *blocks]):
            stamps = self._stamps(some)
            if len(stamps) < FEWEST_MESSAGES:
                continue
            span_s = float(stamps[-1] - stamps[0]) * 1e-9
            counted = (len(stamps) - 1) / span_s if span_s > 0 else 0.0
            # Of few messages jitter moves the rate.
            allowed = RATE_TOLERANCE + 4 / len(stamps)
            if (abs(counted / self.rate_hz - 1) > allowed
                    and self._rate_difference(some) > allowed):
                return True
        return False

    def departure(self, blocks: Sequence[ImuBlock], *, by_level: bool) -> UnusableState | None:
        """Return why messages are not of this IMU; None if they may be."""
        frame_id = blocks[-1].frame_id
        if self.frame_id is not None and all(b.frame_id != self.frame_id for b in blocks):
            return UnusableState('frame_id', f'it is of frame_id {self.frame_id!r}, '
                                 f'the messages now have {frame_id!r}')
        if self._rate_difference(blocks) > RATE_TOLERANCE:
            return UnusableState('rate', f'it is of {self.rate_hz:.4g} Hz, the messages now '
                                 f'come at {self.measured_hz(blocks):.4g} Hz')
        ratio = self._level_ratio(blocks, 5.0) if by_level else None
        if ratio is not None:
            return UnusableState('noise', 'another publisher sends messages whose noise is '
                                 f'{ratio:.2f} times as large, as another sensor would')
        return None

    def suffices(self, blocks: Sequence[ImuBlock], seconds: float, *, by_level: bool,
                 fewest: int = FEWEST_MESSAGES) -> bool:
        """Whether so many messages decide if they are of this IMU."""
        count, lasted = messages(blocks), self.lasted_s(blocks)
        if count >= _MOST_MESSAGES:
            return True
        if count < FEWEST_MESSAGES or lasted < seconds:
            return False
        # Chance may have made a difference, or hidden one; jitter makes none of three tenths.
        by_chance = 0.4 * RATE_TOLERANCE < self._rate_difference(blocks) < 0.3 or (
            by_level and self._level_ratio(blocks, 2.0) is not None)
        return lasted >= LONGEST_LOOK_S or (count >= fewest and not by_chance)

    def lasted_s(self, blocks: Sequence[ImuBlock]) -> float:
        """Time that messages span, by their stamps or their receipt."""
        if not blocks:
            return 0.0
        return max(float(last - first) * 1e-9 for first, last in (
            (blocks[0].receive_ns[0], blocks[-1].receive_ns[-1]),
            (self._stamps(blocks[:1])[0], self._stamps(blocks[-1:])[-1])))

    def measured_hz(self, blocks: Sequence[ImuBlock]) -> float:
        """Rate of messages by the clock; 0 where there are too few."""
        # A message that comes twice is one.
        stamps = np.unique(self._stamps(blocks)) if blocks else np.empty(0, np.int64)
        pace = measure_pace(stamps) if len(stamps) >= FEWEST_MESSAGES else None
        return 1e9 / pace.interval_ns if pace is not None and pace.interval_ns > 0 else 0.0

    def _rate_difference(self, blocks: Sequence[ImuBlock]) -> float:
        measured = self.measured_hz(blocks) if self.rate_hz else 0.0
        return abs(measured / self.rate_hz - 1) if measured and self.rate_hz else 0.0

    def _level_ratio(self, blocks: Sequence[ImuBlock], sure: float) -> float | None:
        """Ratio of the noise to that known, where they differ by so many standard errors."""
        found: float | None = None
        for axis, groups in enumerate(_levels(blocks).T):
            before, error_before = _level_at_rest(self.levels[:, axis])
            now, error_now = _level_at_rest(groups)
            apart = abs(now - before)
            # The noise of one sensor differs by a tenth from one day to another. A judgment.
            if (before > 0 and apart > 0.1 * before
                    and apart > sure * np.hypot(error_before, error_now)
                    and (found is None or apart > abs(found - 1) * before)):
                found = now / before
        return found

    def _stamps(self, blocks: Sequence[ImuBlock]) -> NDArray[np.int64]:
        return np.concatenate([block.receive_ns if self.clock == 'receive' else block.header_ns
                               for block in blocks])


@dataclass
class Seen(Record):
    """
    Samples that have come, so that a recording that is played in a loop counts once.

    The same samples twice would make intervals narrower than the data allow.
    """

    stamps: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    samples: Floats = field(default_factory=lambda: np.empty((0, 6)))
    bits: int = 0  # that the stamps of those that are remembered have in common
    last_ns: int = 0

    def __post_init__(self) -> None:
        # Whether the samples that come now have come before.
        self.looping = False

    def check(self) -> None:
        """Raise ValueError where they do not belong together."""
        if (len(self.samples) != len(self.stamps) or len(self.stamps) > _MOST
                or not 0 <= self.bits < 64 or self.last_ns < 0):
            raise ValueError('what is remembered of earlier samples is damaged')

    def unseen(self, blocks: Sequence[ImuBlock]) -> list[ImuBlock]:
        """Give the samples of these blocks that are no repetition."""
        passed = []
        # A short recording that is played fast may begin several times in one block.
        for block in (part for whole in blocks for part in _passes(whole)):
            again = 0 if self.looping else self._begins_again(block)
            if again is not None:
                new = block.header_ns > self.last_ns
                self.looping = not new.any()
                # Of a recording that was joined in the middle, its beginning is new once.
                new[:again] = True
                block = block.part(new)
            if len(block):
                self._remember(block)
                self.last_ns = max(self.last_ns, int(block.header_ns.max()))
                passed.append(block)
        return passed

    def _remember(self, block: ImuBlock) -> None:
        fresh = block.header_ns > self.last_ns
        kept = fresh & is_kept(block.header_ns, self.bits)
        kept |= fresh & (np.cumsum(fresh) + len(self.stamps) <= _FIRST)
        if not kept.any():
            return
        self.stamps = np.append(self.stamps, block.header_ns[kept])
        self.samples = np.concatenate([self.samples, block.samples[kept]])
        while len(self.stamps) > _MOST:
            self.bits += 1
            kept = is_kept(self.stamps, self.bits)
            kept[:_FIRST] = True
            self.stamps, self.samples = self.stamps[kept], self.samples[kept]

    def _begins_again(self, block: ImuBlock) -> int | None:
        """Row of the first sample that has come before, None if there is none."""
        if not len(self.stamps) or self.last_ns - int(self.stamps[0]) < _SHORTEST_NS:
            return None
        back = block.header_ns < self.last_ns
        if not back.any():
            return None
        for row in np.flatnonzero(back & np.isin(block.header_ns, self.stamps)).tolist():
            same = self.samples[self.stamps == block.header_ns[row]]
            # An axis that is absent is NaN, which equals nothing.
            if any(np.array_equal(sample, block.samples[row], equal_nan=True) for sample in same):
                return int(row)
        return None


def _passes(block: ImuBlock) -> Iterator[ImuBlock]:
    """Divide messages where their stamps fall back by as much as a recording is long at least."""
    falls = np.flatnonzero(np.diff(block.header_ns) < -_SHORTEST_NS) + 1
    if len(falls) > 1 + len(block) // FEWEST_MESSAGES:
        # No recording is so short: stamps of two clocks come in turn.
        falls = falls[:0]
    for first, last in pairwise([0, *falls.tolist(), len(block)]):
        yield block.part(slice(first, last))


def messages(blocks: Sequence[ImuBlock]) -> int:
    """How many messages there are."""
    return sum(len(block) for block in blocks)


def in_parts(blocks: Sequence[ImuBlock], most: int) -> Iterator[list[ImuBlock]]:
    """Give messages in parts of so many, the last of which may be smaller."""
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


def _levels(blocks: Sequence[ImuBlock]) -> Floats:
    """Mean step from one sample to the next, of every axis in groups of 64, shape (g, 6)."""
    samples = np.concatenate([block.samples for block in blocks])
    with np.errstate(over='ignore', invalid='ignore'):
        steps = np.abs(np.diff(samples, axis=0))
        whole = len(steps) // _GROUP * _GROUP
        return np.asarray(steps[:whole].reshape(-1, _GROUP, 6).mean(axis=1))


def _level_at_rest(groups: Floats) -> tuple[float, float]:
    """Mean of the levels at rest and its standard error; infinite where they are too few."""
    groups = groups[np.isfinite(groups) & (groups > 0)]
    if len(groups) < _FEWEST_GROUPS:
        return 0.0, np.inf
    # Louder ones are of a sensor that is moved, or knocked.
    calm = groups[groups < 1.5 * np.percentile(groups, 10)]
    # Chance moves the level of 64 samples by a tenth; few may be close to each other by chance.
    spread = max(calm.std(), 0.1 * calm.mean())
    return float(calm.mean()), float(spread / np.sqrt(max(len(calm) - 1, 1)))
