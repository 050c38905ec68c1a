# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Everything that is taken from inside rclpy: what it does not document, and may change.

`test/node/test_rclpy_inside.py` holds rclpy to it, and names what breaks.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

RCLError: type[Exception] = rclpy_implementation.RCLError
"""What the C library of ROS refuses, such as arguments, or a full queue."""
UnknownROSArgsError: type[Exception] = rclpy_implementation.UnknownROSArgsError

Info = dict[str, Any]


class Taken(NamedTuple):
    """Messages, and what the middleware says of each."""

    messages: list[bytes]
    infos: list[Info]


class OutOfWaitSet(CallbackGroup):
    """Never lets an executor with a wait set wait for a subscription of it."""

    def can_execute(self, _: object) -> bool:
        """Refuse."""
        return False


def drain(subscription: Subscription, msg_type: type, most: int) -> Taken:
    """Take what waits in the queue of the middleware, at most so many messages."""
    messages: list[bytes] = []
    infos: list[Info] = []
    handle = subscription.handle
    with handle:
        take = handle.take_message
        for _ in range(most):
            item = take(msg_type, True)
            if item is None:
                break
            message, info = item
            messages.append(message)
            infos.append(info)
    if messages:
        if not isinstance(messages[0], bytes):
            raise TypeError('take_message did not return bytes')
        infos[0]['received_timestamp']
    return Taken(messages, infos)


def given_parameters(node: Node) -> Mapping[str, Any]:
    """Return the parameters that a node was started with, declared or not; empty if unknown."""
    given: Mapping[str, Any] = getattr(node, '_parameter_overrides', {})
    return given
