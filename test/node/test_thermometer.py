# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A thermometer on a topic of its own beside the IMU."""

import json
from typing import Any

from imu_allan.cdr import encode_imu
import numpy as np
import pytest
from ros_harness import Driver, Health, Ros
from sensor_msgs.msg import Temperature
from std_msgs.msg import String

SECOND = 10**9
START = 1_700_000_000 * SECOND
RATE_HZ = 2.0
SAMPLES = 7200
PER_KELVIN = 2e-3


def celsius(seconds: Any) -> Any:
    """Temperature of an hour that settles, with a dip that no ramp or warm-up has."""
    return 25 + 12 * (1 - np.exp(-seconds / 700)) - 3 * np.exp(-((seconds - 2000) / 300)**2)


def reading(stamp_ns: int, value: float) -> Temperature:
    message = Temperature(temperature=value)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND)
    return message


def test_the_bias_is_fitted_over_the_temperature_of_the_topic(ros: Ros, health: Health) -> None:
    ros.start('imu_allan_node', {'publish_period': 0.5, 'motion': 'keep',
                                 'temperature_topic': 'imu/temperature'},
              constants={'thermometer._MATCHING_S': 1.0})
    driver = Driver(ros).wait_for_node()
    ros.until(lambda: health.said('reception', f'nothing publishes {ros.name("imu/temperature")}: '
                                  'there is no temperature'))
    publisher = ros.node.create_publisher(Temperature, ros.name('imu/temperature'), 10_000)
    ros.until(lambda: publisher.get_subscription_count() == 1)
    results = ros.listen(String, 'imu_allan/result')
    seconds = np.arange(SAMPLES) / RATE_HZ
    samples = np.random.default_rng(3).normal(0, 1e-3, (SAMPLES, 6))
    samples[:, 0] += PER_KELVIN * celsius(seconds)
    for number, (second, sample) in enumerate(zip(seconds, samples, strict=True)):
        stamp = START + round(second * 1e9)
        driver.send(encode_imu(stamp, sample, 'imu'))
        if number % 8 == 0:
            # In kelvin, which is taken as in a recording.
            publisher.publish(reading(stamp, float(celsius(second)) + 273.15))

    def fitted() -> Any:
        document = json.loads(results[-1].data) if results else {'timeline': {'samples': 0}}
        return document if document['timeline']['samples'] == SAMPLES else None

    axes = ros.until(fitted)['axes']
    assert health.number('reception', 'temperature_c') == pytest.approx(
        celsius((SAMPLES - 8) / RATE_HZ), abs=1e-6)
    found = {name: axis['trend']['temperature'] for name, axis in axes.items()}
    assert [name for name, one in found.items() if one] == ['gyro_x']
    low, high = found['gyro_x']['ci95']
    assert low < PER_KELVIN < high
    assert high - low < 0.1 * PER_KELVIN
    assert not axes['gyro_x']['coefficients']['rate_random_walk']['observable']
