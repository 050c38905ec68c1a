# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Other IMUs on the topic: beside the first, instead of it, or the same one over and over."""

from imu_allan.cdr import encode_imu
from imu_allan.noise.terms import AXES
import numpy as np
from ros_harness import assert_density, Driver, Health, RATE_HZ, Ros

MIXED = 'the messages on {} are of more than one publisher: they are passed over'


def test_a_run_goes_on_with_the_samples_of_its_own_publisher(ros: Ros, health: Health) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    first = Driver(ros).wait_for_node()
    first.publish(2000)
    first.until_taken()
    second = Driver(ros).wait_for_node()
    second.next = first.next
    # For longer than the longest look at it.
    for _ in range(2200):
        first.publish(1)
        second.publish(1, shaken=5.0)
    first.until_taken()
    second.until_taken()
    mixed, names = MIXED.format(first.topic), f'{ros.name("tester")} and {ros.name("tester")}'
    for line in (mixed, f'2 publishers on {first.topic} ({names}): where their samples mix they '
                 'are passed over; give every IMU a topic of its own'):
        ros.until(lambda line=line: line in node.lines)
        assert node.lines.count(line) == 1
    ros.until(lambda: health.said('reception', mixed, b'\2'))
    ros.node.destroy_publisher(second.publisher)
    first.publish(300)
    first.until_taken()
    ros.until(lambda: f'one publisher is left on {first.topic}' in node.lines)
    health.news()
    assert health.number('reception', 'lost') == 0
    document = ros.saved()
    assert document['timeline']['samples'] == 4500
    assert_density(document, RATE_HZ)


def test_a_driver_that_was_killed_and_started_again_is_one_publisher(
        ros: Ros, health: Health) -> None:
    ros.start('imu_allan_node')
    for seed in range(2):
        before = health.number('reception', 'received') if seed else 0
        driver = ros.start('imu_simulator', {'rate': RATE_HZ, 'seed': seed})
        ros.until(lambda least=before + 2 * RATE_HZ: health.number(
            'reception', 'received') > least)
        driver.popen.kill()
        driver.wait()
    # The middleware takes each for one that is there until its lease has run out.
    assert max(int(entry.value) for status in health.heard for entry in status.values
               if entry.key == 'publishers') == 1
    assert health.number('reception', 'lost') == 0


def test_a_recording_in_a_loop_is_counted_once(ros: Ros, health: Health) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    driver = Driver(ros).wait_for_node()
    samples = np.random.default_rng(4).normal(0, 0.01, (2000, 6))
    messages = [encode_imu(1_700_000_000 * 10**9 + i * 5_000_000, sample, 'imu')
                for i, sample in enumerate(samples)]
    for _ in range(3):
        for message in messages:
            driver.publisher.publish(message)
        driver.until_taken()
    repeat = (f'the messages on {driver.topic} repeat from the first one on, as a recording '
              'played in a loop does: what has come before is passed over')
    ros.until(lambda: repeat in node.lines and health.said('reception', repeat))
    document = ros.until(ros.saved)
    assert document['timeline']['samples'] == 2000
    assert document['timeline']['out_of_order'] == document['timeline']['duplicates'] == 0
    # New stamps are new samples.
    driver.next = 2000
    driver.publish(1000)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == 3000
    assert set(document['axes']) == set(AXES)
