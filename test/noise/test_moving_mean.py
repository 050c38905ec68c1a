# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A mean that moves is distinguished from a random walk."""

from characterized import characterized, one_axis, taken_in
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import about_mean, mean, regressors
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import grouped
from imu_allan.noise.simulate import simulate
from imu_allan.writers.included import included
import numpy as np
import pytest

RATE = 20.0
HOURS_2 = 144_000
STILL = {'noise_density': 1e-3, 'bias_instability': 1e-3}
TIME = np.arange(HOURS_2) / RATE


def test_slow_cycle_is_no_random_walk():
    axis, remarks = characterized(
        simulate(STILL, HOURS_2, RATE, 2) + 3e-3 * np.sin(2 * np.pi * TIME / 1200 + 1), RATE)
    assert not axis.coefficients['rate_random_walk'].observable
    assert remarks['slow_cycle'] == {'period_s': axis.trend.cycle_s}
    assert axis.trend.warm_up is None
    assert axis.trend.cycle_s == pytest.approx(1200, rel=0.05)
    [said] = included({'gyro_y': axis})
    assert said == ("The slow cycle of gyro y, such as a heater's, of about 20 min is in these "
                    'numbers, unlike in the coefficients: right where the filter will meet it, '
                    'too; else record without it.')


def test_a_step_too_small_to_be_certain_is_seldom_a_random_walk():
    gyro = {'noise_density': 7.9e-5, 'bias_instability': 2.4e-5}
    found = [characterized(simulate(gyro, HOURS_2, RATE, seed)
                           + 5 * 2.4e-5 * (TIME > 0.3 * 7200), RATE) for seed in range(8)]
    # One in ten; more than three of eight come once in 200 times.
    assert sum(axis.coefficients['rate_random_walk'].observable for axis, _ in found) <= 3
    assert any('bias_step' in remarks for _, remarks in found)


@pytest.mark.parametrize('model', [STILL, {**STILL, 'rate_random_walk': 2e-4}])
def test_where_the_mean_stands_still_or_walks_there_is_no_such_word(model):
    axis, remarks = characterized(simulate(model, HOURS_2, RATE, 3), RATE)
    assert not remarks.keys() & {'warm_up', 'slow_cycle', 'trend_or_walk'}
    assert axis.coefficients['rate_random_walk'].observable == ('rate_random_walk' in model)
    assert axis.trend.cycle_s is None
    assert included({'gyro_y': axis}) == []


def test_a_ramp_of_any_slope_leaves_the_restricted_fit_as_it_is():
    record = simulate({**STILL, 'rate_random_walk': 1e-4}, HOURS_2, RATE, 4)
    solutions = []
    for slope in (0.0, 1e-7, -1e-5):
        sections = taken_in(record + slope * TIME).finished().periodogram.sections()
        groups = grouped(bins_of(sections, 1 / RATE), 0)
        theta = maximise(groups, fixed={0: 0.0}, moving_mean=True).theta
        solutions.append((theta, about_mean(groups)(groups.design @ theta)[2]))
    for slope, solution in zip((1e-7, -1e-5), solutions[1:], strict=True):
        np.testing.assert_allclose(solution[0], solutions[0][0], rtol=2e-3)
        assert solution[1] - solutions[0][1] == pytest.approx(slope, rel=1e-3)


def test_restricted_likelihood_is_that_of_what_the_ramp_leaves_over():
    record = simulate({'noise_density': 1.0, 'rate_random_walk': 1.0}, 300, RATE, 5)
    [section] = taken_in(record).finished().periodogram.sections()
    groups = grouped(bins_of([section], 1 / RATE), 0)
    c = section.coefficients[0, 1:]
    ramp = bins_of([section], 1 / RATE).ramp
    # Any orthonormal basis of what is orthogonal to the ramp has this likelihood.
    basis = np.linalg.svd(np.sqrt(ramp)[:, None])[0][:, 1:]

    def exact(theta):
        covariance = basis.T @ np.diag(bins_of([section], 1 / RATE).design @ theta) @ basis
        rest = basis.T @ c
        return 0.5 * (np.linalg.slogdet(covariance)[1]
                      + rest @ np.linalg.solve(covariance, rest))

    one, other = np.array([0, 1.0, 0, 1.0]), np.array([0, 2.0, 0, 0.3])
    def loss(theta):
        expected = groups.design @ theta
        gain = mean(regressors([groups]), 1, (groups.dof / expected)[None])[0][0]
        return 0.5 * groups.dof @ (np.log(expected) + groups.power / expected) - gain

    ours = [loss(theta) for theta in (one, other)]
    # Above index 48 coefficients of one band share a mean expectation.
    assert ours[1] - ours[0] == pytest.approx(exact(other) - exact(one), rel=2e-3)


def test_a_record_of_nothing_but_short_runs_has_coefficients():
    estimator = Estimator()
    rng = np.random.default_rng(4)
    for _ in range(3000):
        estimator.update(1e-3 * rng.standard_normal(20))
        estimator.start_run()
    density = one_axis(estimator, RATE)[0].coefficients['noise_density']
    assert density.value == pytest.approx(1e-3 / RATE**.5, rel=0.03)
