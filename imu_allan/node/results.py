# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Results of the current run: fitted by the worker, published every period, and plotted."""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
import time
from typing import Any

from builtin_interfaces.msg import Time
from imu_allan.node.announcements import Announcements
from imu_allan.node.diagnostics import Facts
from imu_allan.node.publications import Publications
from imu_allan.node.result_messages import Filter, result_messages
from imu_allan.node.run import Run
from imu_allan.node.standards import Comparison, Standards
from imu_allan.node.worker import Worker
from imu_allan.result import Result
from sensor_msgs.msg import CompressedImage

FIT_GROWTH = 0.2
"""The next fit waits until the record has grown by this, which narrows intervals by 9 %."""


@dataclass(frozen=True)
class _Fit:
    """What a fit gives, and the time that it took."""

    result: Result
    of_lanes: list[Result]
    messages: Mapping[str, Any]
    comparisons: list[Comparison]
    took_s: float
    cpu_s: float


class Results:
    """Fits the current run, and publishes and plots the results."""

    def __init__(self, node_name: str, publications: Publications, worker: Worker, facts: Facts,
                 announcements: Announcements, values: Mapping[str, Any]) -> None:
        self._node_name = node_name
        self._publications = publications
        self._worker = worker
        self._facts = facts
        self._announcements = announcements
        self._standards = Standards(values['spec_file'], values['reference'])
        self.filter_of = Filter(values['aiding_interval'], values['coast'])
        self.latest: Result | None = None
        self._plotted: Result | None = None
        self._fitted_s = self._rested = 0.0
        self.publish_every(values['publish_period'])

    def publish_every(self, period_s: float) -> None:
        """Set the period of publication, which starts now."""
        self._period_s = period_s
        self._next_publication = time.monotonic() + period_s

    def begin_run(self) -> None:
        """Forget the results of the previous run."""
        self.latest = self._plotted = None
        self._facts.comparisons = []
        self._fitted_s = self._rested = 0.0

    def due(self, now: float) -> bool:
        """Return whether it is time to publish; true once per period."""
        if now < self._next_publication:
            return False
        # On a fixed grid, so that a period that is no multiple of the tick holds on average.
        periods = (now - self._next_publication) // self._period_s + 1
        self._next_publication += periods * self._period_s
        return True

    def publish_or_fit(self, now: float, run: Run, last_message: float) -> None:
        """Start a new fit if one is due; otherwise serve the last result to new subscribers."""
        # After this long without a sample, a final fit includes all samples so far.
        settled = now - last_message > 2.0
        if self._worker.under_way('fit'):
            return
        # An early result is of little use: replace it when the record is three times as long.
        growth = 1 + FIT_GROWTH if now >= self._rested else 3.0
        if run.fed != run.fitted and (settled or run.span_s >= self._fitted_s * growth):
            self.fit(run, to_the_end=settled)
        else:
            self._publications.serve_newcomers()

    def fit(self, run: Run, to_the_end: bool = False) -> None:
        """Start a fit; `to_the_end` if no more messages are expected."""
        began = time.monotonic()
        standards, filter_of = self._standards, self.filter_of
        run.fitted = run.fed
        span_s = run.span_s
        snapshot, name, looks = run.snapshot(), self._node_name, run.datasheet_looks
        stamp = run.stamp_ns or time.time_ns()

        def work() -> _Fit:
            started, busy = time.monotonic(), time.thread_time()
            of_lanes, fits = snapshot.fitted()
            fitted = snapshot.as_one(of_lanes)
            result = run.shown_terms.judged(fitted, more_comes=not to_the_end)
            messages = result_messages(result, name, _time(stamp), filter_of)
            comparisons = standards.judge(
                fitted, {lane.half or '': lane.characterization for lane in snapshot.lanes}, looks,
                fits)
            return _Fit(result, of_lanes, messages, comparisons, time.monotonic() - started,
                        time.thread_time() - busy)

        def publish(future: 'Future[_Fit]') -> None:
            if run.over:
                return
            self._facts.fit_error = self._worker.failure('fit', future)
            if self._facts.fit_error:
                return
            done = future.result()
            self.latest, self._facts.fit_s = done.result, done.took_s
            self._facts.comparisons = done.comparisons
            run.learn(done.of_lanes)
            # Fits use at most 1 % of a core: a small computer has a driver to run, too.
            self._fitted_s, self._rested = span_s, began + 100 * done.cpu_s
            self._publications.publish(done.messages)
            self._announcements.see_result(done.result)
            self._announcements.see_comparisons(self._facts)
            self.draw_if_watched(run)

        self._worker.start('fit', work, publish)

    def draw_if_watched(self, run: Run) -> None:
        """Plot the last result and publish the plot, if it is new and has subscribers."""
        result, plot = self.latest, self._publications.plot
        if (result is None or not result.axes or result is self._plotted
                or self._worker.under_way('plot') or not plot.get_subscription_count()):
            return
        self._plotted = result
        stamp = _time(run.stamp_ns)

        def draw() -> CompressedImage:
            from imu_allan.writers.plot import overview_figure, render
            image = CompressedImage(format='png', data=render(overview_figure(result), 'png', 100))
            image.header.stamp = stamp
            image.header.frame_id = result.source.frame_id or ''
            return image

        def show(future: 'Future[CompressedImage]') -> None:
            if not self._worker.failure('plot', future):
                plot.publish(future.result())

        self._worker.start('plot', draw, show)


def _time(stamp_ns: int) -> Time:
    # The nanoseconds of a corrupt stamp may carry its seconds beyond the range of the message.
    seconds, nanoseconds = divmod(min(stamp_ns, 2**31 * 1_000_000_000 - 1), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
