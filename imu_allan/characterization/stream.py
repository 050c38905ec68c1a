# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The path of every sample: messages, timeline, estimator, fit, result.

The node and the recording tool both push their blocks through one `Characterization`; they differ
in where blocks come from and where results go, and in nothing else.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
import json
from typing import Literal

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.characterization.axis import axis_results
from imu_allan.characterization.findings import (
    length_remarks,
    MEAN_MOVES,
    thermometer_remarks,
)
from imu_allan.characterization.thermometer import Thermometer
from imu_allan.errors import ImuAllanError
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Remark, Result, Signal, Source
from imu_allan.timeline import TimelineOptions, TimelineStage, TimelineSummary
from imu_allan.tuning.backtest import backtest
from imu_allan.version import __version__
import numpy as np
from numpy.typing import ArrayLike, NDArray

State = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True)
class Record:
    """
    What was taken in, ready to be put together with other records.

    Attributes
    ----------
    summary : TimelineSummary
    rate_hz : float
        Samples per second.
    names : list of str
        Of the axes of the estimator.
    estimator : Estimator
        Finished.

    """

    summary: TimelineSummary
    rate_hz: float
    names: list[str]
    estimator: Estimator


class Characterization:
    """
    One IMU being characterized, in constant memory.

    Parameters
    ----------
    kind : {'recording', 'topic'}
    path : str or None
        Of the recording.
    topic : str or None
    options : TimelineOptions, optional

    """

    def __init__(self, *, kind: Literal['recording', 'topic'], path: str | None = None,
                 topic: str | None = None,
                 options: TimelineOptions = TimelineOptions()) -> None:  # noqa: B008
        self._kind: Literal['recording', 'topic'] = kind
        self._path, self._topic = path, topic
        self._timeline = TimelineStage(options)
        self._estimator: Estimator | None = None
        self._columns: NDArray[np.int64] = np.zeros(0, np.int64)
        self._next = 0
        self._thermometer = Thermometer()
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
        self._thermometer.take(stamps_ns, celsius)

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
            except ImuAllanError as error:
                raise ImuAllanError(f'{self._path}, topic {self._topic}: {error}') from error

    def finish(self) -> None:
        """Take in what the timeline still holds back: the recording has ended."""
        epoch = self._timeline.epoch_ns
        self._absorb(self._timeline.flush(), epoch)

    def break_run(self) -> None:
        """Begin anew after an interruption of unknown length; what was learnt stays."""
        epoch = self._timeline.epoch_ns
        self._absorb(self._timeline.break_run(), epoch)

    def summary(self) -> TimelineSummary:
        """Return what was seen of clock and samples so far."""
        return self._timeline.summary()

    def snapshot(self) -> Characterization:
        """Return an independent copy, which can be fitted in another thread."""
        twin = Characterization(kind=self._kind, path=self._path, topic=self._topic)
        twin._timeline = self._timeline.copy()
        twin._estimator = None if self._estimator is None else self._estimator.copy()
        twin._columns, twin._next = self._columns, self._next
        twin._thermometer, twin._epoch_ns = self._thermometer.copy(), self._epoch_ns
        return twin

    @property
    def path(self) -> str | None:
        """Path of the recording."""
        return self._path

    @property
    def topic(self) -> str | None:
        """Topic that the samples come from."""
        return self._topic

    def record(self) -> Record | None:
        """Return what was taken in, the stream being left as it is; None before a sample came."""
        twin = self.snapshot()
        twin.finish()
        summary = twin.summary()
        rate = summary.timeline.sample_rate_hz
        if twin._estimator is None or rate is None:
            return None
        return Record(summary, rate, [list(AXES)[column] for column in twin._columns],
                      twin._estimator.finished())

    def result(self, remarks: Iterable[Remark] = ()) -> Result:
        """
        Fit what has come so far; the stream is left as it is.

        Parameters
        ----------
        remarks : iterable of Remark, optional
            Findings of the front door, such as a truncated recording; they come first.

        Returns
        -------
        Result
            Without axes as long as no sample has come.

        Raises
        ------
        ImuAllanError
            If a recording is mostly motion.

        """
        twin = self.snapshot()
        twin.finish()
        summary = twin.summary()
        if summary.mostly_motion and self._kind == 'recording':
            raise ImuAllanError(
                f'{self._path}, topic {self._topic}: the IMU moves during most of the recording; '
                'record it at rest, choose a still part with --start and --duration, or keep '
                'everything with --motion keep')
        axes, found = twin._axes(summary)
        source = Source(self._kind, self._path, self._topic, summary.frame_id,
                        summary.start_time, summary.clock)
        return Result(__version__, source, summary.timeline, axes,
                      (*remarks, *summary.remarks, *found),
                      temperature=twin._shown_temperature(summary))

    def _shown_temperature(self, summary: TimelineSummary) -> Signal | None:
        """Return the temperature over time, as a picture shows it."""
        rate = summary.timeline.sample_rate_hz
        if self._estimator is None or rate is None:
            return None
        return self._thermometer.signal(self._estimator.finished().signal.columns(), 1 / rate)

    def _axes(self, summary: TimelineSummary) -> tuple[dict[str, AxisResult], list[Remark]]:
        rate = summary.timeline.sample_rate_hz
        if self._estimator is None:
            return {}, []
        if rate is None:
            return {}, [Remark('unknown_rate',
                               'the sample rate cannot be told from so few stamps')]
        names = [list(AXES)[column] for column in self._columns]
        finished = self._estimator.finished()
        series = finished.periodogram
        heat = self._thermometer.temperature(series.series, series.cell, 1 / rate)
        fitted = axis_results(finished, rate, [AXES[name] for name in names],
                              temperature=heat.course if heat is not None else None)
        axes = {name: axis for name, (axis, _) in zip(names, fitted, strict=True)}
        if self._kind == 'recording':
            # It takes a tenth of a second, which a node does not spend at every publication.
            tested = backtest(series.series, series.cell, 1 / rate)
            axes = {name: replace(axis, backtest=found if axis.drift_model else None)
                    for (name, axis), found in zip(axes.items(), tested, strict=True)}
        remarks = [Remark(remark.code, f'{name}: {remark.message}')
                   for name, (_, own) in zip(names, fitted, strict=True) for remark in own]
        unclear = {name for name, (_, own) in zip(names, fitted, strict=True)
                   if any(remark.code in MEAN_MOVES for remark in own)}
        remarks += thermometer_remarks(heat) if heat is not None else []
        return axes, remarks + length_remarks(axes, summary, unclear)

    def _absorb(self, blocks: Iterable[EvenBlock], epoch_ns: int | None) -> None:
        """Take in even blocks; `epoch_ns`: of the timeline before it gave them."""
        if self._epoch_ns is None:
            self._epoch_ns = epoch_ns if epoch_ns is not None else self._timeline.epoch_ns
        for block in blocks:
            if not len(block):
                continue
            if block.restart:
                self._estimator = None
                self._thermometer.forget_samples()
            if block.new_run:
                # A jump of the clock begins a run, and what was held back belongs before it.
                self._epoch_ns = self._timeline.epoch_ns
            skipped = 0
            if self._estimator is None:
                self._columns = np.flatnonzero(np.isfinite(block.samples[0]))
                self._estimator = Estimator(len(self._columns))
                # What was left out at the very beginning is time, too.
                self._estimator.signal.skip(block.first_index)
                skipped = block.first_index
            elif block.new_run:
                self._estimator.start_run()
            elif block.first_index > self._next:
                skipped = block.first_index - self._next
                self._estimator.skip(skipped)
            self._note_place(self._estimator, block, skipped)
            samples = block.samples
            if len(self._columns) < samples.shape[1]:
                samples = samples[:, self._columns]
            self._estimator.update(samples, block.bridged)
            self._next = block.first_index + len(block)

    def _note_place(self, estimator: Estimator, block: EvenBlock, skipped: int) -> None:
        """Tell the thermometer where the samples of a block lie on the clock."""
        interval, epoch = self._timeline.interval_ns, self._epoch_ns
        first = last = None
        if epoch is not None and interval is not None:
            first = epoch + round(block.start_s * 1e9)
            last = first + round((len(block) - 1) * interval)
        self._thermometer.place(*estimator.next_place, len(block), skipped, first, last)

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """
        Return everything needed to go on later.

        Returns
        -------
        dict of str to ndarray
            No object arrays, so that it can be stored without pickle.

        """
        about = {'kind': self._kind, 'path': self._path, 'topic': self._topic,
                 'next': self._next, 'columns': self._columns.tolist(),
                 'epoch_ns': self._epoch_ns}
        state: dict[str, NDArray[np.generic]] = {'about': np.array(json.dumps(about))}
        state.update({f'timeline/{key}': value
                      for key, value in self._timeline.to_state().items()})
        state.update({f'thermometer/{key}': value
                      for key, value in self._thermometer.to_state().items()})
        if self._estimator is not None:
            state.update({f'estimator/{key}': value
                          for key, value in self._estimator.to_state().items()})
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
                self._next = int(about['next'])
                self._columns = np.array(about['columns'], dtype=np.int64)
                self._timeline = TimelineStage.from_state(part('timeline'))
                self._epoch_ns = about.get('epoch_ns')
                # A state from before there were temperatures has none.
                if thermometer := part('thermometer'):
                    self._thermometer = Thermometer.from_state(thermometer)
                estimator = part('estimator')
                if estimator:
                    self._estimator = Estimator.from_state(estimator)
                    if self._estimator.axes != len(self._columns):
                        raise ValueError('axes of the estimator and their names differ in number')
        except (KeyError, TypeError, ValueError, ArithmeticError) as error:
            raise ImuAllanError(f'saved characterization is damaged: {error}') from error
        return self
