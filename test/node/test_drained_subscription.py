# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

import time
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu, encode_imu
from imu_allan.node import drained_subscription
from imu_allan.node.announcements import Announcements
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.imu_type import decoder, IMU
from imu_allan.node.log import Log
from imu_allan.node.reception import Reception
import numpy as np
import pytest
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_harness import Ros
from sensor_msgs.msg import Imu

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)


def message(number: int) -> bytes:
    return encode_imu(number, np.arange(6.0) + number, 'imu')


def publisher(ros: Ros, subscription: DrainedSubscription) -> Publisher:
    made = ros.node.create_publisher(Imu, ros.name('imu'), RELIABLE)
    ros.until(lambda: made.get_subscription_count() == subscription.publishers == 1)
    return made


def take_all(ros: Ros, subscription: DrainedSubscription, count: int
             ) -> list[drained_subscription.Batch]:
    batches: list[drained_subscription.Batch] = []

    def complete() -> bool:
        batches.append(subscription.take())
        return sum(len(batch.messages) for batch in batches) >= count

    ros.until(complete)
    return batches


def numbers(batches: list[drained_subscription.Batch]) -> list[int]:
    return [decode_imu(message)[0] for batch in batches for message in batch.messages]


@pytest.fixture(params=['drained', 'by callback'])
def subscription(ros: Ros, request: pytest.FixtureRequest) -> DrainedSubscription:
    return DrainedSubscription(ros.node, Imu, ros.name('imu'), 100,
                               draining=request.param == 'drained')


def test_messages_come_whole_in_order_and_with_their_time_of_receipt(
        ros: Ros, subscription: DrainedSubscription) -> None:
    talker = publisher(ros, subscription)
    before = time.time_ns()
    for number in range(50):
        talker.publish(message(number))
    batches = take_all(ros, subscription, 50)
    after = time.time_ns()
    assert [m for batch in batches for m in batch.messages] == [message(n) for n in range(50)]
    receive_ns = np.concatenate([batch.receive_ns for batch in batches])
    assert np.all(np.diff(receive_ns) >= 0)
    assert before <= receive_ns[0] <= receive_ns[-1] <= after
    # Fast DDS gives the numbers of the publisher.
    assert [number for batch in batches for number in batch.numbers] == list(range(1, 51))


def test_each_sample_has_the_number_of_its_message_unless_some_cannot_be_decoded(
        ros: Ros, subscription: DrainedSubscription) -> None:
    talker = publisher(ros, subscription)
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
            talker.publish(encode_imu(number, np.arange(6.0), frame))
    found = blocks(15)
    assert [block.numbers.tolist() for block in found] == [
        list(range(1, 6)), list(range(6, 11)), list(range(11, 16))]
    talker.publish(b'\0\1\0\0nothing of the kind')
    talker.publish(message(1))
    assert [block.numbers for block in blocks(2)] == [None]
    assert reception.facts.malformed == 1
    assert reception.facts.malformed_why


def test_the_executor_leaves_the_messages_in_the_queue(ros: Ros) -> None:
    subscription = DrainedSubscription(ros.node, Imu, ros.name('imu'), 100)
    talker = publisher(ros, subscription)
    for number in range(10):
        talker.publish(message(number))
    assert talker.wait_for_all_acked()
    for _ in range(20):
        ros.executor.spin_once(timeout_sec=0.01)
    assert numbers([subscription.take()]) == list(range(10))


@pytest.mark.parametrize('answer', ['no such method', 'messages'])
def test_an_rclpy_whose_queue_answers_otherwise_is_served_by_callback(
        ros: Ros, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    def drain(*_: Any) -> Any:
        if answer == 'messages':
            raise TypeError('take_message did not return bytes')
        raise AttributeError('take_message')

    monkeypatch.setattr(drained_subscription, 'drain', drain)
    subscription = DrainedSubscription(ros.node, Imu, ros.name('imu'), 100)
    assert not subscription.draining
    talker = publisher(ros, subscription)
    for number in range(10):
        talker.publish(message(number))
    assert numbers(take_all(ros, subscription, 10)) == list(range(10))
