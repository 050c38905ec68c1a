# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A robot in daily work: the IMU is at rest only while the robot stops."""

from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.noise.terms import AXES
from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
import pytest
from repeated import slow
from ros_harness import assert_density, Driver, Ros
from std_srvs.srv import Trigger
from whole_lines import Varying

MODEL = """
gyro: {noise_density: 1e-4 rad/s/sqrt(Hz), bias_instability: 2e-5 rad/s,
       rate_random_walk: 2e-6 rad/s^2/sqrt(Hz)}
accel: {noise_density: 2e-3 m/s^2/sqrt(Hz), bias_instability: 4e-4 m/s^2,
        rate_random_walk: 5e-5 m/s^3/sqrt(Hz), z: {mean: 9.81 m/s^2}}
"""
RATE_HZ = 25.0
TRUE = {'gyro': {'noise_density': 1e-4, 'bias_instability': 2e-5, 'rate_random_walk': 2e-6},
        'accel': {'noise_density': 2e-3, 'bias_instability': 4e-4, 'rate_random_walk': 5e-5}}


class Robot:
    """Drives, turns, stops with and without its engine; its IMU goes through it all."""

    def __init__(self, seed: int) -> None:
        self._imu = SimulatedImu(parse_model(MODEL), RATE_HZ, seed)
        self._random = np.random.default_rng(seed)
        self._next = 0
        self.run = Characterization(kind='topic', topic='/imu')
        self.at_rest_s = 0.0

    @property
    def time_s(self) -> float:
        """Since the robot was switched on."""
        return self._next / RATE_HZ

    def stop(self, seconds: float) -> None:
        """Stand still, the engine off."""
        self.at_rest_s += seconds
        self._pass(seconds, 0.0, 0.0)

    def idle(self, seconds: float) -> None:
        """Stand still with an engine that shakes the robot at 8.3 Hz."""
        time = (self._next + np.arange(round(seconds * RATE_HZ))) / RATE_HZ
        shaking = np.sin(2 * np.pi * 8.3 * time)[:, None] * np.repeat([0.01, 0.3], 3)
        self._pass(seconds, 0.0, 0.0, shaking)

    def drive(self, seconds: float) -> None:
        """Drive on uneven ground, in slow bends."""
        time = (self._next + np.arange(round(seconds * RATE_HZ))) / RATE_HZ
        bends = np.zeros((len(time), 6))
        bends[:, 2] = 0.1 * np.sin(2 * np.pi * time / 20)
        self._pass(seconds, 0.05, 0.6, bends)

    def turn(self, seconds: float) -> None:
        """Turn on the spot."""
        self._pass(seconds, 0.01, 0.1, np.array([0, 0, 0.5, 0, 0, 0]))

    def day(self, hours: float) -> None:
        """Work: stops of 5 s to 10 min between drives, a quarter of them with the engine on."""
        end = self.time_s + hours * 3600
        draw = self._random
        while self.time_s < end:
            self.drive(draw.uniform(10, 600))
            if draw.random() < 0.3:
                self.turn(draw.uniform(3, 10))
            seconds = float(np.exp(draw.uniform(np.log(5), np.log(600))))
            (self.idle if draw.random() < 0.25 else self.stop)(seconds)

    def _pass(self, seconds: float, gyro: float, accel: float, motion: Any = 0.0) -> None:
        count = round(seconds * RATE_HZ)
        samples = self._imu.draw(count) + motion
        if gyro:
            samples += self._random.normal(0, np.repeat([gyro, accel], 3), (count, 6))
        stamps = 10**18 + np.rint((self._next + np.arange(count)) / RATE_HZ * 1e9).astype(np.int64)
        self._next += count
        self.run.update(ImuBlock(stamps, stamps, samples, np.zeros((count, 2), bool), 'imu'))


def assert_honest(result: Result) -> None:
    """Every interval or bound is about the true value, with room for chance."""
    for name, axis in result.axes.items():
        assert axis.coefficients['noise_density'].observable
        for key, true in TRUE[name.partition('_')[0]].items():
            low, high = axis.coefficients[key].ci95 or (0.0, axis.coefficients[key].upper95 or 0.0)
            assert low - (high - low) < true < high + (high - low), (name, key, low, high)
        assert axis.goodness_of_fit.acceptable


@pytest.mark.parametrize(('seed', 'hours'), [(1, 2), slow(3, 7 * 24)])
def test_stop_and_go_shows_the_noise_of_the_sensor(seed: int, hours: float) -> None:
    robot = Robot(seed)
    robot.stop(120)
    robot.day(hours)
    result, summary = robot.run.result(), robot.run.summary()
    assert_honest(result)
    used_s = summary.timeline.samples / RATE_HZ - summary.excluded_s
    assert 0.7 * robot.at_rest_s < used_s < 1.02 * robot.at_rest_s


def test_a_node_that_starts_on_a_moving_robot_learns_from_stops_and_an_axis_falls_quiet(
        ros: Ros) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5}, constants={'reports.LOOK_S': 1.0})
    driver = Driver(ros).wait_for_node()
    driver.publish(5000, rate_hz=50.0, shaken=30.0)
    driver.publish(15_000, rate_hz=50.0)
    assert driver.publisher.wait_for_all_acked()

    def saved() -> Any:
        driver.publish(200, rate_hz=50.0)
        driver.until_taken()
        document = ros.saved()
        return document if document and set(document['axes']) == set(AXES) else None

    assert_density(ros.until(saved), 50.0)
    assert ros.call(Trigger, 'imu_allan/reset').success
    before = driver.next
    # A fan shakes one axis, and is switched off: two minutes until the new level is believed.
    driver.publish(5000, rate_hz=50.0, shaken=[5.0, 1, 1, 1, 1, 1])
    driver.publish(9000, rate_hz=50.0)
    assert driver.publisher.wait_for_all_acked()
    line = Varying('the noise changed for good: <number> times at about <number> s. -> call '
                   '~/reset to characterize the present level alone')
    ros.until(lambda: driver.publish(100, rate_hz=50.0) or line in node.lines)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == driver.next - before
    assert 'a new run begins' not in node.log
