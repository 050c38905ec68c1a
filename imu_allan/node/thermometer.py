# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a thermometer beside the IMU, from a topic of their own."""

from collections import deque
import time

from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.log import Log
from imu_allan.recordings.thermometers import in_celsius, share_namespace
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Temperature


class Thermometer:
    """Takes readings from the topic named, or found beside the IMU, and passes them to lanes."""

    def __init__(self, node: Node, log: Log, facts: Facts, lanes: int, named: str) -> None:
        self._node = node
        self._log = log
        self._facts = facts
        # For each lane: stamps of header and reception, and what was read; hours of most sensors.
        self._waiting: list[deque[tuple[int, int, float]]] = [
            deque(maxlen=100_000) for _ in range(lanes)]
        self._beside: list[str] = []
        self._finds = not named
        self._subscription: DrainedSubscription | None = None
        if named:
            self._subscribe(named)

    def _subscribe(self, topic: str) -> None:
        # The queue of 1000 holds some seconds of the fastest thermometers.
        self._subscription = DrainedSubscription(self._node, Temperature, topic, 1000,
                                                 'temperature_topic')
        self._facts.temperature_topic = self._subscription.topic

    def look_beside(self) -> None:
        """Subscribe to the only one beside the IMU once two looks agree: discovery takes time."""
        if not self._finds:
            return
        before, self._beside = self._beside, sorted(
            name for name, types in self._node.get_topic_names_and_types()
            if 'sensor_msgs/msg/Temperature' in types and share_namespace(self._facts.topic, name)
            and self._node.count_publishers(name))
        if len(self._beside) != 1 or before != self._beside:
            return
        self._finds, [found] = False, self._beside
        try:
            self._subscribe(found)
        except ImuAllanError as error:
            # It was not asked for, so the run goes on without it.
            self._log.warning(f'no temperature: {error}', 'no thermometer')
        else:
            self._log.info(f'temperature from {found}, the only thermometer in the namespace of '
                           'the IMU')

    def take(self) -> None:
        """Take the waiting readings, without messages that are no Temperature."""
        if self._subscription is None:
            return
        batch = self._subscription.take()
        readings: list[tuple[int, int, float]] = []
        for content, receive_ns in zip(batch.messages, batch.receive_ns.tolist(), strict=True):
            try:
                message = deserialize_message(content, Temperature)
            except Exception:
                # The middleware may raise any exception for bytes that are no message.
                continue
            stamp = message.header.stamp
            header_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            readings.append((header_ns or receive_ns, receive_ns, message.temperature))
        for waiting in self._waiting:
            waiting.extend(readings)
        if readings:
            self._facts.temperature_at = time.monotonic()
            [self._facts.temperature_c] = in_celsius(np.array([readings[-1][2]])).tolist()

    def feed(self, lane: int, characterization: Characterization) -> None:
        """Pass the readings to a lane, once the clock that places its samples is known."""
        if not self._waiting[lane]:
            return
        # The final decision costs nothing; a preliminary one takes a copy of waiting samples.
        clock = characterization.timeline.clock or characterization.summary().clock
        if clock is None:
            return
        header_ns, receive_ns, readings = zip(*self._waiting[lane], strict=True)
        characterization.take_temperature(header_ns if clock == 'header' else receive_ns,
                                          in_celsius(np.array(readings)))
        self._waiting[lane].clear()
