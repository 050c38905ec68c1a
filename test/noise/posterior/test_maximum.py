# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The likelihood of a spectrum and its maximum, against what is worked out in another way."""


from characterized import shown
from imu_allan.noise import spectrum
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.non_negative import non_negative
from imu_allan.noise.posterior.regression import mean, regressors
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.groups import FLICKER, grouped, RANDOM_WALK, WHITE
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.optimize import nnls


def bins_of_record(samples, dt):
    return bins_of(shown(samples).periodogram.sections(), dt)


@pytest.mark.parametrize('known', ['mean', 'mean and ramp'])
def test_likelihood_is_that_of_the_samples_without_what_is_known_of_their_mean(known):
    dt, place = 0.1, np.arange(48)
    record = simulate({'noise_density': 1.0, 'rate_random_walk': 1.0}, len(place), 1 / dt, 5)
    groups = grouped(bins_of_record(record, dt), 0)
    # Of a random walk from zero, averaged over each interval.
    walk = dt * (np.minimum.outer(place, place) + 0.5 - np.eye(len(place)) / 6)
    columns = np.vander(place, len(known.split(' and ')))
    free = np.linalg.svd(columns)[0][:, columns.shape[1]:]

    def exact(density, walking):
        covariance = free.T @ (density / dt * np.eye(len(place)) + walking * walk) @ free
        rest = free.T @ record
        return 0.5 * (np.linalg.slogdet(covariance)[1]
                      + rest @ np.linalg.solve(covariance, rest))

    def found(density, walking):
        theta = np.array([0.0, density, 0.0, walking])
        weight = groups.dof / (groups.design @ theta)
        gain = mean(regressors([groups]), 1, weight[None])[0][0] if 'ramp' in known else 0.0
        return maximise(groups, fixed=dict(enumerate(theta))).loss - gain

    for other in ((2.0, 0.3), (0.1, 5.0), (1.0, 1e-6)):
        assert found(*other) - found(1.0, 1.0) == pytest.approx(exact(*other) - exact(1.0, 1.0),
                                                                rel=1e-6)


def test_columns_are_the_spectra_of_the_means_of_every_stage():
    dt = 0.5
    sections = shown(simulate({'noise_density': 1.0}, 100_000, 1 / dt)).periodogram.sections()
    bins = bins_of(sections, dt)
    assert {section.step for section in sections} == {1, 16}
    for number, section in enumerate(sections):
        here = bins.section == number
        step, nu = section.step * dt, bins.index[here] / (2 * section.length)
        np.testing.assert_allclose(bins.frequency[here], nu / step)
        for column, expected in (
                (WHITE, spectrum.white(nu, step)), (RANDOM_WALK, spectrum.random_walk(nu, step)),
                (FLICKER, spectrum.flicker(nu, step)
                 * spectrum.flicker_dct_factor(bins.index[here]))):
            np.testing.assert_allclose(bins.design[here, column], expected, rtol=1e-12)
        # A ramp has a mean in the whole-record part, whose signs are known; in blocks a square.
        ramp = spectrum.ramp_dct(section.length, step)[bins.index[here] - 1]
        whole = section.coefficients is not None
        np.testing.assert_allclose(bins.ramp[here], ramp**2 if whole else -ramp**2)
        np.testing.assert_array_equal(bins.dof[here], section.blocks)
        assert (bins.whole[here] == whole).all()


def test_maximum_is_found_and_stays_and_no_coefficient_is_negative():
    groups = grouped(bins_of_record(simulate(
        {'noise_density': 1e-3, 'bias_instability': 1e-3, 'rate_random_walk': 2e-4}, 144_000,
        20.0, 3), 0.05), 0)
    best = maximise(groups)
    assert np.all(best.theta >= 0)

    def loss(theta):
        expected = groups.design @ theta
        return 0.5 * groups.dof @ (np.log(expected) + groups.power / expected)

    assert loss(best.theta) == pytest.approx(best.loss)
    for column in (WHITE, RANDOM_WALK):
        for factor in (0.98, 1.02):
            other = best.theta.copy()
            other[column] *= factor
            assert loss(other) > best.loss
    # From so far away whole steps lead astray.
    afar = maximise(groups, start=np.array([1e-3, 0.0, 0.0, 0.0]))
    assert afar.loss == pytest.approx(best.loss, abs=1e-6)
    behind = maximise(groups, tolerance=-np.inf)
    # A loss of 1e-6 is a thousandth of a standard error.
    np.testing.assert_allclose(behind.theta, best.theta, rtol=1e-3, atol=1e-15)
    assert best.loss - 1e-6 < behind.loss <= best.loss


def test_small_non_negative_least_squares_agrees_with_scipy():
    rng = np.random.default_rng(1)
    problems = [(rng.standard_normal((12, 4)) * 10.0 ** rng.integers(-6, 7, 4),
                 rng.standard_normal(12)) for _ in range(200)]
    # Columns that cannot be distinguished share what they explain.
    same = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [3.0, 3.0, 1.0]])
    problems += [(same, np.array([sign, 2 * sign, last])) for sign, last in (
        (1.0, 3.0), (1.0, 9.0), (-1.0, -3.0), (1.0, -9.0))]
    for a, b in problems:
        part = non_negative(a.T @ a, a.T @ b)
        assert (part >= 0).all()
        np.testing.assert_allclose(a @ part, a @ nnls(a, b)[0], atol=1e-6)
