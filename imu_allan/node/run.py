# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
One run: everything that a new run starts afresh, and that is resumed after a crash.

It remembers its IMU, which is recognized by its frame_id and by the rate of its messages.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
import secrets
from typing import Any, NamedTuple

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import IMU_TYPE
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.node.shown_terms import ShownTerms
from imu_allan.node.standards import DatasheetLooks
from imu_allan.recordings.repeated_messages import Seen
from imu_allan.result import Result
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.state import Record, restored, State, state_of
from imu_allan.timeline import TimelineOptions, TimelineSummary
from imu_allan.timeline.memory import RATE_TOLERANCE
from imu_allan.timeline.pace import measure_pace, Pace, spread_about
import numpy as np
from numpy.typing import NDArray

LOOK_S = 2.0
"""Messages are held back this long, until they show whether the IMU is another one. At 100 Hz
these are 200 messages, which suffice in most cases."""
LONGEST_LOOK_S = 10.0
"""Longest time to hold messages back; jitter has averaged out, so their rate is conclusive."""
FEWEST_MESSAGES = 16
"""A jitter of half an interval changes the measured rate of 16 messages by 5 %."""
_NO_GRID, _MOSTLY = 0.3, 0.7
"""Uneven stamps are of the known rate if they scatter less than this about its grid, in intervals,
and fill this share of it. Unrelated stamps scatter by .33; those of half the rate fill half."""
_MOST_MESSAGES = 20_000
"""10 s at 2 kHz, 1.3 MB; a faster sensor is recognized by this many messages sooner."""
BOOT_ID = Path('/proc/sys/kernel/random/boot_id')


class UnusableState(Exception):
    """A state file that cannot be resumed from."""

    def __init__(self, reason: str, explanation: str) -> None:
        super().__init__(explanation)
        self.reason = reason


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
        while (later := self._recent[1:]) and (messages(self._recent) > _MOST_MESSAGES or (
                self.lasted_s(later) > LONGEST_LOOK_S and messages(later) > 400)):
            self._recent = later

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
        return Known(blocks[-1].frame_id, self.clock, self.measured_hz(blocks))

    def parts(self, blocks: Sequence[ImuBlock]) -> Iterator[list[ImuBlock]]:
        """Yield messages in parts to judge in turn, or together if their rate is unknown."""
        most = max(round(LOOK_S * self.rate_hz), FEWEST_MESSAGES) if self.rate_hz else inf
        part: list[ImuBlock] = []
        for block in blocks:
            while len(block):
                room = min(most - messages(part), len(block))
                part.append(block.part(slice(room)))
                block = block.part(slice(room, None))
                if messages(part) == most:
                    yield part
                    part = []
        if part:
            yield part

    def may_be_another(self, blocks: Sequence[ImuBlock]) -> bool:
        """Return whether the next messages need a closer check; cheap in the normal case."""
        if self._has_another_frame(blocks):
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
        if self._has_another_frame(blocks):
            return UnusableState('frame_id', f'it is of frame_id {self.frame_id!r}, '
                                 f'the messages now have {blocks[-1].frame_id!r}')
        if self._rate_difference(blocks) > RATE_TOLERANCE:
            return UnusableState('rate', f'it is of {self.rate_hz:.4g} Hz, the messages now '
                                 f'come at {self.measured_hz(blocks):.4g} Hz')
        return None

    def _has_another_frame(self, blocks: Sequence[ImuBlock]) -> bool:
        """Return whether no message has the frame_id of this IMU, if that is known."""
        return self.frame_id is not None and all(b.frame_id != self.frame_id for b in blocks)

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

    def measured_hz(self, blocks: Sequence[ImuBlock]) -> float | None:
        """Return the rate of messages by the clock; None if there are too few."""
        _, pace = self._paced(blocks)
        return None if pace is None else 1e9 / pace.interval_ns

    def _paced(self, blocks: Sequence[ImuBlock]) -> tuple[Ints, Pace | None]:
        """Return the stamps in order, repeated ones once, and their pace unless they are few."""
        stamps = np.unique(self._stamps(blocks)) if blocks else np.empty(0, np.int64)
        pace = measure_pace(stamps) if len(stamps) >= FEWEST_MESSAGES else None
        return stamps, pace if pace is not None and pace.interval_ns > 0 else None

    def _rate_difference(self, blocks: Sequence[ImuBlock]) -> float:
        if not self.rate_hz:
            return 0.0
        stamps, pace = self._paced(blocks)
        if pace is None:
            return 0.0
        # Compares intervals, as the timeline does.
        interval_ns = 1e9 / self.rate_hz
        ratio = pace.interval_ns / interval_ns
        if pace.counting or ratio < 0.75:
            # Of uneven stamps, messages are counted though some are lost, or a finer grid fits.
            filled = len(stamps) * interval_ns / float(stamps[-1] - stamps[0])
            if filled > _MOSTLY and spread_about(stamps, interval_ns) < _NO_GRID:
                return 0.0
        return abs(ratio - 1)

    def _stamps(self, blocks: Sequence[ImuBlock]) -> Ints:
        return np.concatenate([block.receive_ns if self.clock == 'receive' else block.header_ns
                               for block in blocks])


