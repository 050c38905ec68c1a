# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come: a driver and its sensor go and return, change, or give way to others."""

from collections.abc import Sequence
import json
from typing import Any

from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from repeated import slow
from ros_harness import assert_density, Process, Ros, Sensor


def begin(ros: Ros, **parameters: Any) -> Process:
    return ros.start('imu_allan_node', {'publish_period': 0.5, **parameters})


def saved(ros: Ros, sensor: Sensor) -> Any:
    assert sensor.driver is not None
    sensor.driver.until_taken()
    return ros.saved()


def fitted(ros: Ros, node: Process) -> None:
    """Wait for the first fit, from which on the run is known."""
    ros.until(lambda: 'observable: noise density' in node.log)


def replaced(ros: Ros, node: Process, sensor: Sensor, seconds: float) -> Sensor:
    """Measure for so long, then plug in another sensor in place of this one."""
    sensor.plug_in()
    sensor.measure(seconds)
    fitted(ros, node)
    sensor.unplug()
    other = Sensor(ros, seed=2)
    other.now_ns = sensor.now_ns
    other.plug_in()
    return other


def go_on(ros: Ros, sensor: Sensor, rounds: int, seconds: float, **how: Any) -> None:
    """Measure again and again, each time for longer than from one fit to the next."""
    for _ in range(rounds):
        sensor.measure(seconds, **how)
        ros.executor.spin_once(timeout_sec=0.6)


@pytest.mark.parametrize(('polled', 'together'), [
    *(slow(polled, False) for polled in (2, 3)), (2, True)])
def test_a_sensor_whose_samples_come_more_than_once_is_one_run(
        ros: Ros, polled: int, together: bool) -> None:
    node, sensor = begin(ros), Sensor(ros, 100.0)
    sensor.plug_in()
    for _ in range(2):
        go_on(ros, sensor, 3, 20.0, polled=polled, together=together)
        fitted(ros, node)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=10)
    assert 'a new run' not in node.log
    assert_density(document, 100.0)


@pytest.mark.parametrize(('within', 'beyond'), [
    (-0.015, 0.025), *(slow(0.01, beyond)
                       for beyond in (0.04, -0.03, 0.1))])
def test_a_rate_within_the_tolerance_of_the_timeline_goes_on_and_no_other(
        ros: Ros, within: float, beyond: float) -> None:
    node, sensor = begin(ros), Sensor(ros, 200.0)
    sensor.plug_in()
    sensor.measure(30.0)
    fitted(ros, node)
    ros.executor.spin_once(timeout_sec=1.0)
    sensor.rate_hz = 200 * (1 + within)
    go_on(ros, sensor, 5, 6.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, rel=0.02)
    assert document['timeline']['rejected'] == 0
    assert 'a new run begins' not in node.log
    sensor.rate_hz = 200 * (1 + beyond)

    def begun() -> bool:
        sensor.measure(2.0)
        return 'a new run begins' in node.log

    ros.until(begun, timeout=60.0)
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['sample_rate_hz'] == pytest.approx(200 * (1 + beyond), rel=1e-3)
    assert document['timeline']['rejected'] == 0
    assert_density(document, 200 * (1 + beyond))


def test_a_stranger_for_some_seconds_does_not_end_a_long_run(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros, 20.0)
    sensor.plug_in()
    sensor.measure(1200.0)
    fitted(ros, node)
    ros.executor.spin_once(timeout_sec=1.0)
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


def test_at_the_end_another_imu_is_saved_too_and_drawings_come_last(ros: Ros) -> None:
    state = ros.folder / 'state'
    node = begin(ros, state_file=str(state))
    other = replaced(ros, node, Sensor(ros), 600.0)

    def heard() -> bool:
        other.measure(5.0, frame_id='other')
        return 'are of another IMU' in node.log

    ros.until(heard)
    other.unplug()
    assert node.stop(within_s=10.0) == 0, node.log
    files = sorted([state, *(ros.folder / 'output').glob('*/*')],
                   key=lambda path: path.stat().st_mtime_ns)
    names = [path.name for path in files]
    assert (names[0], names[-1]) == ('state', 'allan_deviation.png')
    assert (names.count('result.json'), names.count('allan_deviation.png')) == (2, 1)
    assert sorted(json.loads(path.read_text())['source']['frame_id']
                  for path in files if path.name == 'result.json') == ['imu', 'other']


