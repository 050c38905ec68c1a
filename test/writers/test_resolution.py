# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.simulate import flicker
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet import check
from imu_allan.writers.datasheet.live import check_state
import numpy as np
import pytest
from repeated import slow
from whole_lines import Varying

SIGMA, RATE_HZ = 0.01, 100.0
DENSITY = SIGMA / np.sqrt(RATE_HZ)
WHITE = SIGMA * np.random.default_rng(1).normal(size=(10_000, 6))[:, :3]


def test_flicker_that_is_none_is_judged_by_the_curve_live_and_afterwards(streamed):
    count = 30_000
    slow = 0.05 * flicker(count, np.random.default_rng(2), 0.6)
    stream = streamed(SIGMA * np.random.default_rng(1).normal(size=count) + slow, RATE_HZ)
    axis = stream.result().axes['gyro_x']
    assert axis.power_law is not None
    bound = axis.coefficients['bias_instability'].upper95
    for limit, outcome in ((2 * bound, 'pass'), (bound / 2, 'cannot tell')):
        model = parse_model(f'gyro: {{x: {{bias_instability: {limit} rad/s}}}}')
        found = check_state(stream, model)
        assert [one.verdict for one in found.verdicts] == [outcome]
        assert found.decided == (outcome == 'pass')


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


@pytest.mark.parametrize('step', [1.54, slow(2.0)])
def test_what_is_cut_towards_zero_does_not_pass_below_what_it_can_show(verdicts_of, step):
    found = verdicts_of(step, 0.7, np.trunc)
    assert found.verdict == 'cannot tell'
    assert found.reason == Varying(
        'gyro_x N: the output steps by <number> rad/s, <number> times the noise of one sample, '
        'and hides what is limited; record with a finer resolution')
    assert verdicts_of(step, 3.0, np.trunc).verdict == 'pass'
    # The jumps of a tenth of the samples are no slow noise.
    assert verdicts_of(step, 1.0, np.trunc, key='bias_instability').verdict == 'cannot tell'


def test_noise_above_half_a_step_is_judged_as_any(verdicts_of):
    for limit, outcome in ((0.7, 'fail'), (1.3, 'pass')):
        assert verdicts_of(1.5, limit, mean=0.3).verdict == outcome
    assert verdicts_of(0.5, 0.7).verdict == 'fail'
    # Beyond what steps can make of nothing, a limit is broken whatever they hide.
    assert verdicts_of(1.5, 0.3).verdict == 'fail'


def test_noise_of_which_next_to_nothing_is_left_is_that_of_no_sensor(verdicts_of):
    found = verdicts_of(6.2, 3.0)
    assert found.verdict == 'fail'
    assert found.reason == Varying(
        'gyro_x N: the axis is all but constant: its output steps by 0.062 rad/s, <number> times '
        'the noise of one sample')
