# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come: a driver and its sensor go and return, change, or give way to others."""

import time
from typing import Any

from imu_allan.cdr import encode_imu
from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from ros_harness import assert_density, Driver, Health, Process, RATE_HZ, Ros, Sensor
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


def go_on(ros: Ros, sensor: Sensor, rounds: int, seconds: float, **how: Any) -> None:
    """Measure again and again, each time for longer than from one fit to the next."""
    for _ in range(rounds):
        sensor.measure(seconds, **how)
        ros.executor.spin_once(timeout_sec=0.6)


def measure_until(ros: Ros, node: Process, sensor: Sensor, words: str, seconds: float = 5.0,
                  **how: Any) -> None:
    """Measure until the log of the node has these words."""
    ros.until(lambda: sensor.measure(seconds, **how) or words in node.log, timeout=90.0)


def test_a_lasting_change_begins_a_new_run_and_keeps_the_old_one_until_its_imu_returns(
        ros: Ros) -> None:
    state, reason = ros.folder / 'state', "it is of frame_id 'imu', the messages now have 'other'"
    node, sensor = begin(ros, state_file=str(state)), Sensor(ros)
    sensor.plug_in()
    sensor.measure(300.0)
    fitted(ros, node)
    sensor.unplug()
    other = Sensor(ros, seed=2)
    other.now_s = sensor.now_s
    other.plug_in()
    measure_until(ros, node, other,
                  f'a new run begins, the one before cannot go on: {reason}', frame_id='other')
    other.measure(20.0, frame_id='other')
    document = saved(ros, other)
    # It begins with the first sample after the change.
    assert document['timeline']['rejected'] == 0
    assert document['source']['frame_id'] == 'other'
    assert document['timeline']['sample_rate_hz'] == pytest.approx(50.0, rel=1e-3)
    ros.until(lambda: Varying(f'a new run: {state} could not be resumed from, {reason}; it is '
                              'kept as state.<words>') in node.lines)
    [aside] = ros.folder.glob('state.*Z')
    assert aside.stat().st_size > 10_000
    assert sorted(found['source']['frame_id'] for found in ros.results()) == ['imu', 'other']
    other.unplug()
    sensor.now_s = other.now_s
    sensor.plug_in()
    measure_until(ros, node, sensor, 'goes on')
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=100)
    assert document['source']['frame_id'] == 'imu'
    # At the end the run of a third is saved too, which has not lasted; drawings come last.
    sensor.unplug()
    other.now_s = sensor.now_s
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


def test_another_sensor_of_the_same_name_and_rate_is_another_imu(ros: Ros) -> None:
    node = begin(ros, checkpoint_period=1.0, state_file=str(ros.folder / 'state'))
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
