# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A robot in daily work: the IMU is at rest only while the robot stops."""

from math import log

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
import pytest
from repeated import slow

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
    """Its IMU goes through drives, turns and stops, with and without the engine."""

    def __init__(self, seed: int) -> None:
        self._imu = SimulatedImu(parse_model(MODEL), RATE_HZ, seed)
        self._random = np.random.default_rng(seed)
        self._next = 0
        self.run = Characterization(kind='topic', topic='/imu')
        self.at_rest_s = 0.0

    def day(self, hours: float) -> None:
        """Work: stops of 5 s to 10 min between drives, a quarter of them with the engine on."""
        draw, end = self._random, self._next + hours * 3600 * RATE_HZ
        while self._next < end:
            # On uneven ground, in slow bends; then, now and then, on the spot.
            self.go(draw.uniform(10, 600), [0.05, 0.6], bends=0.1)
            if draw.random() < 0.3:
                self.go(draw.uniform(3, 10), [0.01, 0.1], turn=0.5)
            seconds = float(np.exp(draw.uniform(log(5), log(600))))
            if draw.random() < 0.25:
                self.go(seconds, [0.0, 0.0], engine=1.0)
            else:
                self.stop(seconds)

    def stop(self, seconds: float) -> None:
        """Stand still, the engine off."""
        self.at_rest_s += seconds
        self.go(seconds, [0.0, 0.0])

    def go(self, seconds: float, shaken: list[float], *, bends: float = 0.0, turn: float = 0.0,
           engine: float = 0.0) -> None:
        """Pass some seconds; an engine shakes gyroscope and accelerometer at 8.3 Hz."""
        numbers = self._next + np.arange(round(seconds * RATE_HZ))
        samples = self._imu.draw(len(numbers))
        if any(shaken):
            samples += self._random.normal(0, np.repeat(shaken, 3), samples.shape)
        samples[:, 2] += turn + bends * np.sin(2 * np.pi * numbers / RATE_HZ / 20)
        samples += np.outer(np.sin(2 * np.pi * 8.3 * numbers / RATE_HZ),
                            np.repeat([0.01, 0.3], 3)) * engine
        stamps = 10**18 + np.rint(numbers / RATE_HZ * 1e9).astype(np.int64)
        self._next += len(numbers)
        self.run.update(ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu'))


@pytest.mark.parametrize(('seed', 'hours'), [(1, 2), slow(3, 7 * 24)])
def test_stop_and_go_shows_the_noise_of_the_sensor(seed: int, hours: float) -> None:
    robot = Robot(seed)
    robot.stop(120)
    robot.day(hours)
    result, summary = robot.run.result(), robot.run.summary()
    for name, axis in result.axes.items():
        assert axis.coefficients['noise_density'].observable
        assert axis.goodness_of_fit.acceptable
        # Every interval or bound is about the true value, with room for chance.
        for key, true in TRUE[name.partition('_')[0]].items():
            low, high = axis.coefficients[key].ci95 or (0.0, axis.coefficients[key].upper95 or 0.0)
            assert low - (high - low) < true < high + (high - low), (name, key, low, high)
    used_s = summary.timeline.samples / RATE_HZ - summary.excluded_s
    assert 0.7 * robot.at_rest_s < used_s < 1.02 * robot.at_rest_s
