# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Answers to service calls, however many clients call at once.

With its default queues of ten the middleware silently drops requests and answers.
"""

import time

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

REQUESTS = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
"""Up to this many requests wait for their turn; beyond it the oldest would be dropped."""
ANSWER_S = 0.01
"""Time between two answers: ten, which fill the queue of an ordinary client, take 0.1 s."""


class Callers(ReentrantCallbackGroup):
    """The callback group of the services, which counts the callers that wait for an answer."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        self.waiting = 0
        self._answered = 0.0
        # Wakes the executor, which then resumes the waiting services.
        self._turns = node.create_timer(ANSWER_S, self._rest_if_alone, callback_group=self,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._turns.cancel()

    def can_execute(self, entity: object) -> bool:
        """Leave requests in the queue while many callers wait: each is polled at every wake-up."""
        return self.waiting < 100 or entity is self._turns

    def _rest_if_alone(self) -> None:
        if not self.waiting:
            self._turns.cancel()

    def may_answer(self) -> bool:
        """Return whether the service that asks may answer now; if not, it is woken again later."""
        now = time.monotonic()
        if now - self._answered < ANSWER_S:
            if self._turns.is_canceled():
                self._turns.reset()
            return False
        self._answered = now
        return True
