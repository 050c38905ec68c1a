# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan.noise import spectrum
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import mean, regressors
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import (
    FLICKER,
    grouped,
    joined_groups,
    QUANTIZATION,
    RANDOM_WALK,
    WHITE,
)
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz
from scipy.optimize import nnls


def kalman_loss(samples, density, walk, dt):
    """Minus the log-likelihood of white noise and averaged random walk, diffuse start."""
    # State: walk at the end of the interval, mean of the walk over the interval.
    transition = np.array([[1.0, 0.0], [1.0, 0.0]])
    q = walk**2 * dt * np.array([[1.0, 0.5], [0.5, 1 / 3]])
    r = density**2 / dt
    total = 0.0
    # The first sample only says where the walk is: exact diffuse initialisation.
    first = q[1, 1] + r
    state = np.array([samples[0], samples[0]])
    p = np.array([[q[0, 0] - 2 * q[0, 1] + first, 0.0], [0.0, 0.0]])
    for sample in samples[1:]:
        state = transition @ state
        p = transition @ p @ transition.T + q
        variance = p[1, 1] + r
        innovation = sample - state[1]
        total += 0.5 * (np.log(variance) + innovation**2 / variance)
        gain = p[:, 1] / variance
        state = state + gain * innovation
        p = p - np.outer(gain, p[1])
    return total


@pytest.mark.parametrize(('density', 'walk'), [(1e-3, 1e-3), (1e-3, 1e-1), (3e-3, 1e-5)])
def test_dct_likelihood_equals_that_of_a_kalman_filter(density, walk):
    dt, n = 0.1, 400
    samples = simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-3}, n, 1 / dt, seed=2)
    power = dct(samples, norm='ortho')[1:] ** 2
    nu = np.arange(1, n) / (2 * n)

    def dct_loss(density, walk):
        expected = (density**2 * spectrum.white(nu, dt)
                    + walk**2 * spectrum.random_walk(nu, dt))
        return 0.5 * np.sum(np.log(expected) + power / expected)

    # The two differ by the Jacobian of the transform, which no coefficient enters.
    reference = (1e-3, 1e-3)
    ours = dct_loss(density, walk) - dct_loss(*reference)
    kalman = kalman_loss(samples, density, walk, dt) - kalman_loss(samples, *reference, dt)
    assert ours == pytest.approx(kalman, rel=1e-8, abs=1e-8)


def test_quantization_column_is_the_exact_mean_power_of_a_block():
    n, dt = 64, 0.5
    covariance = toeplitz([2.0, -1.0, *[0.0] * (n - 2)]) / dt**2
    transform = dct(np.eye(n), axis=0, norm='ortho')
    exact = np.diag(transform @ covariance @ transform.T)[1:]
    estimator = Estimator()
    estimator.update(simulate({'noise_density': 1.0}, n, 1 / dt))
    bins = bins_of(estimator.finished().periodogram.sections(), dt)
    np.testing.assert_allclose(bins.design[:, QUANTIZATION], exact, rtol=1e-12)


def test_columns_are_the_spectra_of_the_means_of_every_stage():
    dt = 0.5
    estimator = Estimator()
    estimator.update(simulate({'noise_density': 1.0}, 100_000, 1 / dt))
    sections = estimator.finished().periodogram.sections()
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


@pytest.mark.parametrize('runs', [1, 2])
def test_groups_hold_every_bin_once_and_the_slowest_alone(runs):
    estimator = Estimator(2)
    for seed in range(runs):
        estimator.start_run()
        estimator.update(np.random.default_rng(seed).standard_normal((40_000, 2)))
    sections = estimator.finished().periodogram.sections()
    bins = bins_of(sections, 0.01)
    groups = grouped(bins, 1)
    assert (np.diff(groups.frequency) >= 0).all()
    assert groups.dof.sum() == bins.dof.sum()
    for name in ('frequency', 'power', 'ramp'):
        values = getattr(bins, name)
        values = values[1] if values.ndim == 2 else values
        assert groups.dof @ getattr(groups, name) == pytest.approx(bins.dof @ values)
    np.testing.assert_allclose(groups.dof @ groups.design, bins.dof @ bins.design)
    single = np.flatnonzero(bins.whole & (bins.index <= 48))
    assert len(single) == 48 * runs
    alone = groups.power[groups.dof == 1]
    assert set(bins.power[1, single]) <= set(alone)
    # An eighth of an octave wide at most.
    wide = len(groups.frequency) - len(single)
    assert wide < 2 * runs * 8 * np.log2(bins.frequency.max() / bins.frequency[single].max())


def test_bins_left_out_are_in_no_group():
    estimator = Estimator()
    estimator.update(np.random.default_rng(1).standard_normal(5000))
    bins = bins_of(estimator.finished().periodogram.sections(), 0.01)
    keep = np.random.default_rng(2).random(len(bins.dof)) > 0.3
    keep[:20] = False
    groups = grouped(bins, 0, keep)
    assert groups.dof.sum() == keep.sum()
    assert groups.frequency[0] == bins.frequency[20:][keep[20:]][0]
    assert groups.dof @ groups.power == pytest.approx(bins.power[0, keep].sum())


