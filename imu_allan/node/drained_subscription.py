# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A subscription whose queue is emptied at leisure, as serialized bytes.

An ordinary rclpy callback costs the executor a wake-up, a wait set and a Python message per
sample: at 1 kHz a third of a core. Here the subscription stays out of the executor's wait set, the
middleware queues the samples in its own threads, and one call takes all that have come.
"""

from dataclasses import dataclass
import time

from imu_allan.errors import ImuAllanError
from imu_allan.node.rclpy_inside import drain, OutOfWaitSet, RCLError
import numpy as np
from numpy.typing import NDArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.qos import (
    HistoryPolicy,
    qos_check_compatible,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo


@dataclass(frozen=True)
class Batch:
    """Messages in the order they came."""

    messages: list[bytes]  # serialized, encapsulation header included
    receive_ns: NDArray[np.int64]  # by the middleware, since 1970, shape (n,)
    numbers: NDArray[np.int64] | None = None  # that the publisher gave them, if it is known
    full: bool = False  # the next would have pushed the first out


def _node_of(offer: TopicEndpointInfo) -> str:
    return f'{offer.node_namespace.rstrip("/")}/{offer.node_name}'


class DrainedSubscription:
    """
    Best-effort subscription that keeps the last `depth` messages until `take` is called.

    ImuAllanError where the topic, named by the `parameter`, or the QoS asked for is refused.
    """

    def __init__(self, node: Node, msg_type: type, topic: str, depth: int, parameter: str = ''
                 ) -> None:
        self._node = node
        self._msg_type = msg_type
        qos = QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST,
                         reliability=ReliabilityPolicy.BEST_EFFORT)
        try:
            self._subscription = node.create_subscription(
                msg_type, topic, lambda _: None, qos, raw=True, callback_group=OutOfWaitSet(),
                # In the wait set an event of it wakes the executor for every message.
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
        except NameValidationException as error:
            # Its last line points at a place in the name.
            reason = ' '.join(str(error).split()).removesuffix(' ^')
            raise ImuAllanError(f'parameter {parameter}: {reason}') from error
        except RCLError as error:
            raise ImuAllanError(f'{topic}: cannot be subscribed to ({error}); it may be a topic '
                                'of another type, or its qos_overrides may be wrong') from error
        except (InvalidQosOverridesError, RuntimeError) as error:
            raise ImuAllanError(f'qos_overrides of {topic}: {error}') from error
        # What the parameters say has been written into the profile.
        self._drops = qos.history == HistoryPolicy.KEEP_LAST
        self.depth = max(qos.depth, 1) if self._drops else depth
        # Namespace and remapping applied.
        self.topic = str(self._subscription.topic_name)
        self.type_name = '/'.join([*msg_type.__module__.split('.')[:2], msg_type.__name__])

    @property
    def publishers(self) -> int:
        """How many publishers are matched."""
        return int(self._subscription.get_publisher_count())

    def refused_publishers(self) -> list[str]:
        """Why publishers of the topic are not matched: a line for each."""
        lines = []
        for offer in self._node.get_publishers_info_by_topic(self.topic):
            name = _node_of(offer)
            if offer.topic_type != self.type_name:
                lines.append(f'{name} publishes {offer.topic_type}, not {self.type_name}')
                continue
            compatibility, reason = qos_check_compatible(
                offer.qos_profile, self._subscription.qos_profile)
            if compatibility == QoSCompatibility.ERROR:
                # Each part begins with a level and ends with a semicolon.
                reason = '; '.join(part.strip().removeprefix('ERROR: ')
                                   for part in reason.split(';') if part.strip())
                lines.append(f'the QoS of {name} does not go with that asked for ({reason}); '
                             'choose another with qos_overrides')
        return lines

    def publisher_names(self) -> list[str]:
        """Nodes that publish the topic, sorted."""
        return sorted(map(_node_of, self._node.get_publishers_info_by_topic(self.topic)))

    def publisher_gids(self) -> set[str]:
        """Identities of the publishers of the topic."""
        return {bytes(offer.endpoint_gid).hex()
                for offer in self._node.get_publishers_info_by_topic(self.topic)}

    def take(self) -> Batch:
        """Everything that has come since the last call, at most `depth` messages."""
        taken, now = drain(self._subscription, self._msg_type, self.depth), time.time_ns()
        # Not every middleware stamps the receipt; the publisher's stamp is the next best.
        receive = [info.get('received_timestamp') or info.get('source_timestamp') or now
                   for _, info in taken]
        numbers = [info.get('publication_sequence_number') for _, info in taken]
        return Batch([message for message, _ in taken], np.array(receive, dtype=np.int64),
                     None if None in numbers else np.array(numbers, np.int64),
                     self._drops and len(taken) >= self.depth)
