# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
All uses of undocumented internals of rclpy, which may change.

`test/node/test_rclpy_inside.py` checks that they work, and names what breaks.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import islice
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.subscription import Subscription

RCLError: type[Exception] = rclpy_implementation.RCLError
"""Raised where the C library of ROS refuses something, such as arguments or a full queue."""
UnknownROSArgsError: type[Exception] = rclpy_implementation.UnknownROSArgsError

Logger = RcutilsLogger
"""The type of what `Node.get_logger` returns."""


class OutOfWaitSet(CallbackGroup):
    """Callback group whose subscriptions stay out of an executor's wait set."""

    def can_execute(self, _: object) -> bool:
        """Return False for every entity."""
        return False


def drain(subscription: Subscription, msg_type: type, most: int
          ) -> list[tuple[bytes, dict[str, Any]]]:
    """Take at most `most` of the messages that wait in the middleware, with its metadata."""
    handle = subscription.handle
    with handle:
        return list(islice(iter(partial(handle.take_message, msg_type, True), None), most))


class AnyExecutorNode(Node):
    """A node whose `OutOfWaitSet` also works in an EventsExecutor."""

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Those for the executor to take from; an EventsExecutor ignores callback groups."""
        return (one for one in super().subscriptions
                if not isinstance(one.callback_group, OutOfWaitSet))


def given_parameters(node: Node) -> Mapping[str, Any]:
    """Return the parameters that a node was started with, declared or not; empty if unknown."""
    given: Mapping[str, Any] = getattr(node, '_parameter_overrides', {})
    return given
