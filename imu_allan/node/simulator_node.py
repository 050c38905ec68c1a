# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A node that replaces an IMU driver, and publishes Imu messages with known noise."""

from math import inf
import time

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.node.parameters import declare, naming_parameter, SIMULATOR, TOPIC, warn_of_unknown
from imu_allan.node.program import StopRequest
from imu_allan.node.rclpy_inside import RCLError
from imu_allan.sensor.noise_model import find_model, load_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu

_SERVICE_PERIOD_S = 0.05
"""Parameters are answered and sleeps end within this time, too short for users to notice."""


class SimulatorNode(Node):
    """
    Publishes a simulated IMU at rest, in real time, faster, or as fast as subscribers take it.

    Header stamps are in simulated time at any speed. Run it by `serve`, not in an executor alone,
    since samples have to be published at their own time.
    """

    def __init__(self) -> None:
        super().__init__('imu_simulator')
        self._values = values = declare(self, SIMULATOR)
        warn_of_unknown(self)
        with naming_parameter('model'):
            self._model = load_model(find_model(values['model']))
        self._rate: float = values['rate']
        self._speed: float = values['speed']
        self._total = round(values['duration'] * self._rate) if values['duration'] else inf
        self._imu = SimulatedImu(self._model, self._rate, values['seed'])
        self._start_ns = 0
        self._next = 0

        # Only a KEEP_ALL writer waits for readers that are behind.
        qos = QoSProfile(
            depth=1000, reliability=ReliabilityPolicy.RELIABLE,
            history=HistoryPolicy.KEEP_LAST if self._speed else HistoryPolicy.KEEP_ALL)
        self._publisher = self.create_publisher(
            Imu, TOPIC, qos, qos_overriding_options=QoSOverridingOptions.with_default_policies())

    def serve(self, stop: StopRequest) -> int:
        """Publish until the duration is over or `stop` is set; return the exit status."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        try:
            self._wait_for_subscriptions(executor, stop)
            # The first sample is stamped now, not when the node was constructed.
            self._start_ns = time.time_ns()
            self.get_logger().info(
                f'publishing {self._model.name or "a simulated IMU"} on '
                f'{self._publisher.topic_name} at {self._rate:g} Hz'
                + (f', {self._speed:g} times real time' if self._speed not in (0, 1) else ''))
            self._publish_all(executor, stop)
            # Samples that a reader has not received yet would be lost with the writer.
            while not (stop.requested or self._publisher.wait_for_all_acked(
                    Duration(seconds=0.5))):
                executor.spin_once(timeout_sec=0)
            self.get_logger().info(f'published {self._next} samples')
            return 0
        finally:
            executor.shutdown()

    def _wait_for_subscriptions(self, executor: SingleThreadedExecutor, stop: StopRequest) -> None:
        wanted = self._values['wait_for_subscriptions'] or (self._speed == 0)
        while not stop.requested and self._publisher.get_subscription_count() < wanted:
            executor.spin_once(timeout_sec=_SERVICE_PERIOD_S)
            self.get_logger().info(
                f'waiting for {wanted} subscriptions to {self._publisher.topic_name}',
                throttle_duration_sec=5.0, skip_first=True)

    def _publish_all(self, executor: SingleThreadedExecutor, stop: StopRequest) -> None:
        began = served = time.monotonic()
        pace = self._rate * self._speed
        while not stop.requested and self._next < self._total:
            now = time.monotonic()
            if now - served >= _SERVICE_PERIOD_S:
                served = now
                executor.spin_once(timeout_sec=0)
            due = min(self._total, int((now - began) * pace) + 1 if pace else inf)
            if due <= self._next:
                wait = began + self._next / pace - time.monotonic()
                time.sleep(max(0.0, min(wait, _SERVICE_PERIOD_S)))
                continue
            # Publish for some milliseconds between two checks of services and clock.
            self._publish(int(min(256, due - self._next)), stop)

    def _publish(self, count: int, stop: StopRequest) -> None:
        index = np.arange(self._next, self._next + count)
        stamps = self._start_ns + np.rint(index / self._rate * 1e9).astype(np.int64)
        self._next += count
        block = ImuBlock(stamps, stamps, self._imu.draw(count),
                         np.tile(self._imu.absent, (count, 1)), self._values['frame_id'])
        for row in encode_imu_rows(block):
            message = row.tobytes()
            while not stop.requested:
                try:
                    self._publisher.publish(message)
                    break
                except RCLError:
                    # The queue of the KEEP_ALL writer is full, though `publish` waits up to 0.1 s.
                    if not self.context.ok():
                        raise