def test_maximum_is_found_and_no_coefficient_is_negative():
    estimator = Estimator()
    estimator.update(simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-4}, 50_000, 100, 7))
    groups = grouped(bins_of(estimator.finished().periodogram.sections(), 0.01), 0)
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


def test_going_on_behind_the_maximum_changes_nothing():
    estimator = Estimator()
    estimator.update(simulate({'noise_density': 1e-3, 'bias_instability': 1e-4}, 50_000, 100, 7))
    groups = grouped(bins_of(estimator.finished().periodogram.sections(), 0.01), 0)
    best, behind = maximise(groups), maximise(groups, tolerance=-np.inf)
    # A loss of 1e-6 is a thousandth of a standard error.
    np.testing.assert_allclose(behind.theta, best.theta, rtol=1e-3, atol=1e-15)
    assert best.loss - 1e-6 < behind.loss <= best.loss


def test_records_side_by_side_are_fitted_as_with_a_column_for_each():
    """Regressors by record give what all of them give as columns that are zero elsewhere."""
    parts = []
    for seed in range(3):
        estimator = Estimator()
        estimator.update(simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-3}, 4000, 10.0,
                                  seed) + 1e-3 * seed * np.arange(4000))
        bins = bins_of(estimator.finished().periodogram.sections(), 0.1)
        bend = np.where(bins.whole, np.exp(-bins.index / 10), 0.0)[:, None]
        parts.append(grouped(bins, 0, regressors=bend))
    joint = joined_groups(parts)
    own = np.arange(3) == joint.record[:, None]
    along = (own[:, :, None] * joint.along[:, None]).reshape(-1, 6)
    among = np.einsum('gr,gs,gab->grasb', own, own, joint.among).reshape(-1, 6, 6)
    columns = replace(joint, along=along, among=among, record=None)
    one, other = (maximise(groups, moving_mean=True, tolerance=1e-12)
                  for groups in (joint, columns))
    np.testing.assert_allclose(one.theta, other.theta, rtol=1e-5, atol=1e-12)
    weight = (joint.dof / (joint.design @ one.theta))[None]
    sizes = [mean(regressors([groups]), groups.records, weight)[1] for groups in (joint, columns)]
    np.testing.assert_allclose(sizes[0].ravel(), sizes[1].ravel(), rtol=1e-4)


def test_small_non_negative_least_squares_agrees_with_scipy():
    from imu_allan.noise.posterior.non_negative import non_negative
    rng = np.random.default_rng(1)
    for _ in range(200):
        a = rng.standard_normal((12, 4)) * 10.0 ** rng.integers(-6, 7, 4)
        b = rng.standard_normal(12)
        np.testing.assert_allclose(a @ non_negative(a.T @ a, a.T @ b), a @ nnls(a, b)[0],
                                   atol=1e-6)


def test_white_noise_of_interpolated_samples_is_given_back():
    # One sample in twenty replaced by the mean of its neighbours lowers the power by a twentieth.
    rng = np.random.default_rng(3)
    samples = rng.standard_normal(400_000)
    missing = rng.choice(np.arange(8, len(samples) - 8), 20_000, replace=False)
    around = sum(samples[missing + k] for k in range(-8, 9) if k) / 16
    samples[missing] = around
    estimator = Estimator()
    estimator.update(samples, np.sort(missing))
    finished = estimator.finished()
    sections = finished.periodogram.sections()
    plain, mended = (maximise(grouped(bins, 0), fixed={QUANTIZATION: 0.0}) for bins in (
        bins_of(sections, 1.0), bins_of(sections, 1.0, finished.interpolation)))
    assert abs(np.sqrt(mended.theta[WHITE]) - 1) < abs(np.sqrt(plain.theta[WHITE]) - 1)
    assert np.sqrt(mended.theta[WHITE]) == pytest.approx(1, abs=0.005)


def test_columns_that_cannot_be_distinguished_share_what_they_explain():
    from imu_allan.noise.posterior.non_negative import non_negative

    column = np.array([1.0, 2.0, 3.0])
    a = np.column_stack((column, column, [0.0, 0.0, 1.0]))
    for b in ([1.0, 2.0, 3.0], [1.0, 2.0, 9.0], [-1.0, -2.0, -3.0], [1.0, 2.0, -9.0]):
        part = non_negative(a.T @ a, a.T @ np.array(b))
        assert (part >= 0).all()
        np.testing.assert_allclose(a @ part, a @ nnls(a, np.array(b))[0], atol=1e-6)


@pytest.mark.parametrize('beside', [2.0, -5.0])
@pytest.mark.parametrize('target', [(1.0, 3.0), (3.0, 1.0), (1.0, 1.0), (-3.0, 3.0)])
@pytest.mark.parametrize('start', [(), (0,), (1,)])
def test_columns_that_rounding_makes_indefinite_still_give_an_answer(beside, target, start):
    from imu_allan.noise.posterior.non_negative import non_negative

    part = non_negative(np.array([[1.0, beside], [beside, 1.0]]), np.array(target), start)
    assert (part >= 0).all()
    assert np.isfinite(part).all()
