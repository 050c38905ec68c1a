# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The thermometer beside the IMU, on a topic of its own."""

import time

from imu_allan.characterization import Characterization
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.recordings.thermometers import beside, in_celsius
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Temperature

QUEUE = 1000
"""Readings: seconds of the fastest thermometer, while the node fits."""
_MOST_WAITING = 100_000
"""Readings that wait until it is known which stamps the samples have: hours of most sensors."""
_MATCHING_S = 5.0
"""Publishers are found within three seconds of the start."""
_SILENCE_S = 30.0
"""Most thermometers publish within it; of a slower one thrice its longest pause."""
_NONE = np.empty((0, 2), np.int64), np.empty(0)


class ThermometerBeside:
    """The thermometer that nobody named: the one in the namespace of the IMU."""

    def __init__(self, node: Node, topic: str) -> None:
        self._node = node
        self._topic = topic
        self._seen: list[str] = []

    def look(self) -> str | None:
        """Return its topic once two looks have seen it alone: a driver's come one by one."""
        before, self._seen = self._seen, sorted(
            name for name, types in self._node.get_topic_names_and_types()
            if 'sensor_msgs/msg/Temperature' in types and beside(self._topic, name)
            and self._node.count_publishers(name))
        return self._seen[0] if len(self._seen) == 1 and before == self._seen else None


class TemperatureTopic:
    """Takes readings and hands them to a run."""

    def __init__(self, node: Node, topic: str, facts: Facts, lanes: int) -> None:
        self._subscription = DrainedSubscription(node, Temperature, topic, QUEUE,
                                                 'temperature_topic')
        self._facts = facts
        self._waiting = [_NONE] * lanes
        self._last_publisher = time.monotonic()
        self._last_reading: float | None = None
        self._longest_pause_s = 0.0
        facts.temperature_topic = self._subscription.topic

    def take(self) -> None:
        """Take what has come; what is no Temperature is counted and passed over."""
        batch = self._subscription.take()
        self._facts.thermometers = self._subscription.publishers
        stamps, readings = [], []
        for content, receive_ns in zip(batch.messages, batch.receive_ns.tolist(), strict=True):
            try:
                message = deserialize_message(content, Temperature)
            except Exception:
                # The middleware raises what it likes for bytes that are no message.
                self._facts.malformed += 1
                continue
            stamp = message.header.stamp
            header_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            stamps.append((header_ns or receive_ns, receive_ns))
            readings.append(message.temperature)
        self._note_silence(time.monotonic(), bool(readings))
        if readings:
            celsius = in_celsius(np.array(readings))
            self._facts.temperature_c = float(celsius[-1])
            self._waiting = [
                (np.concatenate([before, stamps])[-_MOST_WAITING:],
                 np.concatenate([warmth, celsius])[-_MOST_WAITING:])
                for before, warmth in self._waiting]

    def _note_silence(self, now: float, has_come: bool) -> None:
        if self._facts.thermometers:
            self._last_publisher = now
        self._facts.temperature_missing = now - self._last_publisher > _MATCHING_S
        pause_s = 0.0 if self._last_reading is None else now - self._last_reading
        if has_come:
            self._longest_pause_s = max(self._longest_pause_s, pause_s)
            self._last_reading, pause_s = now, 0.0
        usual_s = max(_SILENCE_S, 3 * self._longest_pause_s)
        self._facts.temperature_silent_s = pause_s if pause_s > usual_s else 0.0

    def feed(self, lane: int, characterization: Characterization) -> None:
        """Give the readings to a lane, once it is known by which stamps its samples are placed."""
        stamps, celsius = self._waiting[lane]
        if not len(celsius):
            return
        # What is decided for good is at hand; to guess before takes a copy of what waits.
        clock = characterization.clock or characterization.summary().clock
        if clock is None:
            return
        characterization.take_temperature(stamps[:, 0 if clock == 'header' else 1], celsius)
        self._waiting[lane] = _NONE
