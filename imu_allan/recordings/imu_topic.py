# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""An IMU in the messages of a topic, and a count of malformed messages."""

from collections.abc import Callable
from dataclasses import dataclass

from imu_allan.cdr import IMU_TYPE, MalformedImu
from imu_allan.errors import printable
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.imus_in import IMU_TYPES


@dataclass(frozen=True)
class ImuTopic:
    """
    An IMU in the messages of a topic.

    Attributes
    ----------
    name : str
        Topic name, followed by the field if the messages hold several IMUs.
    count : int or None
        Number of messages in the recording; None if the file does not state it.
    messages : ImuMessages
        How the messages are read; by default as sensor_msgs/msg/Imu.
    source : str
        Recorded topic; empty if it equals `name`.

    """

    name: str
    count: int | None
    messages: ImuMessages = ImuMessages(IMU_TYPE)  # noqa: RUF009
    source: str = ''

    @property
    def topic(self) -> str:
        """Return the name of the recorded topic."""
        return self.source or self.name


class MalformedMessages:
    """Counter of malformed messages on an Imu topic that keeps the first reason."""

    def __init__(self) -> None:
        self.count = 0
        self.reason = ''

    def __call__(self, count: int, error: MalformedImu) -> None:
        self.count += count
        self.reason = self.reason or str(error)

    def report(self, imu: ImuTopic, remark: Callable[..., None]) -> None:
        """Pass a finding to `remark` if any message of the topic was malformed."""
        if self.count:
            kind = imu.messages.type_name
            kind = 'sensor_msgs/Imu' if kind in IMU_TYPES else printable(kind)
            remark(
                'malformed_messages', what='message', count=self.count,
                lost_share=self.count / (imu.count or float('inf')),
                topic=printable(imu.name), type=kind, first=self.reason)
