# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that no sensor has at rest, with the likeliest reason."""

from characterized import messages
from imu_allan.characterization import characterize
from imu_allan.characterization.stream import Characterization
from imu_allan.sensor.plausible import implausible
import numpy as np
import pytest


def implausible_axes(gyro: float, gyro_bias: float, accel: float) -> dict[str, tuple[str, str]]:
    """Characterize 100 s at 100 Hz with noise of a sample and a bias; what is reported by axis."""
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(10_000, 6)) * np.repeat([gyro, accel], 3)
    samples[:, :3] += gyro_bias
    samples[:, 5] += 9.81
    run = Characterization(kind='recording', path='x', topic='/imu')
    run.update(messages(samples, 100.0))
    run.finish()
    return {axis: (found.values['what'], found.values['likely'])
            for found in run.result().warnings if found.code == 'implausible'
            for axis in found.axes}


@pytest.mark.parametrize(('gyro', 'bias', 'accel', 'said'), [
    (0.005, 0.02, 0.05, {}),
    # A poor one of 17 deg/h beside the turn of the Earth, and a quiet one.
    (1e-6, 7.3e-5, 1e-3, {}),
    (0.03, 2.0, 0.02, {'gyro': ('mean', 'deg/s')}),
    (13.0, 40.0, 0.02, {'gyro': ('noise_density', 'counts')}),
    (0.001, 0.0, 3.0, {'accel': ('noise_density', 'mg')}),
    # A gyroscope of 20,000 deg/s, and the zero rate of another, beside an accelerometer of 100 g.
    (0.0436, 1.31, 1.47, {}),
])
def test_what_no_sensor_has_at_rest_is_reported_with_the_likeliest_unit(gyro, bias, accel, said):
    found = implausible_axes(gyro, bias, accel)
    assert found == {f'{sensor}_{axis}': why for sensor, why in said.items() for axis in 'xyz'}


def test_a_spread_is_reported_where_the_noise_density_is_not_known():
    # What alternates is a line, and no noise beside it.
    swing = np.tile([0.7, -0.7], 500) + np.random.default_rng(0).normal(size=1000) * 1e-3
    [found] = implausible({'gyro_x': characterize(swing, 100.0)})
    assert found.values['what'] == 'spread'
    assert found.values['likely'] == 'deg/s'
