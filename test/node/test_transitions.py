# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What goes wrong for a moment is told once when it begins and once when it is over."""

from collections.abc import Callable, Iterator
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.cdr import encode_imu
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from repeated import slow
from ros_harness import Driver, Process, RATE_HZ, Ros
from sensor_msgs.msg import Temperature
from whole_lines import Varying

WARN, OK = b'\1', b'\0'


class Health:
    """What ``/diagnostics`` said last, by part."""

    def __init__(self, ros: Ros) -> None:
        self._own = f'{ros.name("imu_allan")}: '
        self.level: dict[str, bytes] = {}
        self.message: dict[str, str] = {}
        self.values: dict[str, dict[str, str]] = {}
        ros.listen(DiagnosticArray, '/diagnostics', 10, self._hear)

    def _hear(self, report: DiagnosticArray) -> None:
        for status in report.status:
            if status.name.startswith(self._own):
                part = status.name.removeprefix(self._own)
                self.level[part], self.message[part] = status.level, status.message
                self.values[part] = {value.key: value.value for value in status.values}


@pytest.fixture
def health(ros: Ros) -> Iterator[Health]:
    return Health(ros)


def meanwhile(driver: Driver, condition: Callable[[], Any], timeout: float = 120.0) -> Any:
    """Publish at about the rate of the stamps until the condition holds."""
    began, first = time.monotonic(), driver.next

    def going_on() -> Any:
        due = round((time.monotonic() - began) * RATE_HZ) - (driver.next - first)
        driver.publish(max(due, 0))
        return condition()

    return driver.ros.until(going_on, timeout)


def times(node: Process, line: 'str | Varying') -> int:
    return node.lines.count(line)  # type: ignore[arg-type]


@pytest.mark.parametrize('window', [
    {'diagnostics.RECENT_S': 5.0, 'temperature_topic._MATCHING_S': 1.0,
     'temperature_topic._SILENCE_S': 5.0},
    slow({})], ids=['short', 'true'])
def test_one_bad_moment_is_told_once_and_is_no_warning_for_the_rest_of_the_run(
        ros: Ros, health: Health, window: dict[str, float]) -> None:
    topic = ros.name('imu/temperature')
    node = ros.start('imu_allan_node', {'publish_period': 1.0, 'temperature_topic': topic},
                     constants=window)
    driver = Driver(ros).wait_for_node()
    missing = f'nothing publishes {topic}: there is no temperature'
    meanwhile(driver, lambda: times(node, missing))
    publisher = ros.node.create_publisher(Temperature, topic, QoSProfile(depth=10))
    ros.until(publisher.get_subscription_count)
    meanwhile(driver, lambda: times(node, f'the thermometer on {topic} is there'))
    publisher.publish(Temperature(temperature=20.0))
    driver.send(b'\0\1\0\0nothing of the kind')
    driver.next += 1
    driver.send(encode_imu(1_700_000_000 * 10**9 + round(driver.next / RATE_HZ * 1e9),
                           np.full(6, np.nan), 'imu'))
    driver.next += 1
    meanwhile(driver, lambda: health.message.get('reception') == Varying(
        '1 message could not be decoded in the last 30 s: <words>'))
    meanwhile(driver, lambda: health.level.get('timeline') == WARN)
    assert health.message['timeline'] == Varying('<words> in the last 30 s')
    meanwhile(driver, lambda: times(node, Varying(f'no temperature on {topic} for <number> s')))
    publisher.publish(Temperature(temperature=20.0))
    meanwhile(driver, lambda: times(node, f'temperatures come on {topic} again'))
    # Levels are about now, totals stay.
    meanwhile(driver, lambda: health.level['reception'] == health.level['timeline'] == OK)
    assert health.values['reception']['malformed'] == '1'
    assert health.values['timeline']['missing'] == '1'
    assert health.values['timeline']['rejected'] == '1'
    for line in (f'1 message on {driver.topic} could not be decoded: <words>',
                 f'every message on {driver.topic} can be decoded again; 1 message could not be '
                 'in all',
                 '1 message rejected: NaN, infinite or declared absent', missing):
        assert times(node, Varying(line)) == 1, node.log


def test_a_queue_shorter_than_what_is_taken_at_once_is_named(ros: Ros, health: Health) -> None:
    name = f'qos_overrides.{ros.name("imu/data_raw")}.subscription.depth'
    node = ros.start('imu_allan_node', {'publish_period': 1.0, name: 5}, best_effort=True)
    driver = Driver(ros).wait_for_node()
    meanwhile(driver, lambda: health.level.get('reception') == WARN)
    remedy = (f'the queue of 5 messages is too short for what comes between two looks; leave '
              f'{name} out, or set it to 2.5 s of messages')
    assert health.message['reception'] == Varying(f'<number> messages lost in the last 30 s: '
                                                  f'{remedy}')
    assert health.values['reception']['queue'] == '5'
    meanwhile(driver, lambda: times(node, Varying(
        f'<number> messages on {driver.topic} lost: {remedy}')) == 1)
    meanwhile(driver, lambda: int(health.values['reception']['lost']) > 2000)
    assert 'too unevenly' not in node.log
