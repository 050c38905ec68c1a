# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What comes in: taken from the queue, counted, decoded, and passed over where it must not be used.

Samples of two publishers look like one sensor with the noise of both. The numbers that every
publisher gives its messages tell them apart: those of one publisher only rise.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import Batch, DrainedSubscription
from imu_allan.node.imu_type import Decode
import numpy as np
from numpy.typing import NDArray

MIXED_STEPS = 2
"""So many falling numbers within `MIXED_WITHIN_S` mean two publishers; a restart makes one."""
MIXED_WITHIN_S = 2.0
"""Two publishers of 1 Hz and more make two falls in it; a driver restarts more slowly."""
MIXED_FOR_S = 5.0
"""Samples count as mixed for so long after the last falling number."""


class Reception:
    """
    Empties the subscription at leisure.

    Parameters
    ----------
    subscription : DrainedSubscription
        Where messages wait.
    facts : Facts
        Where they are counted.
    decode : Decode
        For the type of the messages.

    """

    def __init__(self, subscription: DrainedSubscription, facts: Facts, decode: Decode) -> None:
        self.subscription = subscription
        self.facts = facts
        self._decode = decode
        self._waiting: list[Batch] = []
        self._falls: list[float] = []
        self._mixed_until = -inf
        self._received_ns = 0
        self.last_take = self.last_message = 0.0

    def take(self, now: float) -> int:
        """Take what has come, and return how much; what comes in a pause is passed over."""
        batch, facts = self.subscription.take(), self.facts
        facts.longest_hold_s = max(facts.longest_hold_s, now - self.last_take)
        facts.received += len(batch.messages)
        facts.lost += batch.lost
        facts.overrun += batch.full
        self.last_take = now
        if not batch.messages:
            return 0
        self._look_for_pause(batch, now)
        self.last_message = now
        self._look_for_mixing(batch, now)
        if facts.paused:
            facts.skipped += len(batch.messages)
        else:
            self._waiting.append(batch)
        return len(batch.messages)

    def blocks(self, now: float) -> list[ImuBlock]:
        """Decode what waits and give what may be used."""
        batches, self._waiting = self._waiting, []
        if not batches:
            return []
        messages = [message for batch in batches for message in batch.messages]
        receive_ns = np.concatenate([batch.receive_ns for batch in batches])
        blocks = _numbered(self._decode(messages, receive_ns, self._count_malformed),
                           [batch.numbers for batch in batches])
        self.facts.mixed = now < self._mixed_until
        # Of publishers with frame_ids of their own the timeline keeps to the first.
        if self.facts.mixed and len({block.frame_id for block in blocks}) == 1:
            self.facts.mixed_samples += sum(map(len, blocks))
            return []
        return blocks

    def drop(self) -> None:
        """Forget what has been taken and not been used yet."""
        self._waiting = []

    def _look_for_pause(self, batch: Batch, now: float) -> None:
        facts = self.facts
        if self._received_ns:
            # A node that was held up finds a full queue; a wall clock may have been set.
            pause = min(now - self.last_message,
                        float(batch.receive_ns[0] - self._received_ns) * 1e-9)
            facts.pause_s = max(pause, facts.pause_s)
            facts.restarts += batch.interleaved
        self._received_ns = int(batch.receive_ns[-1])

    def _look_for_mixing(self, batch: Batch, now: float) -> None:
        self._falls = [at for at in self._falls if now - at < MIXED_WITHIN_S]
        self._falls += [now] * min(batch.interleaved, MIXED_STEPS)
        if batch.interleaved and len(self._falls) >= MIXED_STEPS:
            self._mixed_until = now + MIXED_FOR_S

    def _count_malformed(self, count: int, error: MalformedImu) -> None:
        self.facts.malformed += count
        self.facts.malformed_why = str(error)


def _numbered(blocks: list[ImuBlock], batches: Sequence[NDArray[np.int64] | None]
              ) -> list[ImuBlock]:
    """Give each sample the number of its message, where both are known to go together."""
    known = [numbers for numbers in batches if numbers is not None]
    if len(known) < len(batches) or sum(map(len, known)) != sum(map(len, blocks)):
        # A message that was left out, or held several samples, says no longer which is which.
        return blocks
    numbers, first, numbered = np.concatenate(known), 0, []
    for block in blocks:
        numbered.append(replace(block, numbers=numbers[first:first + len(block)]))
        first += len(block)
    return numbered
