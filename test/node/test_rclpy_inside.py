# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is taken from inside rclpy is there, and does what the node relies on."""

from pathlib import Path
import re

from imu_allan.node import rclpy_inside
import pytest
import rclpy
from rclpy.context import Context
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from ros_harness import Ros
from sensor_msgs.msg import Imu

PACKAGE = Path(rclpy_inside.__file__).parents[1]


def test_the_queue_of_a_subscription_gives_bytes_with_receipt_and_number(ros: Ros) -> None:
    publisher = ros.node.create_publisher(Imu, ros.name('imu'), 10)
    subscription = ros.node.create_subscription(Imu, ros.name('imu'), lambda _: None, 10, raw=True,
                                                callback_group=rclpy_inside.OutOfWaitSet())
    ros.until(publisher.get_subscription_count)
    publisher.publish(Imu())
    publisher.publish(Imu())
    found: list[rclpy_inside.Taken] = []

    def came() -> bool:
        found.extend(rclpy_inside.drain(subscription, Imu, 10))
        return len(found) == 2

    # The executor spins meanwhile, and takes none.
    ros.until(came)
    assert all(isinstance(message, bytes) for message, _ in found), 'take_message(raw)'
    assert [info['publication_sequence_number'] for _, info in found] == [1, 2]
    assert all(info['received_timestamp'] > info['source_timestamp'] > 0 for _, info in found)
    assert rclpy_inside.drain(subscription, Imu, 10) == [], 'None where nothing waits'


def publish_often(publisher: Publisher, count: int) -> None:
    message = serialize_message(Imu())
    for _ in range(count):
        publisher.publish(message)


def test_wrong_arguments_and_full_queues_raise_the_errors_that_are_caught(ros: Ros) -> None:
    for arguments, error in ((['--ros-args', '-p', 'x'], rclpy_inside.RCLError),
                             (['--ros-args', '--nonsense'], rclpy_inside.UnknownROSArgsError)):
        with pytest.raises((rclpy_inside.RCLError, rclpy_inside.UnknownROSArgsError)) as raised:
            rclpy.init(args=arguments, context=Context(),
                       signal_handler_options=SignalHandlerOptions.NO)
        assert isinstance(raised.value, error), arguments
    # A subscription that keeps all and from which nobody takes.
    subscription = ros.recorder('full')
    publisher = ros.node.create_publisher(Imu, ros.name('full'), QoSProfile(
        history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE))
    ros.until(publisher.get_subscription_count)
    with pytest.raises(rclpy_inside.RCLError):
        publish_often(publisher, 100_000)
    assert subscription.take().messages


def test_nothing_else_looks_inside_rclpy() -> None:
    inside = re.compile(r'rclpy\._|rclpy\.impl\b|_parameter_overrides|'
                        r'take_message\(|\._rclpy|executor\.fset')
    assert [path.name for path in sorted((PACKAGE / 'node').glob('*.py'))
            if inside.search(path.read_text())] == ['rclpy_inside.py']
