# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a driver, its clock and the computer do to a node that is running."""

from collections.abc import Callable
import os
import subprocess
import time
from typing import Any

from imu_allan.cdr import encode_imu
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros_harness import Driver, Health, RATE_HZ, Ros
from sensor_msgs.msg import Temperature
from whole_lines import Varying


def test_a_driver_that_restarts_after_a_while_leaves_a_gap_and_loses_nothing(ros: Ros) -> None:
    node = ros.start('imu_allan_node')
    first = Driver(ros).wait_for_node()
    first.publish(2000)
    assert first.publisher.wait_for_all_acked()
    ros.node.destroy_publisher(first.publisher)
    time.sleep(2)
    second = Driver(ros)
    away = round(2 * RATE_HZ)
    second.next = first.next + away
    second.wait_for_node()
    again = Varying(f'messages come on {first.topic} again after <number> s without')
    ros.until(lambda: second.publish(20) or again in node.lines)
    second.publish(1000)
    second.until_taken()
    document = ros.saved()
    # Each line says one thing: who sends now is not known by a pause.
    assert node.lines.count(again) == 1, node.log  # type: ignore[arg-type]
    assert node.lines.count(f'the driver on {first.topic} was started anew: the IMU may have been '
                            'switched off and on, so its mean is another one from here on') == 1
    assert document['timeline']['samples'] == second.next - away
    assert document['timeline']['rejected'] == document['timeline']['out_of_order'] == 0
    assert node.running
    assert 'Traceback' not in node.log


def meanwhile(driver: Driver, condition: Callable[[], Any]) -> None:
    """Publish at about the rate of the stamps until the condition holds."""
    began, first = time.monotonic(), driver.next

    def going_on() -> Any:
        due = round((time.monotonic() - began) * RATE_HZ) - (driver.next - first)
        driver.publish(max(due, 0))
        return condition()

    driver.ros.until(going_on)


def test_one_bad_moment_is_reported_once_and_is_no_warning_for_the_rest_of_the_run(
        ros: Ros, health: Health) -> None:
    topic = ros.name('imu/temperature')
    node = ros.start('imu_allan_node', {'publish_period': 1.0, 'temperature_topic': topic},
                     constants={'diagnostics.RECENT_S': 5.0, 'thermometer._MATCHING_S': 1.0,
                                'thermometer._SILENCE_S': 5.0})
    driver = Driver(ros).wait_for_node()
    missing = f'nothing publishes {topic}: there is no temperature'
    meanwhile(driver, lambda: missing in node.lines)
    publisher = ros.node.create_publisher(Temperature, topic, QoSProfile(depth=10))
    ros.until(publisher.get_subscription_count)
    meanwhile(driver, lambda: f'the thermometer on {topic} is there' in node.lines)
    publisher.publish(Temperature(temperature=20.0))
    driver.send(b'\0\1\0\0nothing of the kind')
    driver.next += 1
    driver.send(encode_imu(1_700_000_000 * 10**9 + round(driver.next / RATE_HZ * 1e9),
                           np.full(6, np.nan), 'imu'))
    driver.next += 1
    malformed = Varying(f'1 message on {driver.topic} could not be decoded in the last 30 s: '
                        '<words>')
    meanwhile(driver, lambda: health.said('reception', malformed))
    rejected = '1 message rejected: NaN, infinite or declared absent'
    # Diagnostics say the worst first, which on a busy computer is how uneven the stamps are.
    meanwhile(driver, lambda: rejected in node.lines)
    meanwhile(driver, lambda: Varying(f'no temperature on {topic} for <number> s') in node.lines)
    publisher.publish(Temperature(temperature=20.0))
    meanwhile(driver, lambda: f'temperatures come on {topic} again' in node.lines)
    # Levels are about now, totals stay.
    meanwhile(driver, lambda: health.level('reception') == health.level('timeline') == b'\0')
    assert health.number('reception', 'malformed') == 1
    assert health.number('timeline', 'missing') == health.number('timeline', 'rejected') == 1
    for line in (malformed, missing,
                 f'every message on {driver.topic} can be decoded again; 1 message could not be '
                 'in all', rejected):
        assert node.lines.count(line) == 1, node.log  # type: ignore[arg-type]


@pytest.mark.parametrize(('size', 'filled', 'works'), [
    ('1m', '500k', True), ('16k', '16k', False)])
def test_where_shared_memory_is_short_samples_come_over_the_network(
        ros: Ros, size: str, filled: str, works: bool) -> None:
    # A small /dev/shm for what it runs, and nobody else.
    short = ['unshare', '--mount', '--propagation', 'private', 'sh', '-c',
             f'mount -t tmpfs -o size={size} tmpfs /dev/shm && '
             f'head -c {filled} /dev/zero > /dev/shm/full; exec "$@"', 'sh']
    if os.geteuid() != 0 or subprocess.run([*short, 'true'], capture_output=True,
                                           check=False).returncode:
        pytest.skip('only root can mount a small /dev/shm')
    node = ros.start('imu_allan_node', shared_memory=True, wrapper=short)
    remedy = 'remove files from it, or give it room, such as with --shm-size of docker run'
    if not works:
        assert node.wait() == 1
        assert node.lines == ['imu_allan_node: /dev/shm is full, so the libraries of ROS would '
                              f'crash; {remedy}']
        return
    simulator = ros.start('imu_simulator', {'rate': 1000.0, 'duration': 2.0,
                                            'wait_for_subscriptions': 1},
                          shared_memory=True, wrapper=short)
    assert simulator.wait() == 0, simulator.log
    assert ros.saved_with(2000)
    assert Varying('imu_allan_node: /dev/shm has only <number> MB of room: messages come over the '
                   f'network, at more cost; {remedy}') in node.lines
    assert node.stop() == 0
    assert 'Traceback' not in node.log
