# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The topics on which the node publishes."""

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.node.result_messages import (
    ENDS,
    ResultMessages,
    SENSORS,
    TUNED_TERM,
)
from imu_allan.noise.terms import LASTING_TERMS
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64MultiArray, String

_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Publications:
    """
    Every publisher of the node.

    Parameters
    ----------
    node : rclpy.node.Node
        The node whose they are.

    Attributes
    ----------
    plot, diagnostics : Publisher
        Published while somebody subscribes.

    """

    def __init__(self, node: Node) -> None:
        def latched(kind: type, topic: str) -> Publisher:
            return node.create_publisher(kind, f'~/{topic}', _LATCHED,
                                         event_callbacks=_no_events())

        self._result = latched(String, 'result')
        self._coefficients = latched(DiagnosticArray, 'coefficients')
        terms = [f'{sensor}/{term}' for sensor in SENSORS for term in LASTING_TERMS]
        self._vectors = {topic: latched(Vector3Stamped, topic) for topic in (
            *terms, *(f'{sensor}/{TUNED_TERM}' for sensor in SENSORS),
            *(f'{term}/interval/{end}' for term in terms for end in ENDS))}
        self._curves = {topic: latched(Float64MultiArray, topic) for topic in (
            f'{sensor}/allan_deviation' for sensor in SENSORS)}
        self.plot = latched(CompressedImage, 'plot/compressed')
        self.diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', 10,
                                                 event_callbacks=_no_events())

    def publish(self, messages: ResultMessages) -> None:
        """Publish a result on every topic that has a part of it."""
        self._result.publish(messages.result)
        self._coefficients.publish(messages.coefficients)
        for topic, vector in messages.vectors.items():
            self._vectors[topic].publish(vector)
        for topic, curve in messages.curves.items():
            self._curves[topic].publish(curve)


def _no_events() -> PublisherEventCallbacks:
    # Every event handler costs each turn of the executor its share.
    return PublisherEventCallbacks(use_default_callbacks=False)
