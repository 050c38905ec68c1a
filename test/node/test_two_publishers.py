# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Other IMUs on the topic: beside the first, instead of it, or the same one over and over."""

from collections.abc import Iterator
import json
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.cdr import encode_imu
from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from repeated import slow
from ros_harness import Driver, RATE_HZ, Ros
from whole_lines import Varying


@pytest.fixture
def reports(ros: Ros) -> list[DiagnosticArray]:
    return ros.listen(DiagnosticArray, '/diagnostics', 10)


def statuses(reports: list[DiagnosticArray], ros: Ros, part: str) -> Iterator[Any]:
    return (status for report in reversed(reports) for status in report.status
            if status.name == f'{ros.name("imu_allan")}: {part}')


def test_a_run_goes_on_with_the_samples_of_its_own_publisher(
        ros: Ros, reports: list[DiagnosticArray]) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    first = Driver(ros).wait_for_node()
    first.publish(2000)
    first.until_taken()
    second = Driver(ros).wait_for_node()
    second.next = first.next
    for _ in range(1000):
        first.publish(1)
        second.publish(1)
    first.until_taken()
    second.until_taken()
    names = f'{ros.name("tester")} and {ros.name("tester")}'
    for line in (f'the messages on {first.topic} are of more than one publisher: they are passed '
                 'over',
                 f'2 publishers on {first.topic} ({names}): where their samples mix they are '
                 'passed over; give every IMU a topic of its own'):
        ros.until(lambda line=line: line in node.lines)
        assert node.lines.count(line) == 1
    told = (b'\2', f'messages of more than one publisher on {first.topic}: they are passed over')
    ros.until(lambda: any((status.level, status.message) == told
                          for status in statuses(reports, ros, 'reception')))
    document = ros.saved()
    # The run goes on with the messages of its own publisher.
    assert document['timeline']['samples'] == 3000
    low, high = document['axes']['gyro_x']['coefficients']['noise_density']['ci95']
    assert low < 0.01 / RATE_HZ**0.5 < high


def test_two_publishers_from_the_first_message_on_make_no_coefficient(ros: Ros) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    drivers = Driver(ros), Driver(ros)
    for driver in drivers:
        driver.wait_for_node()
    for _ in range(2000):
        for driver in drivers:
            driver.publish(1)
    for driver in drivers:
        driver.until_taken()
    mixed = (f'the messages on {drivers[0].topic} are of more than one publisher: they are passed '
             'over')
    ros.until(lambda: mixed in node.lines)
    document = ros.saved()
    coefficients = [] if document is None else [
        coefficient for axis in document['axes'].values()
        for coefficient in axis['coefficients'].values()]
    assert not any(coefficient['observable'] for coefficient in coefficients)


@pytest.mark.parametrize(('change', 'reason'), [
    slow({'rate_hz': 100.0}, 'it is of 200 Hz, the messages now come at 100 Hz'),
    ({'frame_id': 'other'}, "it is of frame_id 'imu', the messages now have 'other'")])
def test_a_lasting_change_begins_a_new_run_and_keeps_the_old_one(
        ros: Ros, change: dict[str, Any], reason: str) -> None:
    state = ros.folder / 'state'
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'state_file': str(state)})
    driver = Driver(ros).wait_for_node()
    driver.publish(4000)
    driver.until_taken()
    # The watch knows the rate from the first fit.
    ros.until(lambda: Varying(
        'observable: noise density (rad/s/sqrt(Hz)) of <words>') in node.lines)
    # The stamps go on, at the new rate.
    driver.next = round(driver.next * change.get('rate_hz', RATE_HZ) / RATE_HZ)
    driver.publish(1000, **change)
    begins = f'a new run begins, the one before cannot go on: {reason}'
    ros.until(lambda: driver.publish(200, **change) or begins in node.lines)
    driver.publish(2000, **change)
    driver.until_taken()
    kept = Varying(f'a new run: {state} could not be resumed from, {reason}; it is kept as '
                   'state.<words>')
    ros.until(lambda: kept in node.lines)
    document = ros.until(ros.saved)
    # It begins with the first sample after the change.
    assert document['timeline']['rejected'] == 0
    assert document['source']['frame_id'] == change.get('frame_id', 'imu')
    assert document['timeline']['sample_rate_hz'] == pytest.approx(
        change.get('rate_hz', RATE_HZ), rel=1e-3)
    before = [json.loads(path.read_text()) for path in (ros.folder / 'output').rglob(
        'result.json')]
    assert sorted(found['source']['frame_id'] for found in before) == sorted(
        ['imu', change.get('frame_id', 'imu')])
    assert len(before) == 2
    [aside] = state.parent.glob('state.*Z')
    assert aside.stat().st_size > 10_000
    assert node.stop() == 0, node.log


def test_a_recording_in_a_loop_is_counted_once(ros: Ros, reports: list[DiagnosticArray]) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    driver = Driver(ros).wait_for_node()
    samples = np.random.default_rng(4).normal(0, 0.01, (2000, 6))
    messages = [encode_imu(1_700_000_000 * 10**9 + i * 5_000_000, sample, 'imu')
                for i, sample in enumerate(samples)]
    for _ in range(3):
        for message in messages:
            driver.publisher.publish(message)
        driver.until_taken()
    ros.until(lambda: f'the messages on {driver.topic} repeat from the first one on, as a '
                      'recording played in a loop does: what has come before is passed over'
                      in node.lines)
    repeat = 'the messages repeat: what has come before is passed over'
    ros.until(lambda: any(status.message == repeat
                          for status in statuses(reports, ros, 'reception')))
    document = ros.until(ros.saved)
    assert document['timeline']['samples'] == 2000
    assert document['timeline']['out_of_order'] == document['timeline']['duplicates'] == 0
    # New stamps are new samples.
    driver.next = 2000
    driver.publish(1000)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == 3000
    assert set(document['axes']) == set(AXES)


def test_two_nodes_of_one_name_are_told(ros: Ros) -> None:
    nodes = [ros.start('imu_allan_node', constants={'reports.LOOK_S': 1.0}) for _ in range(2)]
    for node in nodes:
        ros.until(lambda node=node: (
            'another node has the same name: their topics and services cannot be kept apart; '
            'start one of them with another name') in node.lines)


def test_a_publisher_of_another_type_or_qos_is_named(ros: Ros,
                                                     reports: list[DiagnosticArray]) -> None:
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import Imu, Temperature
    ros.start('imu_allan_node')

    def told(message: str) -> bool:
        return any(status.message == message for status in statuses(reports, ros, 'reception'))

    topic = ros.name('imu/data_raw')
    other = ros.node.create_publisher(Temperature, topic, 10)
    ros.until(lambda: told(f'{ros.name("tester")} publishes sensor_msgs/msg/Temperature, '
                           'not sensor_msgs/msg/Imu'))
    ros.node.destroy_publisher(other)
    ros.node.create_publisher(Imu, topic, QoSProfile(
        depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
    # The node of a test asks for reliable delivery, with overrides.
    ros.until(lambda: told(f'the QoS of {ros.name("tester")} does not go with that asked for '
                           '(Best effort publisher and reliable subscription); choose another '
                           'with qos_overrides'))
