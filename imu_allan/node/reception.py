# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reception of messages: taken from the queue, counted, and decoded by publisher."""

from collections.abc import Mapping
from math import ceil
import time
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import Half, ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.errors import ImuAllanError
from imu_allan.node.drained_subscription import Batch, DrainedSubscription
from imu_allan.node.facts import Facts
from imu_allan.node.imu_type import Decode, decoder, message_class
from imu_allan.node.log import Log
from imu_allan.node.log_of_changes import LogOfChanges
from imu_allan.node.parameters import TOPIC
from imu_allan.node.sequence_numbers import Publishers
from imu_allan.wording import counted
import numpy as np
from rclpy.node import Node

QUEUE_MESSAGES = 10_000
"""The queue holds at least this many messages: 2 s of an IMU at 5 kHz."""


class Reception:
    """Takes, counts and decodes the messages on one topic of the IMU."""

    def __init__(self, node: Node, log: Log, topic: str, half: Half | None,
                 values: Mapping[str, Any]) -> None:
        parameter = 'accel_type' if half == 'accel' and values['accel_type'] else 'imu_type'
        self._decode = _decoder(parameter, half, values)
        expected = 0.0 if half == 'accel' else values['expected_rate']
        # 2.5 s of samples, which late ticks do not exceed.
        queue = max(QUEUE_MESSAGES, ceil(2.5 * expected))
        self.subscription = DrainedSubscription(node, message_class(values[parameter]), topic,
                                                queue, f'{half}_topic')
        self.facts = Facts(self.subscription.topic, self.subscription.depth, expected, half)
        self.changes = LogOfChanges(log, self.facts.topic)
        self._node = node
        self._waiting: list[tuple[Ints, Batch]] = []
        self._publishers = Publishers(self.subscription.publisher_gids)
        # Number of messages at the last look.
        self._seen = 0
        self._passed_over = 0
        self._mixed_until = 0.0
        self.last_take = self.last_message = 0.0

    def take(self, now: float) -> int:
        """Take the waiting messages and return their number; pass over those during a pause."""
        batch, facts = self.subscription.take(), self.facts
        facts.longest_hold_s = max(facts.longest_hold_s, now - self.last_take)
        facts.received += len(batch.messages)
        facts.overrun += batch.full
        self.last_take = now
        if not batch.messages:
            return 0
        self.last_message = now
        # Messages that are passed over do not count as lost.
        keys, lost = self._publishers.of(batch.numbers, batch.receive_ns)
        facts.lost += lost
        if facts.paused:
            facts.skipped += len(batch.messages)
        else:
            self._waiting.append((keys, batch))
        return len(batch.messages)

    def blocks(self, now: float) -> list[tuple[int, list[ImuBlock]]]:
        """Decode the messages taken so far, by publisher."""
        waiting, self._waiting = self._waiting, []
        facts = self.facts
        if facts.mixed_samples > self._passed_over:
            # Report the condition for five seconds after the last such message.
            self._passed_over, self._mixed_until = facts.mixed_samples, now + 5.0
        facts.mixed = now < self._mixed_until
        return [(key, self._decoded(batch, np.flatnonzero(keys == key)))
                for keys, batch in waiting for key in dict.fromkeys(keys.tolist())]

    def drop(self) -> None:
        """Discard the messages that have been taken but not decoded yet."""
        self._waiting = []

    def _decoded(self, batch: Batch, rows: Ints) -> list[ImuBlock]:
        return self._decode([batch.messages[row] for row in rows.tolist()],
                            batch.receive_ns[rows], self._count_malformed)

    def _count_malformed(self, count: int, error: MalformedImu) -> None:
        self.facts.malformed += count
        self.facts.malformed_why = str(error)

    def look(self, now: float, elapsed_s: float) -> int:
        """Update what is known of the publishers; return the messages since the last look."""
        facts, subscription = self.facts, self.subscription
        new, self._seen = facts.received - self._seen, facts.received
        facts.received_hz = new / elapsed_s
        # Killed ones stay matched for a while, so they count only if none sends.
        facts.publishers = self._publishers.delivering(time.time_ns()) or subscription.publishers
        facts.refused = [] if facts.publishers else subscription.refused_publishers()
        facts.publisher_names = subscription.publisher_names() if facts.publishers > 1 else []
        facts.silent_s = now - self.last_message
        # Longer than a Wi-Fi dropout, yet short enough to notice a dead sensor early. Chosen by
        # judgment.
        facts.silence_why = self._cause_of_silence() if facts.silent_s > 5.0 else None
        facts.recent.see(now, {'lost': facts.lost, 'malformed': facts.malformed,
                               'overrun': facts.overrun})
        return new

    def _cause_of_silence(self) -> str:
        facts, kind = self.facts, self.subscription.type_name
        if facts.publishers:
            return f', though it has {counted(facts.publishers, "publisher")}'
        if facts.refused:
            return f'; {"; ".join(facts.refused)}'
        name_of_kind = kind.rpartition('/')[2]
        others = [name for name, types in self._node.get_topic_names_and_types()
                  if kind in types and name != facts.topic and kind in [
                      one.topic_type for one in self._node.get_publishers_info_by_topic(name)]]
        if others:
            remedy = f'-p {facts.half}_topic' if facts.half else f'-r {TOPIC}'
            return (f'; {name_of_kind} topics here: {", ".join(sorted(others))}; choose one with '
                    f'--ros-args {remedy}:=TOPIC')
        return f'; no node publishes {name_of_kind} messages'


def _decoder(parameter: str, half: Half | None, values: Mapping[str, Any]) -> Decode:
    """Return the decoder that the parameters ask for, or name the one that is wrong."""
    # Fields of the other sensor are not in these messages.
    fields = {part: values[f'{part}_field'] for part in ('gyro', 'accel', 'stamp')
              if half is None or part in (half, 'stamp')}
    try:
        return decoder(values[parameter], **fields, gyro_unit=values['gyro_unit'],
                       accel_unit=values['accel_unit'])
    except ImuAllanError as error:
        # One of a field or unit begins with the name of its own parameter.
        named = str(error).partition(' ')[0] in values
        raise ImuAllanError(f'parameter {error}' if named else
                            f'parameter {parameter}: {error}') from error
