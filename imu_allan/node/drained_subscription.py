# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A subscription that queues serialized messages until one call takes all of them.

An ordinary rclpy callback costs the executor a wake-up, a wait set and a Python message per
sample: a third of a core at 1 kHz. This subscription stays out of the executor's wait set; the
middleware queues the samples in its own threads.
"""

from dataclasses import dataclass
import time

from imu_allan.arrays import Ints
from imu_allan.errors import ImuAllanError
from imu_allan.node.rclpy_inside import drain, OutOfWaitSet, RCLError
import numpy as np
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
    """Messages in order of arrival."""

    messages: list[bytes]  # serialized, encapsulation header included
    receive_ns: Ints  # when the middleware received them, since 1970, shape (n,)
    numbers: Ints | None = None  # sequence numbers of the publisher, if known
    full: bool = False  # one more message would have displaced the oldest


def _node_of(offer: TopicEndpointInfo) -> str:
    # What the middleware gives for the name of a node that it does not know, or that is none.
    if offer.node_name in ('_NODE_NAME_UNKNOWN_', '_CREATED_BY_BARE_DDS_APP_'):
        return 'an unknown program'
    return f'{offer.node_namespace.rstrip("/")}/{offer.node_name}'


class DrainedSubscription:
    """
    Best-effort subscription that keeps the last `depth` messages until `take` is called.

    Raises ImuAllanError if the topic, set by `parameter`, or the requested QoS is refused.
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
                # An event handler in the wait set would wake the executor for every message.
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                qos_overriding_options=QoSOverridingOptions.with_default_policies())
        except NameValidationException as error:
            # The last line of the error marks a position in the name.
            reason = ' '.join(str(error).split()).removesuffix(' ^')
            raise ImuAllanError(f'parameter {parameter}: {reason}') from error
        except RCLError as error:
            raise ImuAllanError(f'{topic}: cannot be subscribed to ({error}); it may be a topic '
                                'of another type, or its qos_overrides may be wrong') from error
        except (InvalidQosOverridesError, RuntimeError) as error:
            raise ImuAllanError(f'qos_overrides of {topic}: {error}') from error
        # rclpy has written the overrides from the parameters into the profile.
        self._drops = qos.history == HistoryPolicy.KEEP_LAST
        self.depth = max(qos.depth, 1) if self._drops else depth
        # With namespace and remapping applied.
        self.topic = str(self._subscription.topic_name)
        self.type_name = '/'.join([*msg_type.__module__.split('.')[:2], msg_type.__name__])

    @property
    def publishers(self) -> int:
        """Return the number of matched publishers."""
        return int(self._subscription.get_publisher_count())

    def refused_publishers(self) -> list[str]:
        """Return why publishers of the topic are not matched, a line for each."""
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
        """Return the names of the nodes that publish the topic, sorted."""
        return sorted(map(_node_of, self._node.get_publishers_info_by_topic(self.topic)))

    def publisher_gids(self) -> set[str]:
        """Return the identifiers (GIDs) of the publishers of the topic."""
        return {bytes(offer.endpoint_gid).hex()
                for offer in self._node.get_publishers_info_by_topic(self.topic)}

    def take(self) -> Batch:
        """Take everything received since the last call, at most `depth` messages."""
        taken, now = drain(self._subscription, self._msg_type, self.depth), time.time_ns()
        # Not every middleware records the receive time; the source time is the next best.
        receive = [info.get('received_timestamp') or info.get('source_timestamp') or now
                   for _, info in taken]
        numbers = [info.get('publication_sequence_number') for _, info in taken]
        return Batch([message for message, _ in taken], np.array(receive, dtype=np.int64),
                     None if None in numbers else np.array(numbers, np.int64),
                     self._drops and len(taken) >= self.depth)
