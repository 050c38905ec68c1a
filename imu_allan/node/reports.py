# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Report the state of the node once a second, to the log and on ``/diagnostics``."""

from collections.abc import Sequence
import time

from imu_allan.errors import ImuAllanError
from imu_allan.node.diagnostics import diagnostics_message, timeline_counts
from imu_allan.node.log import Log
from imu_allan.node.output_topics import OutputTopics
from imu_allan.node.reception import Reception
from imu_allan.node.run import Lane, Run, useless
from imu_allan.result import Result
from imu_allan.timeline import TimelineSummary
from rclpy.node import Node

REPORT_S = 1.0
"""As diagnostic_updater does; an aggregator considers a status stale after 5 s."""
LOOK_S = 10.0
"""Without subscribers, examine the timeline this often for the log: it is copied each time."""


class Reports:
    """Collects, logs and publishes the facts about each topic."""

    def __init__(self, node: Node, receptions: Sequence[Reception], outputs: OutputTopics,
                 log: Log) -> None:
        self._node = node
        self._receptions = receptions
        self._outputs = outputs
        self._log = log
        self._last = self._last_look = time.monotonic()
        self._last_cpu = time.process_time()

    def due(self, now: float) -> bool:
        """Return whether it is time for the next report."""
        return now - self._last >= REPORT_S

    def report(self, now: float, run: Run, result: Result | None) -> None:
        """Update the facts, write the log, and publish."""
        cpu = time.process_time()
        received = sum([reception.look(now, now - self._last) for reception in self._receptions])
        for reception in self._receptions:
            if received:
                reception.facts.cpu_s = (cpu - self._last_cpu) / received
            reception.changes.see_reception(reception.facts)
        self._last, self._last_cpu = now, cpu
        facts = self._receptions[0].facts
        self._receptions[0].changes.see_progress(now, facts, result)
        watched = bool(self._outputs.diagnostics.get_subscription_count())
        waited_for = any(reception.facts.received > 0 and reception.changes.began is None
                         for reception in self._receptions)
        if watched or waited_for or now - self._last_look >= LOOK_S:
            self._last_look = now
            topics = [(reception.facts, self._look(now, lane, reception))
                      for reception, lane in zip(self._receptions, run.lanes, strict=True)]
            if watched:
                self._outputs.diagnostics.publish(diagnostics_message(
                    self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg(),
                    topics, result))
                for reception in self._receptions:
                    reception.facts.longest_hold_s = 0.0

    def _look(self, now: float, lane: Lane, reception: Reception) -> TimelineSummary:
        """Summarize the timeline, and log what has changed."""
        facts = reception.facts
        snapshot = lane.snapshot().characterization
        try:
            snapshot.finish()
        except ImuAllanError as error:
            # The samples that the timeline holds back are unusable; the next ones may be usable.
            facts.update_error = useless(error)
            self._log.error(facts.update_error, f'useless samples {facts.topic}')
        else:
            facts.update_error = ''
        summary = snapshot.summary()
        facts.timeline = summary.timeline
        facts.recent.see(now, timeline_counts(summary), known=facts.on_probation)
        reception.changes.see_timeline(now, facts, summary)
        return summary
