# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The topics on which the node publishes."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.node.result_messages import VECTORS
from imu_allan.wording import SENSORS
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64MultiArray, String


class OutputTopics:
    """All publishers of the node."""

    def __init__(self, node: Node) -> None:
        latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                             durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # Every event handler adds to the cost of each wake-up of the executor.
        no_events = PublisherEventCallbacks(use_default_callbacks=False)

        def publisher(kind: type, topic: str, qos: QoSProfile | int = latched) -> Publisher:
            return node.create_publisher(kind, topic, qos, event_callbacks=no_events)

        of_sensor = {**dict.fromkeys(VECTORS, Vector3Stamped),
                     'allan_deviation': Float64MultiArray}
        kinds = {'result': String, 'coefficients': DiagnosticArray,
                 **{f'{sensor}/{topic}': kind for sensor in SENSORS
                    for topic, kind in of_sensor.items()}}
        self._of_result = {topic: publisher(kind, f'~/{topic}') for topic, kind in kinds.items()}
        self._published: Mapping[str, Any] = {}
        self._volatile = dict.fromkeys(self._of_result, 0)
        self.plot = publisher(CompressedImage, '~/plot/compressed')
        self.diagnostics = publisher(DiagnosticArray, '/diagnostics', 10)
        self._node = node

    def publish(self, by_topic: Mapping[str, Any]) -> None:
        """Publish the messages of a result by topic, unless they are the same as before."""
        # Compare as text, so that NaN equals NaN.
        if str(by_topic) == str(self._published):
            return
        self._published = by_topic
        for topic, message in by_topic.items():
            self._of_result[topic].publish(message)

    def serve_newcomers(self) -> None:
        """Publish again for new volatile subscriptions, which have missed the last result."""
        for topic, publisher in self._of_result.items():
            volatile = sum(
                info.qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL
                for info in self._node.get_subscriptions_info_by_topic(publisher.topic_name))
            if volatile > self._volatile[topic] and topic in self._published:
                publisher.publish(self._published[topic])
            self._volatile[topic] = volatile
