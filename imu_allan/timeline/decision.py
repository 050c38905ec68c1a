# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a timeline has concluded: which clock, which axes, which pace."""

from dataclasses import dataclass, field
from math import sqrt
from typing import Any, Literal

from imu_allan.errors import ImuAllanError
from imu_allan.noise.terms import AXES
from imu_allan.state import Record
from imu_allan.timeline.clock import SECOND
from imu_allan.timeline.pace import Pace

Clock = Literal['header', 'receive']

AXIS_NAMES = tuple(AXES)
_SHORTEST_NS = 1e3      # a microsecond
_LONGEST_NS = 100.0 * SECOND
"""Intervals beyond these bounds are no IMU's."""


@dataclass
class Decision(Record):
    """
    Conclusions from the messages so far.

    Attributes
    ----------
    frame_id : str or None
        Of the first message: others are another sensor's.
    clock : {'header', 'receive'} or None
        Whose stamps are used; None before the first messages were seen.
    counted_only : bool
        No stamps are usable: samples are counted at the stated rate.
    present : list of bool or None
        Whether each axis was ever there.
    not_finite : list of bool
        Which were not, without being declared absent, in the first messages.
    interval_ns : float or None
        Distance of two samples, which follows the clock's slow drift.
    first_interval_ns : float or None
        The same as first measured: it sets how many samples are judged together.
    spread : float
        Standard deviation of the stamps about the grid, in intervals.
    counting : bool
        Messages are counted, see `imu_allan.timeline.pace.Pace`.
    hidden : float
        Share of the samples that may be lost unseen.
    ticks : bool
        Header stamps come in ticks, and messages that share one are different.
    overlaps : bool
        Batches of header stamps reach back into those before.
    numbered : bool
        Publication numbers tell which messages were lost on the way.
    repeated : int
        Of the numbers so far those of messages that came twice: they are no samples.
    restart : bool
        The next samples given make those before void.
    remarks : dict
        Why it was decided so, where the user should know: figures by the code of a finding.

    """

    frame_id: str | None = None
    clock: Clock | None = None
    counted_only: bool = False
    present: list[bool] | None = None
    not_finite: list[bool] = field(default_factory=lambda: [False] * 6)
    interval_ns: float | None = None
    first_interval_ns: float | None = None
    spread: float = 0.0
    counting: bool = False
    hidden: float = 0.0
    ticks: bool = False
    overlaps: bool = False
    numbered: bool = False
    repeated: int = 0
    restart: bool = False
    remarks: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def pace(self) -> Pace:
        """How stamps advance; one nanosecond stands for an interval not yet known."""
        return Pace(self.interval_ns or 1.0, self.spread, self.counting, self.hidden)

    def rate_error(self, steps: int) -> float:
        """Bound the relative error of a rate over steps: stamps lie evenly within a batch."""
        return sqrt(12) * self.spread / max(steps, 1)

    @property
    def unties(self) -> bool:
        """Whether messages with equal stamps are told apart by their values."""
        return not self.counted_only and (self.clock == 'receive' or self.ticks
                                          or self.overlaps)

    def take_pace(self, pace: Pace) -> None:
        """
        Go on with a measured pace.

        Raises
        ------
        ImuAllanError
            If no IMU has such a pace.

        """
        if not _SHORTEST_NS < pace.interval_ns < _LONGEST_NS:
            clock, self.clock = self.clock, None
            raise ImuAllanError(
                f'the {clock} stamps advance by {pace.interval_ns / SECOND:.3g} s from message to '
                'message, as those of no IMU do: choose the other clock (analyze --clock)')
        self.set_pace(pace)

    def set_pace(self, pace: Pace) -> None:
        """Go on with a pace, whatever it is."""
        self.interval_ns, self.spread = pace.interval_ns, pace.spread
        self.counting, self.hidden = pace.counting, pace.hidden
        if self.first_interval_ns is None:
            self.first_interval_ns = pace.interval_ns
