# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""An IMU in the messages of a topic, and the account of those that are none."""

from collections.abc import Callable
from dataclasses import dataclass

from imu_allan.cdr import MalformedImu
from imu_allan.errors import printable
from imu_allan.recordings.messages.decoder import BARE_IMU, ImuMessages
from imu_allan.recordings.messages.imus_in import IMU_TYPES


@dataclass(frozen=True)
class ImuTopic:
    """
    An IMU in the messages of a topic.

    Attributes
    ----------
    name : str
        Topic name; with the field behind it where the messages hold several IMUs.
    count : int or None
        Messages in the recording; None where the file does not say.
    messages : ImuMessages
        How they are read; by default as sensor_msgs/msg/Imu.
    source : str
        Topic that is recorded; empty where it is `name`.

    """

    name: str
    count: int | None
    messages: ImuMessages = BARE_IMU
    source: str = ''

    @property
    def topic(self) -> str:
        """Return the topic that is recorded."""
        return self.source or self.name


class MalformedMessages:
    """Counts what is not an Imu message on an Imu topic, and keeps the first reason."""

    def __init__(self) -> None:
        self.count = 0
        self.reason = ''

    def __call__(self, count: int, error: MalformedImu) -> None:
        self.count += count
        self.reason = self.reason or str(error)

    def report(self, imu: ImuTopic, remark: Callable[..., None]) -> None:
        """Hand a finding to `remark` where there were any in the messages of a topic."""
        if self.count:
            kind = imu.messages.type_name
            kind = 'sensor_msgs/Imu' if kind in IMU_TYPES else printable(kind)
            remark(
                'malformed_messages', what='message', count=self.count,
                topic=printable(imu.name), type=kind, first=self.reason)