def messages(blocks: Sequence[ImuBlock]) -> int:
    """Return the number of messages."""
    return sum(len(block) for block in blocks)


class LaneSnapshot(NamedTuple):
    """Everything that a lane has taken in up to a moment."""

    characterization: Characterization
    remarks: Sequence[Finding]

    def finish(self) -> str:
        """Take in what the timeline holds back; return why it cannot be used, if so."""
        try:
            self.characterization.finish()
        except ImuAllanError as error:
            # The next samples may be usable.
            return useless(error, self.characterization)
        return ''


@dataclass(eq=False)
class Lane:
    """What a run takes in from one topic; the fields are what is saved of it."""

    characterization: Characterization
    known: Known = field(default_factory=Known)
    seen: Seen = field(default_factory=Seen)
    in_g: bool | None = None  # the unit of its acceleration, as decided when it was saved

    def __post_init__(self) -> None:
        self.unit = AccelerationUnit(self.in_g)
        self.fed = 0  # messages it has been given
        self.stamp_ns = 0  # of the last message
        self.error = ''  # why the latest messages cannot be used
        self._taken_s = 0.0  # `left_out_s` of the timeline when it last took messages

    @property
    def leaves_out_all(self) -> bool:
        """Return whether the timeline has excluded all messages for their rate for long enough."""
        return (self.characterization.timeline.at_other_rate
                and self.characterization.timeline.left_out_s - self._taken_s > LONGEST_LOOK_S)

    @property
    def span_s(self) -> float:
        """Duration of its samples in s; 0 if their rate is unknown."""
        timeline = self.characterization.summary().timeline
        return timeline.samples / (timeline.sample_rate_hz or inf)

    def snapshot(self) -> LaneSnapshot:
        """Return an independent copy that includes the messages whose unit is still undecided."""
        copy = self.characterization.snapshot()
        for block in self.unit.waiting:
            self._pass_on(block, copy)
        return LaneSnapshot(copy, self.unit.remarks)

    def power_on(self) -> None:
        """Start a new power cycle, whose mean is separate from that of earlier samples."""
        # The new publisher need not repeat earlier messages.
        self.seen.looping = False
        try:
            self.characterization.power_on()
        except ImuAllanError as error:
            self.error = str(error)

    def update(self, blocks: Sequence[ImuBlock]) -> None:
        """Take in messages; `error` says why some of them cannot be used."""
        self.known.see(blocks)
        blocks = list(self.seen.unseen(blocks))
        if blocks:
            self.error = ''
        for block in blocks:
            self.fed += len(block)
            self.stamp_ns = int(block.header_ns[-1] or block.receive_ns[-1])
            for known in self.unit(block):
                self._pass_on(known, self.characterization)
        if not self.characterization.timeline.at_other_rate:
            self._taken_s = self.characterization.timeline.left_out_s
        elif self.leaves_out_all:
            # The rate may have changed before it was known, or by barely more than allowed.
            self.known.take_over(self.characterization.summary())

    def _pass_on(self, block: ImuBlock, to: Characterization) -> None:
        try:
            to.update(block)
        except ImuAllanError as error:
            self.error = useless(error, self.characterization)


