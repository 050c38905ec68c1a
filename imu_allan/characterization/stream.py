# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The path of every sample from message to result.

The node and the recording tool both push their blocks through one `Characterization`. They differ
only in where blocks come from and where results go. It is one class because all of it is one
state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import get_args, Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.characterization.axis import axis_results
from imu_allan.characterization.axis_groups import FinishedRecord, Group
from imu_allan.characterization.noise_findings import (
    length_findings,
    MEAN_MOVES,
    thermometer_findings,
    tone_findings,
    with_start,
)
from imu_allan.characterization.power_ons import Mark, mark_of, spread_of_means
from imu_allan.characterization.thermometer import shown, Thermometer
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES
from imu_allan.noise.uncertainty import bounded, leaked_share, widened
from imu_allan.result import AxisResult, Result, Source
from imu_allan.sensor.plausible import implausible
from imu_allan.state import Record, restored, State, state_of
from imu_allan.timeline import NoAxes, TimelineOptions, TimelineStage, TimelineSummary
from imu_allan.tuning.backtest import backtest
from imu_allan.version import __version__
from imu_allan.wording import NO_TOPIC
import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = Literal['recording', 'topic']


@dataclass(kw_only=True, eq=False, repr=False)
class Characterization(Record):
    """
    Characterization of one IMU, in constant memory.

    The coefficients are those of equation (1) of docs/statistics.md, estimated by the likelihood
    (7). The curve is (4), the drift model (8).

    Parameters
    ----------
    kind : {'recording', 'topic'}
    path : str, optional
        Path of the recording.
    topic : str, optional
        Topic that the samples come from.
    options : TimelineOptions, optional

    Attributes
    ----------
    timeline : TimelineStage
        What it knows of clock and rate.

    Examples
    --------
    >>> import numpy as np
    >>> samples = np.random.default_rng(1).normal(0, [0.01] * 3 + [0.05] * 3, (20_000, 6))
    >>> stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(20_000)
    >>> imu = Characterization(kind='topic', topic='/imu')
    >>> imu.update(ImuBlock(stamps, stamps, samples, np.zeros((20_000, 2), dtype=bool), 'imu'))
    >>> imu.finish()
    >>> low, high = imu.result().axes['accel_z'].coefficients['noise_density'].ci95
    >>> low < 0.005 < high
    True

    """

    kind: Kind
    path: str | None = None
    topic: str | None = None
    options: TimelineOptions = TimelineOptions()  # noqa: RUF009
    timeline: TimelineStage = field(init=False)
    # Stamp of the clock in use at time zero of the timeline
    epoch_ns: int | None = field(default=None, init=False)
    groups: list[Group] = field(default_factory=list, init=False)
    # Those that have ended, in order
    power_ons: list[Mark] = field(default_factory=list, init=False)
    # Readings from before the first sample
    before: Thermometer = field(default_factory=Thermometer, init=False)

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be 'recording' or 'topic', not {self.kind!r}")
        self.timeline = TimelineStage(self.options)

    def update(self, block: ImuBlock) -> None:
        """
        Take in the next messages.

        Raises
        ------
        ImuAllanError
            If the timeline cannot make sense of them.

        """
        self._absorb(lambda: self.timeline.push(block))

    def take_temperature(self, stamps_ns: ArrayLike, celsius: ArrayLike) -> None:
        """
        Take in readings of a thermometer near the sensor.

        Parameters
        ----------
        stamps_ns : array_like of int, shape (n,)
            On the clock of the Imu messages' headers, or of reception if those are unusable; in
            any order, before or after the samples they belong to.
        celsius : array_like, shape (n,)
            In degrees Celsius; values that are not finite are left out.

        Raises
        ------
        ValueError
            If the two differ in length.

        """
        for thermometer in [group.thermometer for group in self.groups] or [self.before]:
            thermometer.take(stamps_ns, celsius)

    def take(self, blocks: Iterable[ImuBlock]) -> None:
        """
        Take in a whole recording.

        Parameters
        ----------
        blocks : iterable of ImuBlock
            Messages of the recording, in order.

        Raises
        ------
        ImuAllanError
            If the blocks cannot be read, or the timeline cannot make sense of them.

        """
        for block in blocks:
            try:
                self.update(block)
            except NoAxes:
                # A driver may take a while to start; `result` reports if it never did.
                continue
            except ImuAllanError as error:
                raise ImuAllanError(f'{self.place}: {error}') from error

    def finish(self) -> None:
        """Take in what the timeline still holds back, at the end of a recording."""
        self._absorb(self.timeline.flush)

    def break_run(self) -> None:
        """Begin a new run after an interruption of unknown length; what was learned is kept."""
        self._absorb(self.timeline.break_run)

    def power_on(self) -> None:
        """Begin a new run after a power-on of the sensor, whose bias may have changed."""
        record = self.record()
        if record is not None:
            self.power_ons.append(mark_of(record))
            # Keep three years of a robot that is switched on daily.
            del self.power_ons[:-1000]
        self._absorb(self.timeline.power_on)

    def summary(self) -> TimelineSummary:
        """Return the summary of clock and samples so far."""
        return self.timeline.summary()

    def snapshot(self) -> Characterization:
        """Return an independent copy, which can be fitted in another thread."""
        return self.copy()

    @property
    def place(self) -> str:
        """Path, and topic if there is one, as error messages name them."""
        return str(self.path) if self.topic == NO_TOPIC else f'{self.path}, topic {self.topic}'

    def record(self) -> FinishedRecord | None:
        """
        Return the data taken in so far, without changing the stream.

        Returns
        -------
        FinishedRecord or None
            None before the first sample.

        """
        return self._finished()[1]

    def _finished(self) -> tuple[TimelineSummary, FinishedRecord | None]:
        """Return summary and data with what the timeline holds back, if that is usable."""
        twin = self.snapshot()
        try:
            twin.finish()
        except ImuAllanError as error:
            # For a short recording, everything is decided here; a topic may get better.
            if self.kind == 'recording':
                raise ImuAllanError(f'{self.place}: {error}') from error
            twin = self.snapshot()
        summary = twin.summary()
        rate = summary.timeline.sample_rate_hz
        if not twin.groups or rate is None:
            return summary, None
        return summary, FinishedRecord(summary, rate, tuple(
            group.finish(rate) for group in twin.groups))

    def result(self, remarks: Iterable[Finding] = ()) -> Result:
        """
        Fit the data taken in so far, without changing the stream.

        Parameters
        ----------
        remarks : iterable of Finding, optional
            Findings of the reader, such as a truncated recording; they come first.

        Returns
        -------
        Result
            Without axes before the first sample.

        Raises
        ------
        ImuAllanError
            If a recording is mostly motion, or the timeline cannot make sense of it.

        """
        return self.fitted(remarks)[0]

    def fitted(self, remarks: Iterable[Finding] = ()) -> tuple[Result, FinishedRecord | None]:
        """Return the result, as `result` does, and the data and fits behind it."""
        summary, record = self._finished()
        if summary.mostly_motion and self.kind == 'recording':
            # Two sensors on one topic look like one that moves.
            mixed = ('; or two sensors publish on this topic: ros2 topic info --verbose names '
                     'the publishers' if any(remark.code == 'several_publishers'
                                             for remark in summary.remarks) else '')
            raise ImuAllanError(
                f'{self.place}: the IMU moves during most of the recording. Record it at rest, '
                'choose a still part with --start and --duration, or keep everything with '
                f'--motion keep{mixed}')
        # The reader may know why an axis has no values.
        given = [*remarks]
        known = {(remark.code, remark.axes) for remark in given}
        given += [own for own in summary.remarks if (own.code, own.axes) not in known]
        result = Result(
            __version__, Source(self.kind, self.path, self.topic, summary.frame_id,
                                summary.start_time, summary.clock),
            summary.timeline, {}, tuple(given))
        if record is None:
            timeline = summary.timeline
            unknown = timeline.samples and timeline.sample_rate_hz is None
            return replace(result, warnings=(
                *result.warnings, *([finding('unknown_rate')] if unknown else ()))), None
        axes, found = _fitted_axes(record)
        return replace(
            result, axes=axes, warnings=(*result.warnings, *found),
            turn_on_bias=spread_of_means(self.power_ons, axes, record),
            temperature=shown(record.groups[0].heat)), record

    def _absorb(self, step: Callable[[], Iterable[EvenBlock]]) -> None:
        """Take in the even blocks that a step of the timeline returns."""
        epoch_ns = self.timeline.epoch_ns
        blocks = step()
        if self.epoch_ns is None:
            self.epoch_ns = epoch_ns if epoch_ns is not None else self.timeline.epoch_ns
        for block in blocks:
            if not len(block):
                continue
            if block.restart:
                self.before, self.groups = self._readings(), []
            if block.new_run:
                # A jump of the clock begins a run, and blocks held back until then belong before
                # it.
                self.epoch_ns = self.timeline.epoch_ns
            if not self.groups:
                columns = np.flatnonzero(np.isfinite(block.samples[0]))
                self.groups = [Group(columns, Estimator(len(columns)), self._readings())]
            self.groups = [part for group in self.groups for part in group.parted(block)]
            for group in self.groups:
                group.add(block, self.epoch_ns, self.timeline.interval_ns)

    def _readings(self) -> Thermometer:
        """Return a thermometer with all readings so far, and no samples."""
        twin = (self.groups[0].thermometer if self.groups else self.before).copy()
        twin.forget_samples()
        return twin

    def to_state(self) -> State:
        """
        Return everything needed to continue later.

        Returns
        -------
        dict of str to ndarray
            No object arrays, so that it can be stored without pickle.

        """
        self.timeline.pending.join()
        return state_of(self)

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[np.generic]]) -> Characterization:
        """
        Restore a characterization from the result of `to_state`.

        The arrays have to be those that `to_state` returned, under the same names.

        Raises
        ------
        ImuAllanError
            If a part is missing.

        """
        try:
            return restored(cls, state)
        except KeyError as error:
            raise ImuAllanError(f'saved characterization: {error.args[0]} is missing') from error


