# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Filters of true models: what they predict is what happens; many run as each does alone."""

from drifting_axes import axis_of
from imu_allan.characterization.axis import characterize
from imu_allan.noise.simulate import simulate
from imu_allan.tuning.kalman import run_filters, steady_covariance, unaided_variance
from imu_allan.tuning.state_space import state_space
from imu_allan.tuning.tune import tune
import numpy as np
import pytest


def innovations(space, means):
    found = run_filters([space], [means])
    return found.innovation[0], found.variance[0]


def test_the_unknown_start_is_forgotten_after_one_mean():
    space = state_space(axis_of(1.0, 0.01, ((0.1, 30.0),)), 1.0)
    first, _ = innovations(space, [1e4, 1e4])
    assert first[0] == 1e4
    assert abs(first[1]) < 0.1


def test_innovations_of_a_true_model_are_white_and_of_the_predicted_size():
    terms = {'noise_density': 1e-3, 'rate_random_walk': 2e-5,
             'gauss_markov': {'sigma': 4e-4, 'correlation_time_s': 20.0}}
    samples = simulate(terms, 200_000, 10.0, seed=5)
    space = state_space(axis_of(1e-3, 2e-5, ((4e-4, 20.0),)), 1.0)
    innovation, variance = innovations(space, samples.reshape(-1, 10).mean(axis=1))
    z = (innovation / np.sqrt(variance))[1:]
    assert np.mean(z**2) == pytest.approx(1, abs=0.03)
    for lag in (1, 2, 5, 20):
        assert abs(np.mean(z[lag:] * z[:-lag])) < 0.03


@pytest.mark.parametrize(('amplitude', 'within'), [(1e-3, 0.07), (3e-3, 0.12)])
def test_innovations_beside_eighty_lines_are_of_the_expected_size(amplitude, within):
    rng = np.random.default_rng(1)
    time = np.arange(360_000) / 100.0
    samples = simulate({'noise_density': 1e-3, 'bias_instability': 1e-5}, len(time), 100.0, seed=1)
    for frequency in rng.uniform(0.6, 45.0, 80):
        samples += amplitude * rng.lognormal(0, 0.4) * np.sin(
            2 * np.pi * frequency * time + rng.uniform(0, 6))
    axis = characterize(samples, 100.0)
    tuning = tune(axis, 0.2, 60.0)
    given = axis_of(tuning.noise_density, tuning.random_walk)
    for space, expected in ((state_space(axis, 0.2), 1.0), (state_space(given, 0.2), tuning.nis)):
        innovation, variance = innovations(space, samples.reshape(-1, 20).mean(axis=1))
        nis = np.mean(innovation[20:]**2 / variance[20:])
        assert nis == pytest.approx(expected, rel=within)


def test_a_missing_mean_leaves_a_gap_and_more_uncertainty():
    space = state_space(axis_of(1e-3, 1e-4), 1.0)
    means = simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-4}, 100, 1.0)
    means[60:80] = np.nan
    innovation, variance = innovations(space, means)
    assert np.isnan(innovation[60:80]).all()
    assert np.isfinite(np.delete(innovation, range(60, 80))).all()
    assert variance[80] > variance[59]


@pytest.mark.parametrize(('noise', 'walk', 'more'), [
    *((noise, walk, ()) for noise in (1e-3, 2e-3) for walk in (0.0, 1e-9, 3e-5)),
    (1e-3, 2e-5, ((1e-4, 1.0),))])
def test_the_steady_covariance_solves_the_riccati_equation_where_the_filter_arrives(
        noise, walk, more):
    axis = axis_of(noise, walk, ((5e-4, 40.0), *more))
    s = state_space(axis, 1.0)
    p = steady_covariance(s)
    predicted = s.observation @ p @ s.observation.T + s.measurement
    gain = (s.transition @ p @ s.observation.T + s.cross) / predicted
    after = s.transition @ p @ s.transition.T + s.process - gain @ predicted @ gain.T
    np.testing.assert_allclose(after, p, rtol=1e-9, atol=1e-12 * np.trace(p))
    if more:
        assert (np.linalg.eigvalsh(p) > 0).all()
        _, variance = innovations(s, np.zeros(3000))
        assert unaided_variance(axis, 1.0, np.array([1.0]))[0] == pytest.approx(
            variance[-1], rel=1e-9)


def test_many_filters_run_as_each_does_alone():
    spaces = [state_space(axis_of(1e-3, 1e-5, ((4e-4, 20.0), (1e-4, 90.0))), 1.0),
              state_space(axis_of(2e-3), 1.0)]
    series = np.stack([simulate({'noise_density': 1e-3}, 50, 1.0, seed) for seed in (1, 2)])
    series[1, 20:24] = np.nan
    both = run_filters(spaces, series)
    for lane, space in enumerate(spaces):
        alone = run_filters([space], series[lane:lane + 1])
        n = len(space.transition)
        np.testing.assert_array_equal(both.innovation[lane], alone.innovation[0])
        np.testing.assert_allclose(both.variance[lane], alone.variance[0], rtol=1e-14)
        np.testing.assert_allclose(both.state[lane, :, :n], alone.state[0], rtol=1e-12)
        assert not both.state[lane, :, n:].any()
