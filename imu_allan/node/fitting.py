# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Fits of the current run: when one is due, and what is published and plotted of it."""

from collections.abc import Mapping
import time
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from imu_allan.characterization.join_results import fitted
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import LogOfChanges
from imu_allan.node.output_topics import OutputTopics, result_messages
from imu_allan.node.run import Run
from imu_allan.node.standards import Comparison, Standards
from imu_allan.node.worker import Worker
from imu_allan.result import Result
from sensor_msgs.msg import CompressedImage

FIT_GROWTH = 0.2
"""The next fit waits until the record has grown by this, which narrows intervals by 9 %."""


class _Fit(NamedTuple):
    """What a fit gives; `messages` are by topic."""

    result: Result
    messages: Mapping[str, Any]
    comparisons: list[Comparison]
    duration_s: float
    cpu_s: float


class Fitting:
    """Fits the current run, and publishes and plots the results."""

    def __init__(self, node_name: str, outputs: OutputTopics, worker: Worker, facts: Facts,
                 changes: LogOfChanges, values: Mapping[str, Any]) -> None:
        self._node_name = node_name
        self._outputs = outputs
        self._worker = worker
        self._facts = facts
        self._changes = changes
        self._values = values
        self._standards = Standards(values['spec_file'], values['reference'])
        self._last_publication = time.monotonic()
        self.begin_run()

    def begin_run(self) -> None:
        """Forget the results of the previous run."""
        self.latest: Result | None = None
        self._plotted: Result | None = None
        self._facts.comparisons = []
        self._fitted_s = self._rested = 0.0

    def due(self, now: float) -> bool:
        """Return whether it is time to publish; true once per period."""
        period_s: float = self._values['publish_period']
        # On a fixed grid, so that a period that is no multiple of the tick holds on average.
        periods = (now - self._last_publication) // period_s
        self._last_publication += periods * period_s
        return periods > 0

    def publish_or_fit(self, now: float, run: Run, last_message: float) -> None:
        """Start a new fit if one is due; otherwise look for new subscribers."""
        # After this long without a sample, a final fit includes all samples so far.
        settled = now - last_message > 2.0
        if self._worker.under_way('fit'):
            return
        # An early result is of little use: replace it when the record is three times as long.
        growth = 1 + FIT_GROWTH if now >= self._rested else 3.0
        if run.fed != run.fitted and (settled or run.span_s >= self._fitted_s * growth):
            self.fit(run, to_the_end=settled)
        else:
            self._outputs.look_for_newcomers()

    def fit(self, run: Run, to_the_end: bool = False) -> None:
        """Start a fit; `to_the_end` if no more messages are expected."""
        began = time.monotonic()
        run.fitted, span_s, snapshot = run.fed, run.span_s, run.snapshot()
        stamp = _time(run.stamp_ns or time.time_ns())
        aiding_s, coast_s = self._values['aiding_interval'], self._values['coast']
        # An accelerometer on a topic of its own has a frame of its own.
        accel_frame_id = next((lane.known.frame_id for lane in run.lanes[1:]), None)

        def work() -> _Fit:
            started, busy = time.monotonic(), time.thread_time()
            found, records = fitted(snapshot)
            result = run.looks.judged(found, more_comes=not to_the_end)
            messages = result_messages(result, self._node_name, stamp, aiding_s, coast_s,
                                       accel_frame_id)
            comparisons = self._standards.judge(found, records, run.datasheet_looks)
            return _Fit(result, messages, comparisons, time.monotonic() - started,
                        time.thread_time() - busy)

        def publish(fit: _Fit) -> None:
            if run.over:
                return
            self.latest = fit.result
            self._facts.comparisons, self._facts.fit_s = fit.comparisons, fit.duration_s
            for lane in run.lanes:
                lane.known.learn(lane.characterization.summary().clock)
            # Fits use at most 1 % of a core: a small computer has a driver to run, too.
            self._fitted_s, self._rested = span_s, began + 100 * fit.cpu_s
            self._outputs.publish(fit.messages)
            self._changes.see_result(self.latest)
            self._changes.see_comparisons(self._facts)
            self.draw_if_watched(run)

        self._worker.start('fit', work, publish)

    def draw_if_watched(self, run: Run) -> None:
        """Plot the last result and publish the plot, if it is new and has subscribers."""
        result = self.latest
        if (result is None or not result.axes or result is self._plotted
                or self._worker.under_way('plot') or not self._outputs.plot_is_watched):
            return
        self._plotted = result
        stamp = _time(run.stamp_ns)

        def draw() -> CompressedImage:
            from imu_allan.writers.plot import overview_figure, render
            image = CompressedImage(format='png', data=render(overview_figure(result), 'png', 100))
            image.header.stamp = stamp
            image.header.frame_id = result.source.frame_id or ''
            return image

        self._worker.start('plot', draw, self._outputs.publish_plot)


def _time(stamp_ns: int) -> Time:
    # The nanoseconds of a corrupt stamp may carry its seconds beyond the range of the message.
    seconds, nanoseconds = divmod(min(stamp_ns, 2**31 * 1_000_000_000 - 1), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
