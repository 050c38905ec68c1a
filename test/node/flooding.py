# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A publisher of messages made beforehand, as fast as it is told: a process of its own.

Arguments: topic, messages a second, seconds. It prints how many it has published.
"""

import sys
import time

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

TOGETHER = 20
"""Published without a pause: a sleep is too long for one."""


def main(topic: str, rate_hz: float, seconds: float) -> None:
    """Publish."""
    rclpy.init()
    publisher = Node('flood').create_publisher(Imu, topic, QoSProfile(
        depth=100, reliability=ReliabilityPolicy.BEST_EFFORT))
    stamps = 10**18 + np.arange(4000) * round(1e9 / rate_hz)
    samples = np.random.default_rng(1).normal(0, 0.01, (len(stamps), 6))
    rows = [row.tobytes() for row in encode_imu_rows(ImuBlock(
        stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'flood'))]
    while not publisher.get_subscription_count():
        time.sleep(0.05)
    began, count = time.monotonic(), 0
    while time.monotonic() - began < seconds:
        first = count % len(rows)
        for row in rows[first:first + TOGETHER]:
            publisher.publish(row)
        count += TOGETHER
        time.sleep(max(count / rate_hz - (time.monotonic() - began), 0.0))
    print(count)


if __name__ == '__main__':
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
