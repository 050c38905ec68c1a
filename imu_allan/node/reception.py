# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reception of messages: taken from the queue, counted, and decoded."""

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
        self._waiting: list[tuple[int, Batch]] = []
        self._publishers = Publishers(subscription.publisher_gids)
        self._publisher = self._number = self._received_ns = 0
        self._has_fallen = False
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
        before, self._publisher = self._publisher, self._publishers.sender(
            int(batch.receive_ns[0]), int(batch.receive_ns[-1]))
        # Messages that are passed over do not count as lost.
        self._see_numbers(batch, is_new=self._publisher != before)
        self.last_message = now
        if facts.paused:
            facts.skipped += len(batch.messages)
        elif facts.mixed:
            facts.mixed_samples += len(batch.messages)
        else:
            self._waiting.append((self._publisher, batch))
        return len(batch.messages)

    def publishers(self) -> int:
        """Count the matched publishers, without those that were killed and replaced."""
        return min(self.subscription.publishers, self._publishers.count())

    def blocks(self) -> list[tuple[int, list[ImuBlock]]]:
        """Decode the messages taken so far, each batch with its publisher."""
        waiting, self._waiting = self._waiting, []
        return [(publisher, self._decode(batch.messages, batch.receive_ns, self._count_malformed))
                for publisher, batch in waiting]

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

    def _see_numbers(self, batch: Batch, is_new: bool) -> None:
        """Count lost messages, and note whether those of two publishers are mixed."""
        numbers, had_fallen = batch.numbers, self._has_fallen
        if numbers is None:
            return
        steps = np.diff(numbers, prepend=numbers[0] - 1 if is_new else self._number)
        self._number, falls = int(numbers[-1]), int((steps < 1).sum())
        self._has_fallen = falls > 0
        # The numbers fall once if a driver restarts, and again and again if two publishers mix.
        self.facts.mixed = falls > 1 or (falls == 1 and had_fallen)
        if not (falls or had_fallen):
            self.facts.lost += int(steps.sum()) - len(steps)

    def _count_malformed(self, count: int, error: MalformedImu) -> None:
        self.facts.malformed += count
        self.facts.malformed_why = str(error)
