# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a thermometer beside the IMU, from a topic of their own."""

from collections import deque
from collections.abc import Iterable
import time

from imu_allan.block import ImuBlock, joined
from imu_allan.cdr import batches_of
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.log import Log
from imu_allan.node.reception import types_of
from imu_allan.recordings.messages.imus_in import thermometer_in
from imu_allan.recordings.thermometers import in_celsius, readings_of, share_namespace
from rclpy.node import Node
from sensor_msgs.msg import Temperature

_TYPE = 'sensor_msgs/msg/Temperature'


class Thermometer:
    """Takes readings from the topic named, or found beside the IMU, and passes them to lanes."""

    def __init__(self, node: Node, log: Log, facts: Facts, lanes: int, named: str) -> None:
        self._node = node
        self._log = log
        self._facts = facts
        self._decode = thermometer_in(_TYPE, 'cdr', types_of(_TYPE)).decoder()
        # For each lane, what was taken in an hour or more.
        self._waiting: list[deque[ImuBlock]] = [deque(maxlen=10_000) for _ in range(lanes)]
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
            if _TYPE in types and share_namespace(self._facts.topic, name)
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
        readings = self._decode(batches_of(batch.messages, batch.receive_ns), lambda *_: None)
        for waiting in self._waiting:
            waiting.extend(readings)
        if readings:
            self._facts.temperature_at = time.monotonic()
            self._facts.temperature_c = float(in_celsius(readings[-1].samples[-1:, 0])[0])

    def feed(self, lanes: Iterable[Characterization]) -> None:
        """Pass the readings to each lane once the clock that places its samples is known."""
        for waiting, lane in zip(self._waiting, lanes, strict=True):
            # The final decision costs nothing; a preliminary one takes a copy of waiting samples.
            if waiting and (clock := lane.timeline.clock or lane.summary().clock):
                lane.take_temperature(*readings_of(joined([*waiting]), clock))
                waiting.clear()
