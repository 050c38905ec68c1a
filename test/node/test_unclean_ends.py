# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A run that ended without saving goes on; one that was ended is finished."""

from pathlib import Path
import signal
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from ros_harness import Driver, Health, kept_in, Process, Ros
from whole_lines import Varying


@pytest.fixture
def home(ros: Ros) -> Path:
    return ros.folder / 'home'


def start(ros: Ros, home: Path, **parameters: Any) -> Process:
    node = ros.start('imu_allan_node', {'checkpoint_period': 1.0, **parameters},
                     env={'ROS_HOME': str(home)})
    ros.until(lambda: 'characterizing the IMU' in node.log)
    return node


def test_a_node_whose_hang_up_is_ignored_goes_on_and_without_a_state_keeps_nothing(
        ros: Ros, home: Path) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        node = start(ros, home, state_file='')
    finally:
        signal.signal(signal.SIGHUP, before)
    driver = Driver(ros).wait_for_node()
    node.popen.send_signal(signal.SIGHUP)
    driver.publish(2000)
    assert driver.publisher.wait_for_all_acked()
    assert node.stop() == 0, node.log
    assert ros.results()[0]['timeline']['samples'] == 2000
    assert not home.exists()


def test_a_run_that_was_killed_goes_on_and_one_that_was_ended_does_not(
        ros: Ros, home: Path, health: Health) -> None:
    node, driver = start(ros, home), Driver(ros, depth=5000)
    driver.wait_for_node()
    driver.publish(2000)
    state = home / 'imu_allan' / f'{ros.namespace.strip("/")}.imu_allan.state'
    ros.until(lambda: kept_in(state).timeline.samples == 2000)
    node.popen.kill()
    node.popen.wait()
    driver.dead |= driver.subscriptions()
    again = start(ros, home)
    assert again.lines[0] == Varying(
        f'resumed <words> of data from {state}, of a run that has ended without saving; call '
        '~/reset to begin anew')
    arrays = ros.listen(DiagnosticArray, 'imu_allan/coefficients')
    # The result so far is published before any new sample.
    assert len(ros.until(lambda: arrays)[0].status) == 6
    driver.wait_for_node()
    driver.publish(1000)
    # The node that was killed acknowledges nothing.
    ros.until(lambda: health.number('reception', 'received') == 1000)
    assert again.stop() == 0, again.log
    assert max(document['timeline']['samples'] for document in ros.results()) == 3000
    last = start(ros, home)
    assert last.lines == [f'characterizing the IMU on {ros.name("imu/data_raw")}']
