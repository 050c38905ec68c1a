# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One run: what belongs to it, and is left behind when another begins."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.characterization.halves import HalfResult, united
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.node.same_imu import Known, Seen
from imu_allan.node.sequential import SequentialLooks
from imu_allan.node.standards import Looks
from imu_allan.noise.axis_fit import AxisFit
from imu_allan.result import Backtest, Result
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.writers.words import with_words

BACKTEST_GROWTH = 1.15
"""A backtest is made again when the record is longer by so much: what it says has hardly changed
before, and each of its filters runs over half of the record."""

Half = Literal['gyro', 'accel']
Backtests = Mapping[str, Backtest | None]
Fits = Mapping[str, AxisFit | None]


@dataclass(frozen=True)
class LaneSnapshot:
    """All that a lane had taken in at a moment."""

    characterization: Characterization
    half: Half | None
    remarks: Sequence[Finding]

    def fitted(self, tested: Backtests | None = None) -> tuple[Result, Fits]:
        """Fit it: the result, and the fits of its axes."""
        result, fits = self.characterization.fitted(self.remarks, tested=tested)
        own = {name: fit for name, fit in fits.items() if name.startswith(self.half or '')}
        return result, own


@dataclass(frozen=True)
class Snapshot:
    """All that a run had taken in at a moment."""

    lanes: tuple[LaneSnapshot, ...]

    def fitted(self, tested: Backtests | None = None) -> tuple[list[Result], Fits]:
        """
        Fit each lane; without backtests from before they are made.

        Parameters
        ----------
        tested : mapping of axis name to Backtest or None, optional
            Of a shorter record.

        Returns
        -------
        results : list of Result
            Of each lane.
        fits : dict of str to AxisFit or None
            Of every axis, what the results were made of.

        """
        found = [lane.fitted(tested) for lane in self.lanes]
        return ([result for result, _ in found],
                {name: fit for _, fits in found for name, fit in fits.items()})

    def as_one(self, results: Sequence[Result]) -> Result:
        """Join the results of the lanes."""
        if len(results) == 1:
            return with_words(results[0])
        return with_words(united([
            HalfResult(lane.half, lane.characterization.topic or '', result)
            for lane, result in zip(self.lanes, results, strict=True) if lane.half is not None]))

    def result(self) -> Result:
        """Fit it."""
        return self.as_one(self.fitted()[0])


class Lane:
    """
    What a run takes in of one topic, and what the node remembers about its samples.

    Parameters
    ----------
    characterization : Characterization
        New, or resumed.
    half : {'gyro', 'accel'}, optional
        The sensor that is taken from the topic; both by default.
    unit : AccelerationUnit, optional
        Finds out the unit of the acceleration, where the user has not said it.
    known : Known, optional
    seen : Seen, optional
        Of a resumed one.

    Attributes
    ----------
    known : Known
        By what messages are told to be of this IMU.
    seen : Seen
        Keeps out what has come before.
    fed : int
        Messages it has been given.
    stamp_ns : int
        Of the last message.
    error : str
        Why the latest messages are of no use; empty while they are.

    """

    def __init__(self, characterization: Characterization, half: Half | None = None,
                 unit: AccelerationUnit | None = None, known: Known | None = None,
                 seen: Seen | None = None) -> None:
        self.characterization = characterization
        self.half: Half | None = half
        self.unit = unit
        self.known = Known() if known is None else known
        self.seen = Seen() if seen is None else seen
        self.fed = 0
        self.stamp_ns = 0
        self.error = ''

    @property
    def looping(self) -> bool:
        """Whether the messages that come now have come before."""
        return self.seen.looping

    @property
    def span_s(self) -> float:
        """Time that it holds samples of; 0 where their rate is not known."""
        timeline = self.characterization.summary().timeline
        return timeline.samples / timeline.sample_rate_hz if timeline.sample_rate_hz else 0.0

    def snapshot(self) -> LaneSnapshot:
        """Return an independent copy, with the messages that wait for their unit."""
        copy = self.characterization.snapshot()
        if self.unit is not None:
            for block in self.unit.waiting:
                self._pass_on(block, copy)
        return LaneSnapshot(copy, self.half, [] if self.unit is None else self.unit.remarks)

    def power_on(self) -> None:
        """Keep the mean of what comes apart from that of what has come."""
        try:
            self.characterization.power_on()
        except ImuAllanError as error:
            self.error = str(error)

    def update(self, blocks: Sequence[ImuBlock]) -> None:
        """Take in messages; those that the timeline cannot use are told of in `error`."""
        self.known.see(blocks)
        blocks = self.seen.unseen(blocks)
        if blocks:
            self.error = ''
        for block in blocks:
            self.fed += len(block)
            self.stamp_ns = int(block.header_ns[-1] or block.receive_ns[-1])
            for known in [block] if self.unit is None else self.unit(block):
                self._pass_on(known, self.characterization)

    def _pass_on(self, block: ImuBlock, to: Characterization) -> None:
        try:
            to.update(block if self.half is None else block.only(self.half))
        except ImuAllanError as error:
            self.error = str(error)


class Run:
    """
    One lane, or that of the gyroscope and that of the accelerometer.

    Parameters
    ----------
    lanes : Lane
        The gyroscope first.

    Attributes
    ----------
    fitted, checkpointed : int
        How many of the messages are in the last fit and checkpoint.
    duration_s : float
        Time that the last fit spans.
    over : bool
        Whether another has begun since.
    looks : Looks
        At how it stands to a datasheet, kept by the thread that fits.
    sequential : SequentialLooks
        At what its fits show, kept by the same.

    """

    def __init__(self, *lanes: Lane) -> None:
        self.lanes = lanes
        self.fitted = self.checkpointed = 0
        self.duration_s = 0.0
        self.over = False
        self.looks = Looks()
        self.sequential = SequentialLooks()
        self._backtests: Backtests | None = None
        self._tested = 0

    @property
    def fed(self) -> int:
        """Messages it has been given."""
        return sum(lane.fed for lane in self.lanes)

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last message."""
        return max(lane.stamp_ns for lane in self.lanes)

    @property
    def span_s(self) -> float:
        """Time that it holds samples of."""
        return max(lane.span_s for lane in self.lanes)

    @property
    def backtests(self) -> Backtests | None:
        """Backtests that are still good; None where the record has become so much longer."""
        return self._backtests if self.fed < BACKTEST_GROWTH * self._tested else None

    def snapshot(self) -> Snapshot:
        """Return an independent copy, which can be fitted in another thread."""
        return Snapshot(tuple(lane.snapshot() for lane in self.lanes))

    def learn(self, results: Sequence[Result], tested_at: int | None) -> None:
        """
        Remember what a fit has told.

        Parameters
        ----------
        results : sequence of Result
            Of each lane.
        tested_at : int or None
            Messages that were in its backtests, if they were made anew.

        """
        self.duration_s = max(result.timeline.duration_s for result in results)
        for lane, result in zip(self.lanes, results, strict=True):
            lane.known.learn(result.source)
        if tested_at is not None:
            self._tested = tested_at
            self._backtests = {name: axis.backtest for result in results
                               for name, axis in result.axes.items()}
