# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The path of every sample from message to result, in one class as all of it is one state.

The node and the recording tool both push their blocks through one `Characterization`; they differ
in where blocks come from and where results go, and in nothing else.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
import json
from typing import Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.characterization.axis import axis_results, bounded, unsteady, widened
from imu_allan.characterization.findings import (
    copy_remark,
    halves_remarks,
    length_remarks,
    MEAN_MOVES,
    thermometer_remarks,
    tone_findings,
    with_start,
)
from imu_allan.characterization.finished import FinishedGroup, FinishedRecord
from imu_allan.characterization.group import Group
from imu_allan.characterization.power_ons import PowerOns
from imu_allan.characterization.thermometer import Thermometer
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.noise.axis_fit import AxisFit, copies, fit_axes
from imu_allan.noise.record.alike import SAME
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Backtest, Result, Signal, Source
from imu_allan.sensor.plausible import implausible
from imu_allan.timeline import NoAxes, TimelineOptions, TimelineStage, TimelineSummary
from imu_allan.tuning.backtest import backtest
from imu_allan.version import __version__
from imu_allan.wording import NO_TOPIC
import numpy as np
from numpy.typing import ArrayLike, NDArray

State = Mapping[str, NDArray[np.generic]]


class Characterization:
    """
    One IMU being characterized, in constant memory.

    The coefficients are those of equation (1) of docs/statistics.md, by the likelihood (7), the
    curve is (4), the drift model (8).

    Parameters
    ----------
    kind : {'recording', 'topic'}
    path : str or None
        Of the recording.
    topic : str or None
    options : TimelineOptions, optional

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

    def __init__(self, *, kind: Literal['recording', 'topic'], path: str | None = None,
                 topic: str | None = None,
                 options: TimelineOptions = TimelineOptions()) -> None:  # noqa: B008
        self._kind: Literal['recording', 'topic'] = kind
        self._path, self._topic = path, topic
        self._timeline = TimelineStage(options)
        self._groups: list[Group] = []
        self._power_ons = PowerOns()
        self._before = Thermometer()     # what was read before the first sample came
        self._epoch_ns: int | None = None

    def update(self, block: ImuBlock) -> None:
        """
        Take in the next messages.

        Raises
        ------
        ImuAllanError
            If the timeline cannot make sense of them.

        """
        epoch = self._timeline.epoch_ns
        self._absorb(self._timeline.push(block), epoch)

    def take_temperature(self, stamps_ns: ArrayLike, celsius: ArrayLike) -> None:
        """
        Take in readings of a thermometer beside the sensor.

        Parameters
        ----------
        stamps_ns : array_like of int, shape (n,)
            On the clock of the Imu messages' headers, or of reception where those are unusable;
            in any order, before or after the samples they belong to.
        celsius : array_like, shape (n,)
            In degrees Celsius; what is not finite is left out.

        Raises
        ------
        ValueError
            If the two differ in length.

        """
        for thermometer in [group.thermometer for group in self._groups] or [self._before]:
            thermometer.take(stamps_ns, celsius)

    def take(self, blocks: Iterable[ImuBlock]) -> None:
        """
        Take in a whole recording.

        Parameters
        ----------
        blocks : iterable of ImuBlock
            Its messages, in order.

        Raises
        ------
        ImuAllanError
            If the blocks cannot be read, or the timeline cannot make sense of them.

        """
        for block in blocks:
            try:
                self.update(block)
            except NoAxes:
                # A driver may take a while to come to life; `result` tells if it never did.
                continue
            except ImuAllanError as error:
                raise ImuAllanError(f'{self.place}: {error}') from error

    def finish(self) -> None:
        """Take in what the timeline still holds back: the recording has ended."""
        epoch = self._timeline.epoch_ns
        self._absorb(self._timeline.flush(), epoch)

    def break_run(self) -> None:
        """Begin anew after an interruption of unknown length; what was learnt stays."""
        epoch = self._timeline.epoch_ns
        self._absorb(self._timeline.break_run(), epoch)

    def power_on(self) -> None:
        """Begin anew behind a power-on of the sensor, whose bias may be another now."""
        self._power_ons = self._power_ons.one_more(self.record())
        self.break_run()

    def summary(self) -> TimelineSummary:
        """Return what was seen of clock and samples so far."""
        return self._timeline.summary()

    def snapshot(self) -> Characterization:
        """Return an independent copy, which can be fitted in another thread."""
        twin = Characterization(kind=self._kind, path=self._path, topic=self._topic)
        twin._timeline = self._timeline.copy()
        twin._groups = [group.copy() for group in self._groups]
        twin._before, twin._epoch_ns = self._before.copy(), self._epoch_ns
        twin._power_ons = self._power_ons
        return twin

    @property
    def path(self) -> str | None:
        """Path of the recording."""
        return self._path

    @property
    def topic(self) -> str | None:
        """Topic that the samples come from."""
        return self._topic

    @property
    def place(self) -> str:
        """Path, and topic where there is one, as complaints name them."""
        return str(self._path) if self._topic == NO_TOPIC else f'{self._path}, topic {self._topic}'

    def record(self) -> FinishedRecord | None:
        """
        Return what was taken in, the stream being left as it is.

        Returns
        -------
        FinishedRecord or None
            None before a sample came.

        """
        twin = self.snapshot()
        twin.finish()
        summary = twin.summary()
        rate = summary.timeline.sample_rate_hz
        if not twin._groups or rate is None:
            return None
        groups = []
        for group in twin._groups:
            finished = group.estimator.finished()
            heat = group.temperature(finished, rate)
            groups.append(FinishedGroup(group.names, finished,
                                        heat.course if heat is not None else None))
        return FinishedRecord(summary, rate, tuple(groups))

    @property
    def clock(self) -> Literal['header', 'receive'] | None:
        """Stamps in use; None as long as nothing has been decided for good."""
        return self._timeline.clock

    def result(self, remarks: Iterable[Finding] = (), *,
               tested: Mapping[str, Backtest | None] | None = None) -> Result:
        """
        Fit what has come so far; the stream is left as it is.

        Parameters
        ----------
        remarks : iterable of Finding, optional
            Findings of the front door, such as a truncated recording; they come first.
        tested : mapping of axis name to Backtest or None, optional
            Backtests of a shorter record, which spare a tenth of a second; else they are made.

        Returns
        -------
        Result
            Without axes as long as no sample has come.

        Raises
        ------
        ImuAllanError
            If a recording is mostly motion, or the timeline cannot make sense of it.

        """
        return self.fitted(remarks, tested=tested)[0]

    def fitted(self, remarks: Iterable[Finding] = (), *,
               tested: Mapping[str, Backtest | None] | None = None
               ) -> tuple[Result, dict[str, AxisFit | None]]:
        """Return the result, as `result` does, and the fit of every axis that it was made of."""
        twin = self.snapshot()
        try:
            twin.finish()
        except ImuAllanError as error:
            # Of a short recording all is decided here.
            if self._kind == 'topic':
                raise
            raise ImuAllanError(f'{self.place}: {error}') from error
        summary = twin.summary()
        if summary.mostly_motion and self._kind == 'recording':
            # Two sensors on one topic shake as much as one that moves.
            mixed = ('; or two sensors publish on this topic: ros2 topic info --verbose names '
                     'the publishers' if any(remark.code in ('several_publishers', 'alternating')
                                             for remark in summary.remarks) else '')
            raise ImuAllanError(
                f'{self.place}: the IMU moves during most of the recording; record it at rest, '
                'choose a still part with --start and --duration, or keep everything with '
                f'--motion keep{mixed}')
        axes, found, fits = twin._axes(summary, tested)
        source = Source(self._kind, self._path, self._topic, summary.frame_id,
                        summary.start_time, summary.clock)
        record = twin.record() if self._power_ons.ended else None
        return Result(__version__, source, summary.timeline, axes,
                      (*remarks, *summary.remarks, *found),
                      turn_on_bias={} if record is None else self._power_ons.spread(axes, record),
                      temperature=twin._shown_temperature(summary)), fits

    def _shown_temperature(self, summary: TimelineSummary) -> Signal | None:
        """Return the temperature over time, as a picture shows it."""
        rate = summary.timeline.sample_rate_hz
        if not self._groups or rate is None:
            return None
        first = self._groups[0]
        return first.thermometer.signal(first.estimator.finished().signal.columns(), 1 / rate)

    def _axes(self, summary: TimelineSummary, tested: Mapping[str, Backtest | None] | None
              ) -> tuple[dict[str, AxisResult], list[Finding], dict[str, AxisFit | None]]:
        rate = summary.timeline.sample_rate_hz
        if not self._groups:
            return {}, [], {}
        if rate is None:
            return {}, [finding('unknown_rate')], {}
        axes: dict[str, AxisResult] = {}
        fits: dict[str, AxisFit | None] = {}
        remarks: list[Finding] = []
        unclear: set[str] = set()
        for group in self._groups:
            axes |= self._fit_group(group, rate, remarks, unclear, tested, fits)
        axes = {name: bounded(axes[name]) if name in summary.turned else axes[name]
                for name in AXES if name in axes}
        axes = {name: widened(axis, *summary.density_error) for name, axis in axes.items()}
        unclear.update(summary.turned)
        remarks = [*with_start(remarks, axes, summary.timeline.duration_s),
                   *tone_findings(axes), *implausible(axes)]
        return axes, remarks + length_remarks(axes, summary, unclear), fits

    def _fit_group(self, group: Group, rate: float, remarks: list[Finding], unclear: set[str],
                   tested: Mapping[str, Backtest | None] | None,
                   fits: dict[str, AxisFit | None]) -> dict[str, AxisResult]:
        """Fit a group into `fits`; what is worth telling goes to `remarks`, names to `unclear`."""
        names, finished = group.names, group.estimator.finished()
        series = finished.periodogram
        heat = group.temperature(finished, rate)
        own_fits = fit_axes(finished, 1 / rate, heat.course if heat is not None else None)
        fits.update(zip(names, own_fits, strict=True))
        fitted = axis_results(finished, rate, [AXES[name] for name in names], own_fits)
        if tested is None:
            tested = dict(zip(names, backtest(series.series, series.cell, 1 / rate), strict=True))
        axes = {name: replace(axis, backtest=tested.get(name) if axis.drift_model else None)
                for name, (axis, _) in zip(names, fitted, strict=True)}
        for one, other, sign in copies(finished):
            first, second = names[one], names[other]
            remarks.append(copy_remark(first, second, sign))
            for name, of in ((first, second), (second, first)):
                axes[name] = replace(axes[name], copy_of=of if sign == SAME else f'-{of}')
        for name, (_, own) in zip(names, fitted, strict=True):
            remarks += [remark.of(name) for remark in own]
            if any(remark.code in MEAN_MOVES for remark in own):
                unclear.add(name)
        unsaid = {name: axes[name] for name, (_, own) in zip(names, fitted, strict=True)
                  if not any(remark.code in {'not_steady', *MEAN_MOVES} - {'trend_or_walk'}
                             for remark in own)}
        for name, remark in halves_remarks(unsaid).items():
            remarks.append(remark.of(name))
            axes[name] = unsteady(axes[name])
        if heat is not None and group is self._groups[0]:
            remarks += thermometer_remarks(heat)
        return axes

    def _absorb(self, blocks: Iterable[EvenBlock], epoch_ns: int | None) -> None:
        """Take in even blocks; `epoch_ns`: of the timeline before it gave them."""
        if self._epoch_ns is None:
            self._epoch_ns = epoch_ns if epoch_ns is not None else self._timeline.epoch_ns
        for block in blocks:
            if not len(block):
                continue
            if block.restart:
                self._before, self._groups = self._readings(), []
            if block.new_run:
                # A jump of the clock begins a run, and what was held back belongs before it.
                self._epoch_ns = self._timeline.epoch_ns
            for group in self._groups_of(block):
                group.add(block, self._epoch_ns, self._timeline.interval_ns)

    def _groups_of(self, block: EvenBlock) -> list[Group]:
        """Give the groups whose axes a block has, which is all but always the only one."""
        there = np.isfinite(block.samples[0])
        columns = np.flatnonzero(there)
        if len(self._groups) == 1 and np.array_equal(columns, self._groups[0].columns):
            return self._groups
        groups: list[Group] = []
        for group in self._groups:
            stays = there[group.columns]
            if group.away and stays.any():
                # Who comes back and gave one value before was dead, and begins anew.
                kept = ~(stays & group.estimator.constant)
                if not kept.any():
                    continue
                group, stays = group.part(kept), stays[kept]
            whole = stays.all() or not stays.any()
            groups += [group] if whole else [group.part(stays), group.part(~stays)]
        known = [column for group in groups for column in group.columns.tolist()]
        new = np.setdiff1d(columns, known)
        if len(new):
            groups.append(Group(new, Estimator(len(new)), self._readings()))
        self._groups = groups
        for group in groups:
            group.new_run |= block.new_run
            group.away |= not there[group.columns[0]]
        return [group for group in groups if there[group.columns[0]]]

    def _readings(self) -> Thermometer:
        """Give a thermometer with all readings so far, and no samples."""
        twin = (self._groups[0].thermometer if self._groups else self._before).copy()
        twin.forget_samples()
        return twin

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """
        Return everything needed to go on later.

        Returns
        -------
        dict of str to ndarray
            No object arrays, so that it can be stored without pickle.

        """
        about = {'kind': self._kind, 'path': self._path, 'topic': self._topic,
                 'epoch_ns': self._epoch_ns, 'power_ons': self._power_ons.to_plain(),
                 'groups': [group.to_plain() for group in self._groups]}
        state: dict[str, NDArray[np.generic]] = {'about': np.array(json.dumps(about))}
        parts = {'timeline': self._timeline.to_state()}
        for number, group in enumerate(self._groups):
            parts[f'estimator{number or ""}'] = group.estimator.to_state()
            parts[f'thermometer{number or ""}'] = group.thermometer.to_state()
        if not self._groups:
            parts['thermometer'] = self._before.to_state()
        for name, part in parts.items():
            state.update({f'{name}/{key}': value for key, value in part.items()})
        return state

    @classmethod
    def from_state(cls, state: State) -> Characterization:
        """
        Go on from `to_state`.

        Raises
        ------
        ImuAllanError
            If the state is not one of a characterization.

        """
        def part(name: str) -> dict[str, NDArray[np.generic]]:
            return {key[len(name) + 1:]: value for key, value in state.items()
                    if key.startswith(f'{name}/')}

        try:
            # A number that is none of the integers it should be is an error, not a warning.
            with np.errstate(invalid='raise'):
                about = json.loads(str(state['about']))
                self = cls(kind=about['kind'], path=about['path'], topic=about['topic'])
                self._timeline = TimelineStage.from_state(part('timeline'))
                self._epoch_ns = about.get('epoch_ns')
                self._power_ons = PowerOns.from_plain(about.get('power_ons', []))
                # A state from before axes could come and go has one group at most, and one from
                # before there were temperatures has none of them.
                groups = about.get('groups', [about] if part('estimator') else [])
                for number, plain in enumerate(groups):
                    heat = part(f'thermometer{number or ""}')
                    group = Group(np.array(plain['columns'], dtype=np.int64).reshape(-1),
                                  Estimator.from_state(part(f'estimator{number or ""}')),
                                  Thermometer.from_state(heat) if heat else Thermometer(),
                                  int(plain['next']), bool(plain.get('new_run', False)),
                                  bool(plain.get('away', False)))
                    if group.estimator.axes != len(group.columns):
                        raise ValueError('axes of an estimator and their names differ in number')
                    self._groups.append(group)
                known = [column for group in self._groups for column in group.columns.tolist()]
                if len(set(known)) != len(known) or not set(known) <= set(range(len(AXES))):
                    raise ValueError('an axis stands in two groups')
                if not groups and (heat := part('thermometer')):
                    self._before = Thermometer.from_state(heat)
        except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
            raise ImuAllanError(f'saved characterization is damaged: {error}') from error
        return self
