# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that no sensor has at rest, with the likeliest reason."""

from imu_allan.block import ImuBlock
from imu_allan.characterization.stream import Characterization
import numpy as np
import pytest

START_NS = 1_700_000_000_000_000_000


def implausible_axes(gyro: float, gyro_bias: float, accel: float) -> dict[str, tuple[str, str]]:
    """Characterize 100 s at 100 Hz with noise of a sample and a bias; what is reported by axis."""
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(10_000, 6)) * np.repeat([gyro, accel], 3)
    samples[:, :3] += gyro_bias
    samples[:, 5] += 9.81
    stamps = START_NS + 10_000_000 * np.arange(10_000)
    run = Characterization(kind='recording', path='x', topic='/imu')
    run.update(ImuBlock(stamps, stamps, samples, np.zeros((10_000, 2), bool), 'imu'))
    run.finish()
    return {axis: (found.values['what'], found.values['likely'])
            for found in run.result().warnings if found.code == 'implausible'
            for axis in found.axes}


@pytest.mark.parametrize(('gyro', 'bias', 'accel', 'said'), [
    (0.005, 0.02, 0.05, {}),
    # A poor one of 17 deg/h beside the turn of the Earth, and a quiet one.
    (1e-6, 7.3e-5, 1e-3, {}),
    (0.1, 0.5, 0.02, {'gyro': ('noise_density', 'deg/s')}),
    (0.03, 1.5, 0.02, {'gyro': ('mean', 'deg/s')}),
    (13.0, 40.0, 0.02, {'gyro': ('noise_density', 'counts')}),
    (0.001, 0.0, 2.0, {'accel': ('noise_density', 'mg')}),
    (0.001, 0.0, 200.0, {'accel': ('noise_density', 'counts')}),
])
def test_what_no_sensor_has_at_rest_is_reported_with_the_likeliest_unit(gyro, bias, accel, said):
    found = implausible_axes(gyro, bias, accel)
    assert found == {f'{sensor}_{axis}': why for sensor, why in said.items() for axis in 'xyz'}
