# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whoever calls a service is answered, however many call at once.

What the middleware does alone loses requests and answers without a word: its queues hold ten.
"""

import time

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

REQUESTS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
"""Requests that wait for their turn; of those beyond it the first would be dropped."""
ANSWER_S = 0.01
"""From one answer to the next: ten, the queue of an ordinary client, take a tenth of a second."""


class Callers(ReentrantCallbackGroup):
    """Those whose requests have been taken and not been answered."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        self.waiting = 0
        self._answered = 0.0
        # Wakes the executor, which then asks those who wait.
        self._turns = node.create_timer(ANSWER_S, self._rest_if_alone, callback_group=self,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._turns.cancel()

    def can_execute(self, entity: object) -> bool:
        """Leave further requests in their queue while many wait: each is asked at every turn."""
        return self.waiting < 100 or entity is self._turns

    def _rest_if_alone(self) -> None:
        if not self.waiting:
            self._turns.cancel()

    def may_answer(self) -> bool:
        """Whether it is the turn of whoever asks, who is woken again if it is not."""
        now = time.monotonic()
        if now - self._answered < ANSWER_S:
            if self._turns.is_canceled():
                self._turns.reset()
            return False
        self._answered = now
        return True
