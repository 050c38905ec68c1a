# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is taken from inside rclpy is there, and does what the node relies on."""

from pathlib import Path
import re

from imu_allan.node import rclpy_inside
from sensor_msgs.msg import Imu

PACKAGE = Path(rclpy_inside.__file__).parents[1]


def test_the_queue_of_a_subscription_gives_bytes_with_receipt_and_number(ros):
    publisher = ros.node.create_publisher(Imu, ros.name('imu'), 10)
    subscription = ros.node.create_subscription(Imu, ros.name('imu'), lambda _: None, 10, raw=True,
                                                callback_group=rclpy_inside.OutOfWaitSet())
    ros.until(publisher.get_subscription_count)
    publisher.publish(Imu())
    publisher.publish(Imu())
    found = []

    def came():
        found.extend(rclpy_inside.drain(subscription, Imu, 10))
        return len(found) == 2

    # The executor spins meanwhile, and takes none.
    ros.until(came)
    assert all(isinstance(message, bytes) for message, _ in found), 'take_message(raw)'
    assert [info['publication_sequence_number'] for _, info in found] == [1, 2]
    assert all(info['received_timestamp'] > info['source_timestamp'] > 0 for _, info in found)
    assert rclpy_inside.drain(subscription, Imu, 10) == [], 'None where nothing waits'


def test_nothing_else_looks_inside_rclpy():
    inside = re.compile(r'rclpy\._|rclpy\.impl\b|_parameter_overrides|'
                        r'take_message\(|\._rclpy|executor\.fset')
    assert [path.name for path in sorted((PACKAGE / 'node').glob('*.py'))
            if inside.search(path.read_text())] == ['rclpy_inside.py']
