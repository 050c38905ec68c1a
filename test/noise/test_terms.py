# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.terms import (
    allan_variance,
    low_passed_avar,
    Quantity,
    TERMS,
)
import numpy as np
import pytest

GYRO, ACCEL = Quantity.ANGULAR_VELOCITY, Quantity.LINEAR_ACCELERATION


def test_a_term_has_the_name_that_its_sensor_gives_it_and_its_coefficient_where_it_is_read():
    assert TERMS['noise_density'].name(GYRO) == 'angle random walk'
    assert TERMS['noise_density'].name(ACCEL) == 'velocity random walk'
    for term in TERMS.values():
        if term.read_at is not None:
            assert term.adev(3.0, term.read_at) == pytest.approx(3.0)
    assert TERMS['bias_instability'].adev(1.0, 7.0) == pytest.approx(0.66428, abs=1e-5)


@pytest.mark.parametrize(('key', 'expected'), [
    ('quantization_noise', 3 * 4 / 25), ('noise_density', 4 / 5),
    ('bias_instability', 2 * np.log(2) / np.pi * 4), ('rate_random_walk', 4 * 5 / 3),
    ('rate_ramp', 4 * 25 / 2)])
def test_allan_variance_is_the_formula_of_the_standard(key, expected):
    for sign in (1, -1):
        assert allan_variance({key: sign * 2.0}, 5.0) == pytest.approx(expected)
        assert allan_variance({key: sign * 2.0, 'noise_density': 1.0}, 5.0) == pytest.approx(
            expected + (0.2 if key != 'noise_density' else 0.2 - expected))


@pytest.mark.parametrize('width', [1, 2, 3, 8, 50])
@pytest.mark.parametrize('size', [1, 2, 7, 8, 9, 16, 300])
def test_allan_variance_of_a_moving_average_is_that_of_its_weights(width, size):
    # The difference of two cluster means is a weighted sum of independent samples.
    dt = 0.25
    difference = np.concatenate((np.full(size, -1.0), np.full(size, 1.0))) / size
    weights = np.convolve(difference, np.ones(width) / width)
    exact = 0.5 * weights @ weights * 3.0**2 / dt
    window = np.sqrt(width**2 - 1) * dt
    assert low_passed_avar(3.0, window, size, dt) == pytest.approx(exact, rel=1e-10)


def test_a_window_between_two_means_lies_between_their_allan_variances():
    sizes = np.array([1, 4, 64])
    wide, between, narrow = (low_passed_avar(1.0, window, sizes, 1.0)
                             for window in (np.sqrt(8), 2.2, np.sqrt(3)))
    assert (np.minimum(wide, narrow) < between).all()
    assert (between < np.maximum(wide, narrow)).all()
    # In the long run each leaves the density alone.
    for window in (0.0, 0.3, 2.2, 7.7):
        assert low_passed_avar(3.0, window, 10**6, 1.0) == pytest.approx(9e-6, rel=1e-5)