def test_a_run_that_a_stranger_has_replaced_goes_on_when_its_imu_returns(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros)
    other = replaced(ros, node, sensor, 300.0)

    def begun() -> bool:
        other.measure(5.0, frame_id='other')
        return 'a new run begins' in node.log

    ros.until(begun, timeout=60.0)
    other.unplug()
    sensor.now_ns = other.now_ns
    sensor.plug_in()

    def returned() -> bool:
        sensor.measure(5.0)
        return 'goes on' in node.log

    ros.until(returned, timeout=60.0)
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=100)
    assert document['source']['frame_id'] == 'imu'


def plugged_in(ros: Ros, node: Process, sensor: Sensor, bias: Sequence[float]) -> None:
    """Let a sensor measure for two minutes with the turn-on bias of this power-on."""
    sensor.bias[:3] = bias
    sensor.plug_in()
    go_on(ros, sensor, 2, 60.0)
    fitted(ros, node)


def test_replugs_are_power_ons_and_no_random_walk(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros)
    biases = np.random.default_rng(3).normal(0, 0.1, (6, 3))
    for bias in biases:
        plugged_in(ros, node, sensor, bias)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=100)
    assert_density(document, 50.0)
    for number, name in enumerate(list(AXES)[:3]):
        axis = document['axes'][name]
        for key in ('rate_random_walk', 'bias_instability', 'rate_ramp'):
            assert not axis['coefficients'][key]['observable'], (name, key)
        low, high = document['turn_on_bias'][name]['ci95']
        assert low < np.std(biases[:, number], ddof=1) < high
    assert node.log.count('may have been switched off and on') == 5
    assert 'a new run begins' not in node.log


def test_a_single_replug_is_a_power_on_and_no_step_of_the_bias(ros: Ros) -> None:
    node, sensor = begin(ros), Sensor(ros, 100.0)
    for bias in ((0.0, 0.0, 0.0), (0.01, -0.02, 0.1)):
        plugged_in(ros, node, sensor, bias)
    document = saved(ros, sensor)
    assert node.log.count('may have been switched off and on') == 1
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=10)
    assert not {'bias_step', 'warm_up', 'slow_cycle', 'trend_or_walk', 'not_steady'} & {
        warning['code'] for warning in document['warnings']}
    for name, sigma in zip(AXES, np.abs(sensor.bias[:3]) / 2**0.5, strict=False):
        assert document['turn_on_bias'][name]['sigma'] == pytest.approx(sigma, rel=0.1), name
        for key in ('rate_random_walk', 'bias_instability', 'rate_ramp'):
            assert not document['axes'][name]['coefficients'][key]['observable'], (name, key)


@pytest.mark.parametrize('checkpoint_s', [1.0, slow(60.0)])
def test_another_sensor_of_the_same_name_and_rate_is_another_imu(
        ros: Ros, checkpoint_s: float) -> None:
    node = begin(ros, checkpoint_period=checkpoint_s, state_file=str(ros.folder / 'state'))
    sensor = Sensor(ros, 100.0)
    sensor.plug_in()
    go_on(ros, sensor, 2, 30.0)
    fitted(ros, node)
    sensor.noise *= 1.2
    sensor.plug_in()

    def begun() -> bool:
        sensor.measure(5.0)
        return 'a new run begins' in node.log

    ros.until(begun, timeout=90.0)
    sensor.measure(30.0)
    assert_density(saved(ros, sensor), 100.0, sensor.noise)

