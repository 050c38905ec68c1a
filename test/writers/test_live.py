# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.simulate import flicker, simulate
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet.live import check_state
import numpy as np
import pytest


def test_slow_noise_beside_white_noise_leaves_a_good_and_a_bad_unit_on_the_bench(streamed):
    rate, density, seed = 100.0, 1e-3, 9030
    slow = flicker(1024, np.random.default_rng([seed, 77]), 0.7)
    # As strong as the white noise at 1 Hz.
    stream = streamed(simulate({'noise_density': density}, 1024, rate, seed)
                      + density * np.sqrt(rate * (2 * np.pi / rate)**0.7) * slow, rate)
    limits = {share: parse_model(f'gyro: {{x: {{noise_density: {density / share} '
                                 'rad/s/sqrt(Hz)}}') for share in (0.7, 1.5)}
    found = {share: check_state(stream, limit) for share, limit in limits.items()}
    assert {share: one.verdicts[0].verdict for share, one in found.items()} == {
        0.7: 'pass', 1.5: 'fail'}


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_random_walk_that_may_level_off_fails_no_unit_on_the_bench(streamed, seed):
    """Of a process of a minute the record says no more than a bound for the random walk."""
    flicker_size = 2.4e-5
    stream = streamed(simulate(
        {'noise_density': 7.9e-5, 'bias_instability': flicker_size,
         'gauss_markov': {'sigma': 3 * flicker_size, 'correlation_time_s': 60.0}},
        25_000, 10.0, seed), 10.0)
    limit = parse_model('gyro: {x: {rate_random_walk: 4.0e-6 rad/s^2/sqrt(Hz)}}')
    found = check_state(stream, limit).verdicts[0]
    assert stream.result().axes['gyro_x'].coefficients['rate_random_walk'].upper95 is not None
    assert found.verdict == 'cannot tell'
