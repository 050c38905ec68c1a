# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Signals whose slow part a filter has taken out, and those that merely look odd."""

import imu_allan
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.signal import lfilter

RATE_HZ, COUNT = 100.0, 60_000


def without_bias(samples: np.ndarray, gain: float) -> np.ndarray:
    """Do as imu_complementary_filter does at rest: bias += gain * (sample - bias)."""
    bias = lfilter([gain], [1, gain - 1], samples)
    settled = int(20 / gain)
    return (samples - np.concatenate([[0.0], bias[:-1]]))[settled:]


def sensor(seed: int, **more: float) -> np.ndarray:
    return simulate({'noise_density': 1e-4, **more}, COUNT, RATE_HZ, seed=seed)


@pytest.mark.parametrize(('gain', 'more'), [
    (0.01, {}), (0.01, {'rate_random_walk': 3e-6}), (0.02, {'bias_instability': 2e-5})])
def test_a_filter_that_subtracts_its_estimate_of_the_bias_is_told(gain, more):
    axis = imu_allan.characterize(without_bias(sensor(3, **more), gain), RATE_HZ)
    assert not any(found.observable or found.upper95 for found in axis.coefficients.values())
    assert axis.goodness_of_fit.p_value is None


@pytest.mark.parametrize('more', [
    {}, {'bias_instability': 2e-5}, {'rate_random_walk': 1e-5}, {'quantization_noise': 1e-5},
    {'noise_density': 1e-9, 'quantization_noise': 1e-5}])
def test_a_sensor_as_it_is_keeps_its_coefficients(more):
    axis = imu_allan.characterize(sensor(4, **more), RATE_HZ)
    assert any(found.observable for found in axis.coefficients.values())


def test_a_vibration_above_a_quiet_floor_is_no_such_filter():
    rng = np.random.default_rng(5)
    shaken = 3e-3 * np.diff(rng.normal(size=COUNT + 1))
    axis = imu_allan.characterize(sensor(6) + shaken, RATE_HZ)
    assert axis.goodness_of_fit.p_value is not None