def _fitted_axes(record: FinishedRecord) -> tuple[dict[str, AxisResult], list[Finding]]:
    """Fit every axis; return the results and the findings."""
    fitted: dict[str, AxisResult] = {}
    found: list[Finding] = []
    for group in record.groups:
        finished, dt = group.estimator, 1 / group.rate_hz
        results = axis_results(finished, group.rate_hz, [AXES[name] for name in group.names],
                               group.fits)
        tested = backtest(finished.periodogram.series, finished.periodogram.cell, dt)
        for name, (axis, remarks), test in zip(group.names, results, tested, strict=True):
            fitted[name] = widened(replace(axis, backtest=test if axis.drift_model else None), 0.0,
                                   leaked_share(axis, finished.interpolated_share, dt))
            found += [remark.of(name) for remark in remarks]
        if group is record.groups[0] and group.heat is not None:
            found += thermometer_findings(group.heat)
    summary = record.summary
    axes = {name: widened(bounded(fitted[name]) if name in summary.turned else fitted[name],
                          *summary.density_error) for name in record.names}
    unclear = {name for remark in found if remark.code in MEAN_MOVES for name in remark.axes}
    return axes, [*with_start(found, axes, summary.timeline.duration_s),
                  *tone_findings(axes, record.rate_hz), *implausible(axes),
                  *length_findings(axes, summary.timeline, unclear | set(summary.turned))]
