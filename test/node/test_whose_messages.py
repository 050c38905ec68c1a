# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come: a driver and its sensor go and return, change, or give way to others."""

import time
from typing import Any

from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from repeated import slow
from ros_harness import assert_density, Process, Ros, Sensor
from whole_lines import Varying


def begin(ros: Ros, **parameters: Any) -> Process:
    return ros.start('imu_allan_node', {'publish_period': 0.5, **parameters})


def saved(ros: Ros, sensor: Sensor) -> Any:
    assert sensor.driver is not None
    sensor.driver.until_taken()
    return ros.saved()


def fitted(ros: Ros, node: Process) -> None:
    """Wait for the first fit, from which on the run is known."""
    ros.until(lambda: 'observable: noise density' in node.log)


def measured(ros: Ros, rate_hz: float, seconds: float) -> tuple[Process, Sensor]:
    """Start a node and a sensor, whose first fit is published."""
    node, sensor = begin(ros), Sensor(ros, rate_hz)
    sensor.plug_in()
    sensor.measure(seconds)
    fitted(ros, node)
    ros.executor.spin_once(timeout_sec=1.0)
    return node, sensor


def go_on(ros: Ros, sensor: Sensor, rounds: int, seconds: float, **how: Any) -> None:
    """Measure again and again, each time for longer than from one fit to the next."""
    for _ in range(rounds):
        sensor.measure(seconds, **how)
        ros.executor.spin_once(timeout_sec=0.6)


def measure_until(ros: Ros, node: Process, sensor: Sensor, words: str, seconds: float = 5.0,
                  **how: Any) -> None:
    """Measure until the log of the node has these words."""
    ros.until(lambda: sensor.measure(seconds, **how) or words in node.log, timeout=90.0)


@pytest.mark.parametrize(('rate_hz', 'frame_id', 'reason'), [
    slow(100.0, 'imu', 'it is of 50 Hz, the messages now come at 100 Hz'),
    (50.0, 'other', "it is of frame_id 'imu', the messages now have 'other'")])
def test_a_lasting_change_begins_a_new_run_and_keeps_the_old_one_until_its_imu_returns(
        ros: Ros, rate_hz: float, frame_id: str, reason: str) -> None:
    state = ros.folder / 'state'
    node, sensor = begin(ros, state_file=str(state)), Sensor(ros)
    sensor.plug_in()
    sensor.measure(300.0)
    fitted(ros, node)
    sensor.unplug()
    other = Sensor(ros, seed=2)
    other.now_ns = sensor.now_ns
    other.plug_in()
    other.rate_hz = rate_hz
    measure_until(ros, node, other,
                  f'a new run begins, the one before cannot go on: {reason}', frame_id=frame_id)
    other.measure(20.0, frame_id=frame_id)
    document = saved(ros, other)
    # It begins with the first sample after the change.
    assert document['timeline']['rejected'] == 0
    assert document['source']['frame_id'] == frame_id
    assert document['timeline']['sample_rate_hz'] == pytest.approx(rate_hz, rel=1e-3)
    ros.until(lambda: Varying(f'a new run: {state} could not be resumed from, {reason}; it is '
                              'kept as state.<words>') in node.lines)
    [aside] = ros.folder.glob('state.*Z')
    assert aside.stat().st_size > 10_000
    assert sorted(found['source']['frame_id'] for found in ros.results()) == ['imu', frame_id]
    other.unplug()
    sensor.now_ns = other.now_ns
    sensor.plug_in()
    measure_until(ros, node, sensor, 'goes on')
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=100)
    assert document['source']['frame_id'] == 'imu'
    # At the end the run of a third is saved too, which has not lasted; drawings come last.
    sensor.unplug()
    other.now_ns = sensor.now_ns
    other.plug_in()
    # Longer than the longest look at it, and shorter than it has to last.
    other.measure(15.0, frame_id='third')
    ros.until(lambda: node.log.count('are of another IMU') == 3)
    other.unplug()
    began_ns = time.time_ns()
    assert node.stop(within_s=10.0) == 0, node.log
    written = sorted((path.stat().st_mtime_ns, path.name)
                     for path in (state, *(ros.folder / 'output').glob('*/*')))
    names = [name for when, name in written if when > began_ns]
    assert (names[0], names[-1]) == ('state', 'allan_deviation.png')
    assert (names.count('result.json'), names.count('allan_deviation.png')) == (2, 1)


