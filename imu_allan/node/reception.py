# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reception of messages: taken from the queue, counted, and decoded by publisher."""

import time

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.node.announcements import Announcements
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import Batch, DrainedSubscription
from imu_allan.node.imu_type import Decode
from imu_allan.node.publishers import Publishers
import numpy as np


class Reception:
    """Takes, counts and decodes the messages of one subscription."""

    def __init__(self, subscription: DrainedSubscription, facts: Facts, decode: Decode,
                 announcements: Announcements) -> None:
        self.subscription = subscription
        self.facts = facts
        self.announcements = announcements
        # As of the last report: the number of messages, and the cause of silence.
        self.reported, self.complaint = 0, ''
        self._decode = decode
        self._waiting: list[tuple[Ints, Batch]] = []
        self._publishers = Publishers(subscription.publisher_gids)
        self._passed_over = 0
        self._mixed_until = 0.0
        self._received_ns = 0
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
        self._look_for_pause(batch, now)
        # Messages that are passed over do not count as lost.
        keys, lost = self._publishers.of(batch.numbers, batch.receive_ns)
        facts.lost += lost
        self.last_message = now
        if facts.paused:
            facts.skipped += len(batch.messages)
        else:
            self._waiting.append((keys, batch))
        return len(batch.messages)

    def publishers(self) -> int:
        """Count publishers that send or, if none, matched ones; killed ones stay matched."""
        return self._publishers.delivering(time.time_ns()) or self.subscription.publishers

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

    def _look_for_pause(self, batch: Batch, now: float) -> None:
        facts = self.facts
        if self._received_ns:
            # The shorter of the two: the node may have been delayed, or the wall clock set.
            pause = min(now - self.last_message,
                        float(batch.receive_ns[0] - self._received_ns) * 1e-9)
            facts.pause_s = max(pause, facts.pause_s)
        self._received_ns = int(batch.receive_ns[-1])

    def _decoded(self, batch: Batch, rows: Ints) -> list[ImuBlock]:
        return self._decode([batch.messages[row] for row in rows.tolist()],
                            batch.receive_ns[rows], self._count_malformed)

    def _count_malformed(self, count: int, error: MalformedImu) -> None:
        self.facts.malformed += count
        self.facts.malformed_why = str(error)
