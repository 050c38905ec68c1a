# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

import time

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu
from imu_allan.node.announcements import Announcements
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.imu_type import decoder, IMU
from imu_allan.node.log import Log
from imu_allan.node.reception import Reception
import numpy as np
from ros_harness import Driver, Ros
from sensor_msgs.msg import Imu


def test_each_sample_has_the_number_of_its_message_unless_some_cannot_be_decoded(
        ros: Ros) -> None:
    subscription = DrainedSubscription(ros.node, Imu, ros.name('imu'), 100)
    talker = Driver(ros, 'imu').wait_for_node()
    reception = Reception(
        subscription, Facts(subscription.topic, 100, 0.0, '', None), decoder(IMU),
        Announcements(Log(ros.node.get_logger()), subscription.topic))

    def blocks(count: int) -> list[ImuBlock]:
        received = reception.facts.received + count

        def all_came() -> bool:
            reception.take(time.monotonic())
            return reception.facts.received == received

        ros.until(all_came)
        return [block for _, some in reception.blocks(time.monotonic()) for block in some]

    for frame in ('one', 'two', 'one'):
        for number in range(5):
            talker.send(encode_imu(number, np.arange(6.0), frame))
    found = blocks(15)
    assert [block.numbers.tolist() for block in found] == [
        list(range(1, 6)), list(range(6, 11)), list(range(11, 16))]
    talker.send(b'\0\1\0\0nothing of the kind')
    good = encode_imu(1, np.arange(6.0), 'imu')
    for length in (8, 100, len(good) - 9, len(good)):
        talker.send(good[:length])
    assert [(len(block), block.numbers) for block in blocks(5)] == [(1, None)]
    assert reception.facts.malformed == 4
    assert reception.facts.malformed_why