def test_replugs_are_power_ons_and_neither_a_step_nor_a_random_walk(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros, 100.0)
    biases = [[0.0, 0.0, 0.0], [0.01, -0.02, 0.1],
              *np.random.default_rng(3).normal(0, 0.1, (2, 3)).tolist()]
    for count, bias in enumerate(biases, 1):
        sensor.bias[:3] = bias
        sensor.plug_in()
        go_on(ros, sensor, 2, 60.0)
        fitted(ros, node)
        if count not in (2, len(biases)):
            continue
        document = saved(ros, sensor)
        assert node.log.count('may have been switched off and on') == count - 1
        assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=10 * count)
        assert not {'bias_step', 'warm_up', 'slow_cycle', 'trend_or_walk', 'not_steady'} & {
            warning['code'] for warning in document['warnings']}
        for name, sigma in zip(AXES, np.std(biases[:count], axis=0, ddof=1), strict=False):
            assert document['turn_on_bias'][name]['sigma'] == pytest.approx(sigma, rel=0.1), name
            for key in ('rate_random_walk', 'bias_instability', 'rate_ramp'):
                assert not document['axes'][name]['coefficients'][key]['observable'], (name, key)
    low, high = document['turn_on_bias']['gyro_x']['ci95']
    assert low < np.std(np.array(biases)[:, 0], ddof=1) < high
    assert_density(document, 100.0)
    assert 'a new run begins' not in node.log


@pytest.mark.parametrize('checkpoint_s', [1.0, slow(60.0)])
def test_another_sensor_of_the_same_name_and_rate_is_another_imu(
        ros: Ros, checkpoint_s: float) -> None:
    node = begin(ros, checkpoint_period=checkpoint_s, state_file=str(ros.folder / 'state'))
    sensor = Sensor(ros, 100.0)
    sensor.plug_in()
    # For so long that the other one is looked at again before its run begins.
    go_on(ros, sensor, 2, 200.0)
    fitted(ros, node)
    sensor.noise *= 1.2
    sensor.plug_in()
    measure_until(ros, node, sensor, 'a new run begins')
    sensor.measure(30.0)
    assert_density(saved(ros, sensor), 100.0, sensor.noise)


def test_a_sensor_whose_samples_come_more_than_once_is_one_run(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros, 100.0)
    sensor.plug_in()
    for _ in range(2):
        go_on(ros, sensor, 3, 20.0, polled=2, together=True)
        fitted(ros, node)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=10)
    assert 'a new run' not in node.log
    assert_density(document, 100.0)


def test_a_rate_within_the_tolerance_goes_on_and_one_beyond_begins_a_new_run(ros: Ros) -> None:
    node, sensor = measured(ros, 200.0, 30.0)
    sensor.rate_hz = 197.0
    go_on(ros, sensor, 5, 6.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, rel=0.02)
    assert 'a new run begins' not in node.log
    sensor.rate_hz = 205.0
    measure_until(ros, node, sensor, 'a new run begins', 2.0)
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['sample_rate_hz'] == pytest.approx(205.0, rel=1e-3)
    assert document['timeline']['rejected'] == 0
    assert_density(document, 205.0)


def test_a_stranger_for_some_seconds_does_not_end_a_long_run(ros: Ros) -> None:
    node, sensor = measured(ros, 20.0, 1200.0)
    for rate_hz, frame_id in (20.0, 'other'), (40.0, 'imu'):
        sensor.unplug()
        other = Sensor(ros, rate_hz, seed=2)
        other.now_ns = sensor.now_ns
        other.plug_in()
        go_on(ros, other, 3, 10.0, frame_id=frame_id)
        other.unplug()
        sensor.plug_in(35.0)
        go_on(ros, sensor, 3, 10.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=80)
    assert node.log.count('are of another IMU') == 2
    assert 'a new run begins' not in node.log
    assert_density(document, 20.0)
