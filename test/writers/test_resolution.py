# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts on noise that is not what it seems, live and afterwards."""

from imu_allan.noise.simulate import simulate
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet import check
from imu_allan.writers.datasheet.live import check_state
import numpy as np
import pytest
from whole_lines import Varying

SIGMA, RATE_HZ = 0.01, 100.0
DENSITY = SIGMA / np.sqrt(RATE_HZ)
WHITE = SIGMA * np.random.default_rng(1).normal(size=(10_000, 6))[:, :3]


@pytest.fixture
def verdicts_of(streamed):
    def verdicts_of(step, limit, rounded=np.round, mean=0.0, key='noise_density'):
        """Return the verdict on gyro_x with a step in its noise and a limit in its density."""
        rows = WHITE + np.array([mean, 0, 0])
        rows[:, 0] = step * SIGMA * rounded(rows[:, 0] / (step * SIGMA))
        stream = streamed(rows, RATE_HZ)
        unit = {'noise_density': 'rad/s/sqrt(Hz)', 'bias_instability': 'rad/s'}[key]
        model = parse_model(f'gyro: {{x: {{{key}: {limit * DENSITY} {unit}}}}}')
        (said,), (live,) = check(stream.result(), model), check_state(stream, model).verdicts
        assert live.verdict == said.verdict
        return said
    return verdicts_of


def test_what_is_cut_towards_zero_does_not_pass_below_what_it_can_show(verdicts_of):
    found = verdicts_of(1.54, 0.7, np.trunc)
    assert found.verdict == 'cannot tell'
    assert found.reason == Varying(
        'gyro_x N: the output steps by <number> rad/s, <number> times the noise of one sample, '
        'and hides what is limited; record with a finer resolution')
    assert verdicts_of(1.54, 3.0, np.trunc).verdict == 'pass'
    # The jumps of a tenth of the samples are no slow noise.
    assert verdicts_of(1.54, 1.0, np.trunc, key='bias_instability').verdict == 'cannot tell'


def test_noise_above_half_a_step_is_judged_as_any(verdicts_of):
    for limit, outcome in ((0.7, 'fail'), (1.3, 'pass')):
        assert verdicts_of(1.5, limit, mean=0.3).verdict == outcome
    assert verdicts_of(0.5, 0.7).verdict == 'fail'
    # Beyond what steps can make of nothing, a limit is broken whatever they hide.
    assert verdicts_of(1.5, 0.3).verdict == 'fail'


@pytest.mark.parametrize('seed', [0, 1])
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
