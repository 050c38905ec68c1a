# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Once a second: what is true now, for the log and for who listens to ``/diagnostics``."""

import time

from imu_allan.errors import ImuAllanError
from imu_allan.node.announcements import Announcements, SILENCE_S
from imu_allan.node.diagnostics import diagnostics_message, Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.log import Log
from imu_allan.node.publications import Publications
from imu_allan.node.run import Run
from imu_allan.result import Result
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import counted
from rclpy.node import Node

REPORT_S = 1.0
"""The period of diagnostic_updater; an aggregator calls a status stale after 5 s."""
LOOK_S = 10.0
"""The log looks at the timeline so often where no report does: a copy each time."""


class Reports:
    """
    Gathers what is reported.

    Parameters
    ----------
    node : rclpy.node.Node
        Asked who else is there.
    topic, type_name : str
        Of the IMU; the topic as the node names it before remapping.
    subscription : DrainedSubscription
    publications : Publications
    facts : Facts
        Brought up to date here.
    announcements : Announcements
        Told of all that was seen.
    log : Log

    """

    def __init__(self, node: Node, topic: str, type_name: str,
                 subscription: DrainedSubscription, publications: Publications, facts: Facts,
                 announcements: Announcements, log: Log) -> None:
        self._node = node
        self._topic, self._type_name = topic, type_name
        self._subscription = subscription
        self._publications = publications
        self._facts = facts
        self._announcements = announcements
        self._log = log
        self._last = self._last_look = time.monotonic()
        self._last_complaint = self._last - 6 * SILENCE_S
        self._last_cpu, self._last_received = time.process_time(), 0

    @property
    def _kind(self) -> str:
        return self._type_name.rpartition('/')[2]

    def due(self, now: float) -> bool:
        """Whether it is time for the next report."""
        return now - self._last >= REPORT_S

    def report(self, now: float, run: Run, result: Result | None, last_message: float,
               checkpoint_age_s: float | None) -> None:
        """Bring the facts up to date, tell the log, and whoever listens."""
        facts = self._facts
        facts.publishers = self._subscription.publishers
        facts.silent_s = now - last_message
        facts.checkpoint_age_s = checkpoint_age_s
        cpu, received = time.process_time(), facts.received - self._last_received
        if received:
            facts.cpu_s = (cpu - self._last_cpu) / received
        facts.received_hz = received / (now - self._last)
        self._last, self._last_cpu = now, cpu
        self._last_received = facts.received
        if not facts.publishers:
            facts.refused = self._subscription.refused_publishers()
        names = self._subscription.publisher_names() if facts.publishers > 1 else []
        self._announcements.see_reception(facts, names)
        if facts.silent_s > SILENCE_S and now - self._last_complaint > 6 * SILENCE_S:
            self._last_complaint = now
            self._complain_of_silence()
        self._announcements.see_progress(now, facts, result)
        watched = bool(self._publications.diagnostics.get_subscription_count())
        waited_for = facts.received > 0 and not self._announcements.has_begun
        if watched or waited_for or now - self._last_look >= LOOK_S:
            self._last_look = now
            summary = self._look(now, run)
            if watched:
                self._publications.diagnostics.publish(diagnostics_message(
                    self._node.get_fully_qualified_name(), self._node.get_clock().now().to_msg(),
                    facts, summary, result))
                facts.longest_hold_s = 0.0

    def _look(self, now: float, run: Run) -> TimelineSummary:
        """Look at names and timeline, and tell the log of it."""
        facts, node = self._facts, self._node
        own = node.get_name(), node.get_namespace()
        facts.namesakes = node.get_node_names_and_namespaces().count(own) - 1
        snapshot = run.characterization.snapshot()
        try:
            snapshot.finish()
        except ImuAllanError as error:
            # The samples that the timeline holds back are of no use; the next ones may be.
            facts.update_error = str(error)
            self._log.error(facts.update_error)
        else:
            facts.update_error = ''
        summary = snapshot.summary()
        facts.moved_s = summary.excluded_s
        self._announcements.see_timeline(now, facts, summary)
        return summary

    def _complain_of_silence(self) -> None:
        topic, facts = self._subscription.topic, self._facts
        others = [name for name, types in self._node.get_topic_names_and_types()
                  if self._type_name in types and name != topic
                  and self._node.count_publishers(name)]
        text = f'no message on {topic} for {facts.silent_s:.0f} s'
        if facts.publishers:
            text += f', though there is {counted(facts.publishers, "publisher")}'
        elif facts.refused:
            text += f'; {"; ".join(facts.refused)}'
        elif others:
            text += (f'; {self._kind} topics here: {", ".join(sorted(others))}; choose one with '
                     f'--ros-args -r {self._topic}:=TOPIC')
        else:
            text += f'; no node publishes {self._kind} messages'
        self._log.warning(text)