@dataclass(eq=False)
class Run:
    """
    One lane, or one for the gyroscope and one for the accelerometer.

    The fields are what is saved of it. The thread that fits updates `looks` and
    `datasheet_looks`.
    """

    lanes: list[Lane]
    looks: ShownTerms = field(default_factory=ShownTerms)  # terms shown so far
    # Makes its folder unique: another node may have begun with the same sample.
    mark: str = field(default_factory=lambda: secrets.token_hex(2))

    def __post_init__(self) -> None:
        self.datasheet_looks = DatasheetLooks()
        self.fitted = 0  # messages in the last fit
        self.checkpointed = 0  # messages in the last checkpoint
        self.saved: Result | None = None  # what the files that were last written show
        self.resumed = False  # whether it has samples from before the node was started
        self.over = False  # whether another run has replaced it

    @property
    def fed(self) -> int:
        """Return the number of messages it has been given."""
        return sum(lane.fed for lane in self.lanes)

    @property
    def stamp_ns(self) -> int:
        """Return the stamp of the last message."""
        return max(lane.stamp_ns for lane in self.lanes)

    @property
    def span_s(self) -> float:
        """Duration of its samples in s."""
        return max(lane.span_s for lane in self.lanes)

    def snapshot(self) -> list[LaneSnapshot]:
        """Return an independent copy that another thread can fit."""
        return [lane.snapshot() for lane in self.lanes]


def useless(error: ImuAllanError, of: Characterization) -> str:
    """Return why messages cannot be used, with the remedies of a node, not of a command."""
    reason = str(error).replace(' or state the sample rate (analyze --rate)', '')
    return f'{of.topic}: {reason.replace("analyze --clock", "parameter clock")}'


@dataclass(frozen=True)
class Setup:
    """Settings that a run depends on."""

    topics: tuple[str, ...]
    """That of the IMU, or those of its gyroscope and its accelerometer."""
    options: TimelineOptions = TimelineOptions()  # noqa: RUF009
    reading: dict[str, str] = field(default_factory=lambda: {'imu_type': IMU_TYPE})
    """The parameters that say how messages are read, those that are not empty."""


@dataclass
class Saved:
    """What is saved: the run, and that of another IMU which may replace it."""

    setup: Setup
    boot: str
    runs: list[Run]


def pack(runs: Sequence[Run], setup: Setup) -> State:
    """Return the state of runs as arrays to save."""
    for lane in (lane for run in runs for lane in run.lanes):
        lane.characterization.timeline.pending.join()
    # Messages whose unit is undecided are not saved, so they must not count as seen.
    return state_of(Saved(setup, boot_id(), [replace(run, lanes=[
        replace(lane, in_g=lane.unit.decision, seen=Seen() if lane.unit.waiting else lane.seen)
        for lane in run.lanes]) for run in runs]))


def unpack(state: Mapping[str, NDArray[Any]], setup: Setup) -> list[Run]:
    """Return the saved runs, ready to go on; their next sample is unrelated to the last one."""
    try:
        saved = restored(Saved, state)
    except (ImuAllanError, KeyError) as error:
        raise UnusableState('damaged', f'a part is missing ({error})') from error
    if saved.setup != setup:
        raise UnusableState('settings', 'it was made with other parameters or of another topic, '
                            f'{", ".join(saved.setup.topics)}')
    same_boot = bool(saved.boot) and saved.boot == boot_id()
    for run in saved.runs:
        run.lanes = [kept if _resume(kept, same_boot) else lane
                     for kept, lane in zip(run.lanes, new_run(setup).lanes, strict=True)]
    return saved.runs


def _resume(lane: Lane, same_boot: bool) -> bool:
    """Make a saved lane ready to go on; return whether it has usable samples."""
    try:
        if same_boot:
            # Unless its driver restarts, the IMU has stayed switched on.
            lane.characterization.break_run()
        else:
            lane.characterization.power_on()
            # Every driver is new after a boot and must not count as another power-on.
            lane.known.publishers = []
        return lane.characterization.summary().frame_id is not None
    except ImuAllanError:
        return False


def new_run(setup: Setup) -> Run:
    """Return a run without samples."""
    # A unit that is named is converted with the messages; else it is found from the samples.
    in_g = False if {'accel_unit', 'accel_field'} & setup.reading.keys() else None
    return Run([Lane(Characterization(kind='topic', topic=topic, options=setup.options), in_g=in_g)
                for topic in setup.topics])


def boot_id() -> str:
    """Return the identifier of this boot of the computer; empty if unavailable."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return ''
