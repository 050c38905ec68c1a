# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Services whose answers wait for the worker, however many clients call at once.

With its default queues of ten the middleware silently drops requests and answers.
"""

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, wait
import time
from typing import Any

from imu_allan.errors import printable
from imu_allan.node.rclpy_inside import AnyExecutorNode
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.qos import QoSProfile, ReliabilityPolicy

ANSWER_S = 0.01
"""Time between two answers: ten, which fill the queue of an ordinary client, take 0.1 s."""


class ServiceCalls(ReentrantCallbackGroup):
    """The callback group of the services, which counts the callers that wait for an answer."""

    def __init__(self, node: AnyExecutorNode) -> None:
        super().__init__()
        self._node = node
        self._waiting = 0
        self._answered = 0.0
        # Wakes the executor, which then resumes the waiting services.
        self._turns = node.create_timer(ANSWER_S, self._rest_if_alone, callback_group=self,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._turns.cancel()

    def offer(self, kind: type, name: str, serve: Callable[..., Coroutine[Any, Any, Any]]) -> None:
        """Offer a service that may wait for the worker while samples come in."""
        # Up to this many requests wait for their turn; beyond it the oldest would be dropped.
        queue = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
        self._node.serve_waiting(kind, name, serve, qos_profile=queue, callback_group=self)

    async def failure(self, future: 'Future[Any]') -> str | None:
        """Wait for the worker and for the caller's turn; return what went wrong, or None."""
        executor = self._node.executor
        if isinstance(executor, Executor):
            future.add_done_callback(lambda _: executor.wake())
        else:
            wait([future])
        self._waiting += 1
        try:
            while not (future.done() and self._may_answer()):
                # Continues at the executor's next wake-up.
                await asyncio.sleep(0)
        finally:
            # Leave the timer alone: if the node ends meanwhile, it no longer exists here.
            self._waiting -= 1
        error = future.exception()
        return None if error is None else printable(error)

    def can_execute(self, entity: object) -> bool:
        """Leave requests in the queue while many callers wait: each is polled at every wake-up."""
        return self._waiting < 100 or entity is self._turns

    def _rest_if_alone(self) -> None:
        if not self._waiting:
            self._turns.cancel()

    def _may_answer(self) -> bool:
        """Return whether the service that asks may answer now; if not, it is woken again later."""
        now = time.monotonic()
        if now - self._answered < ANSWER_S:
            if self._turns.is_canceled():
                self._turns.reset()
            return False
        self._answered = now
        return True
