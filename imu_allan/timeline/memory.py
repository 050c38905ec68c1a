# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The state of a timeline.

It consists of the options, the messages not yet processed, the counts, the decisions, and the
position on the grid.
"""

from dataclasses import dataclass, field
from typing import Any, Literal

from imu_allan.arrays import Array, Bools
from imu_allan.block import ImuBlock, joined
from imu_allan.errors import ImuAllanError, positive, whole
from imu_allan.finding import Flaw
from imu_allan.result import LISTED_SPANS
from imu_allan.state import Record
from imu_allan.timeline.motion import MotionDetector
from imu_allan.timeline.pace import Pace
from imu_allan.timeline.stamps import SECOND, Stamps
from imu_allan.timeline.values import Content
import numpy as np

RATE_TOLERANCE = 0.02
"""Rates that differ by a larger share are different: a stated rate may be rounded, and a clock
slightly off. Messages at another rate are left out; if they persist, the node begins another
run."""


@dataclass(frozen=True)
class TimelineOptions:
    """
    What the user may decide about the timeline.

    Attributes
    ----------
    clock : {'auto', 'header', 'receive'}
        Which stamps to use; 'auto' takes header stamps unless they are unusable.
    rate_hz : float or None
        Sample rate stated by the user, which overrides the measured one.
    force_rate : bool
        Count samples at the stated rate, whatever their stamps.
    gap_tolerance : int
        Longest gap, in samples, that is interpolated by the local mean.
    motion : {'exclude', 'keep'}
        Whether motion and knocks are cut out.
    polled : bool
        Whether messages are known to repeat samples, as those of the slower one of two sensors.

    """

    clock: Literal['auto', 'header', 'receive'] = 'auto'
    rate_hz: float | None = None
    force_rate: bool = False
    gap_tolerance: int = 5
    motion: Literal['exclude', 'keep'] = 'exclude'
    polled: bool = False

    def __post_init__(self) -> None:
        """Reject unknown values, which a state file may contain; make numbers of numpy plain."""
        if self.clock not in ('auto', 'header', 'receive'):
            raise ValueError(f'clock {self.clock!r} is not auto, header or receive')
        if self.motion not in ('exclude', 'keep'):
            raise ValueError(f'motion {self.motion!r} is not exclude or keep')
        object.__setattr__(self, 'gap_tolerance', whole('gap_tolerance', self.gap_tolerance))
        if self.rate_hz is not None:
            object.__setattr__(self, 'rate_hz', positive('rate_hz', self.rate_hz))


@dataclass(frozen=True)
class Window(ImuBlock):
    """Raw messages: the first `consumed` are processed now, the rest again in the next window."""

    consumed: int = 0


@dataclass
class Pending(Record):
    """Messages in order of arrival, held until there are enough to process."""

    blocks: list[ImuBlock] = field(default_factory=list)
    # A running count, as asking each block for its length costs more than its messages do.
    messages: int = 0

    def append(self, block: ImuBlock) -> None:
        """Append the messages of a block."""
        self.blocks.append(block)
        self.messages += len(block)

    def join(self) -> None:
        """Join all messages into one block."""
        if len(self.blocks) > 1:
            self.blocks = [joined(self.blocks)]

    def take(self, n: int, consumed: int) -> Window:
        """Return the first `n` messages and discard the first `consumed` of them."""
        # An error, as of messages without any axis, may leave more than one window.
        later, beyond = [], self.messages - n
        while beyond >= len(self.blocks[-1]):
            later.append(self.blocks.pop())
            beyond -= len(later[-1])
        last = self.blocks.pop()
        first = joined([*self.blocks, last.part(slice(len(last) - beyond))])
        self.messages -= consumed
        self.blocks = [block for block in (
            first.part(slice(consumed, None)), last.part(slice(len(last) - beyond, None)),
            *reversed(later)) if len(block)]
        return Window(**vars(first), consumed=consumed)


@dataclass(frozen=True)
class Messages:
    """Messages to be placed on the grid."""

    # Stamps of the clock in use, and of the other clock, shape (n,).
    stamps: Stamps
    other: Stamps
    samples: Array  # NaN only where an axis is absent, shape (n, 6)
    consumed: int  # number of leading messages to place; the others only show what follows
    # Messages with unusable values: they have a grid place, which stays empty, shape (n,).
    void: Bools

    def pick(self, rows: slice | Bools) -> 'Messages':
        """Return the selected messages; those to be placed remain so."""
        consumed = int(np.count_nonzero(rows[:self.consumed]) if isinstance(rows, np.ndarray)
                       else len(self.stamps[:self.consumed][rows]))
        return Messages(self.stamps[rows], self.other[rows], self.samples[rows], consumed,
                        self.void[rows])


Clock = Literal['header', 'receive']

FASTEST_NS = 2.5e4
"""No IMU samples at more than 32 kHz: microseconds were written as nanoseconds, for example."""


NEVER_NS = 5 * 365 * 86400 * SECOND
"""No recording lasts five years: a longer step is a stamp fault, whatever the other clock
shows."""
LONGEST_QUEUE_NS = 2.5e9
"""Messages usually wait for no longer than this until they are received. Chosen by judgment."""


@dataclass
class StampCounts(Record):
    """Counts of the stamps of one clock."""

    first_ns: int = 0  # stamp of the first message; steps of the header clock are added
    last_ns: int | None = None  # newest stamp, with which the next one is compared
    # Stamps equal to, or earlier than, the one before.
    repeats: int = 0
    backward: int = 0

    def add(self, stamps: Stamps) -> bool:
        """Count repeated and backward stamps; return whether there are any."""
        last = self.last_ns
        if (last is None or stamps[0] > last) and (stamps[1:] > stamps[:-1]).all():
            return False
        steps = np.diff(stamps) if last is None else np.diff(stamps, prepend=last)
        self.repeats += int(np.count_nonzero(steps == 0))
        self.backward += int(np.count_nonzero(steps < 0))
        return True


@dataclass
class Counts(Record):
    """Messages by what became of them, and the faults of their stamps."""

    messages: int = 0  # messages decided on so far
    samples: int = 0  # messages that found their place on the grid
    # Empty places, and how many of them a local mean fills.
    missing: int = 0
    interpolated: int = 0
    # The other messages, by the reason for which they have no place.
    duplicates: int = 0
    out_of_order: int = 0
    rejected: int = 0
    spikes: int = 0  # rejected messages that are isolated outliers
    # Messages in which other axes have values than in the first ones.
    other_axes: int = 0
    header: StampCounts = field(default_factory=StampCounts)
    receive: StampCounts = field(default_factory=StampCounts)
    clock_jumps: int = 0  # jumps of the clock in use
    # Gaps that are not interpolated, and their total duration.
    gaps: int = 0
    gaps_ns: int = 0
    longest_gap_ns: int = 0  # duration of the longest gap
    # Start and duration in seconds of the first gaps.
    listed_gaps: list[tuple[float, float]] = field(default_factory=list)
    # Messages rejected because of their frame_id, by frame_id.
    other_frames: dict[str, int] = field(default_factory=dict)
    at_other_rate: int = 0  # messages rejected because they came at another rate
    # When the rate first changed, and the new rate.
    rate_changed_s: float = 0.0
    changed_rate_hz: float = 0.0
    # Time and places of all unbroken segments; their ratio is the rate.
    paced_ns: int = 0
    paced_steps: int = 0
    # Sum of a selection of accelerations, and their number.
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    gravity_samples: int = 0

    def of(self, clock: Clock | None) -> StampCounts:
        """Return the counts of a clock."""
        return self.receive if clock == 'receive' else self.header

    def list_gap(self, start_ns: float, duration_ns: float) -> None:
        """Record a gap that is not interpolated."""
        self.gaps += 1
        self.gaps_ns += round(duration_ns)
        self.longest_gap_ns = max(self.longest_gap_ns, round(duration_ns))
        if len(self.listed_gaps) < LISTED_SPANS:
            self.listed_gaps.append((start_ns / SECOND, duration_ns / SECOND))

    def reject_frame(self, frame_id: str, messages: int) -> None:
        """Count messages whose frame_id is not that of the first."""
        self.messages += messages
        self.rejected += messages
        # Only nine frame_ids are named, as a fault may produce any number.
        known = frame_id in self.other_frames or len(self.other_frames) < 9
        name = frame_id if known else '...'
        self.other_frames[name] = self.other_frames.get(name, 0) + messages


@dataclass
class Decision(Record):
    """Conclusions from the messages so far."""

    # Of the first message; messages with another one belong to another sensor.
    frame_id: str | None = None
    # Clock whose stamps are used; None before the first messages were seen.
    clock: Clock | None = None
    # Whether no stamps are usable, so that samples are counted at the stated rate.
    counted_only: bool = False
    # Whether there is one time for each message, as in a table, and no clock to choose.
    one_clock: bool = False
    # How fast header stamps of the first messages run, compared with receive stamps; 1 if unclear.
    first_speed: float = 1.0
    # How stamps advance, following the slow drift of the clock; an interval of one nanosecond
    # means not yet known.
    pace: Pace = Pace(1.0)  # noqa: RUF009
    # Interval as first measured, which sets how many samples are judged together. None before.
    first_interval_ns: float | None = None
    # Whether header stamps come in ticks, so that different messages share a stamp.
    ticks: bool = False
    # Axes that have values in the first messages; of other axes none are used.
    present: list[bool] = field(default_factory=lambda: [True] * 6)
    # Other axes that are not declared absent: they hold no numbers.
    not_finite: list[bool] = field(default_factory=lambda: [False] * 6)
    # Reasons for decisions that the user should know: figures by the code of a finding.
    remarks: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def separates_equal_stamps(self) -> bool:
        """Whether messages with equal stamps are distinguished by their values."""
        return not self.counted_only and (self.clock == 'receive' or self.ticks)

    @property
    def least_step_ns(self) -> float:
        """Least jump of one clock alone that is a step of that clock: stamps may be late."""
        return max(SECOND, min(100 * self.pace.interval_ns, NEVER_NS))

    def use_receive(self, flaw: Flaw | None) -> None:
        """Use receive stamps, because of a flaw of the header stamps or, with None, as better."""
        self.clock, self.ticks = 'receive', False
        self.remarks['receive_clock'] = {'flaw': flaw}

    def count_samples(self, rate_hz: float | None) -> None:
        """Count samples at the stated rate, and use no stamps."""
        self.counted_only = True
        self.remarks['counted_samples'] = {'rate_hz': rate_hz}

    def take_pace(self, pace: Pace) -> None:
        """Adopt a measured pace, or raise ImuAllanError if no IMU has such a pace."""
        if not FASTEST_NS < pace.interval_ns < 100.0 * SECOND:
            stamps, what, mend = (
                ('times', 'sample', 'mend them or their unit (analyze --columns, --stamp)')
                if self.one_clock else
                (f'{self.clock} stamps', 'message', 'choose the other clock (analyze --clock)'))
            raise ImuAllanError(f'the {stamps} advance by {pace.interval_ns / SECOND:.6g} s from '
                                f'{what} to {what}, as those of no IMU do: {mend}')
        self.set_pace(pace)

    def set_pace(self, pace: Pace) -> None:
        """Adopt a pace without checking it."""
        self.pace = pace
        self.first_interval_ns = pace.interval_ns


@dataclass
class Cursor(Record):
    """The position of a timeline on the grid."""

    # Stamps of the first and of the last sample placed, and of the last on the other clock.
    first_ns: int | None = None
    last_ns: int = 0
    other_ns: int = 0
    late_ns: float = 0.0  # how far the last stamp lies behind its place
    # Standard deviation of the latest stamps about their places, in intervals.
    jitter: float | None = None
    # Last stamp on a clock with equal stamps, and the number of messages before with the same one.
    tied_to: int | None = None
    ties: int = 0
    index: int = -1  # grid place of the last sample
    elapsed_ns: int = 0  # time since the first sample, which continues across jumps of the clock
    # Whether the next sample begins a new run, and whether because the clock jumped.
    fresh_run: bool = True
    jumped: bool = False
    other_rate: bool = False  # whether messages come at another rate than the first ones

    def elapsed_at(self, stamps: Stamps, row: int) -> int:
        """Return the time from the first sample, or the first of `stamps`, to one of `stamps`."""
        since_ns = int(stamps[0]) if self.first_ns is None else self.last_ns - self.elapsed_ns
        return int(stamps[row]) - since_ns


@dataclass
class Memory(Record):
    """The whole state of a timeline."""

    options: TimelineOptions = TimelineOptions()
    counts: Counts = field(default_factory=Counts)
    decision: Decision = field(default_factory=Decision)
    content: Content = field(default_factory=Content)
    cursor: Cursor = field(default_factory=Cursor)
    # The last samples placed in this run, as context for interpolation, shape (t, 6).
    tail: Array = field(default_factory=lambda: np.empty((0, 6)))
    motion: MotionDetector | None = None  # none before the first sample
    pending: Pending = field(default_factory=Pending)  # messages not yet processed
