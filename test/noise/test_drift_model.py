# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The drift model: what it finds and must not invent; the spread of means and of units."""

from dataclasses import replace

from characterized import shown
from imu_allan import characterize
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.drift_model import drift_avar, fit_drift_model
from imu_allan.noise.random_effects import outliers, random_effects
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import allan_variance, gauss_markov_avar, line_avar
from imu_allan.noise.uncertainty import error_of_mean
from imu_allan.result import DriftModel, GaussMarkov, Tone
import numpy as np
import pytest
from repeated import slow

RATE = 50.0
HOUR = round(3600 * RATE)
N, B = 1e-3, 3e-4


def groups_of(samples):
    return fit_axes(shown(samples), 1 / RATE)[0].groups


def model_of(samples):
    return fit_drift_model(groups_of(samples), 1 / RATE)


@pytest.mark.parametrize(('terms', 'hours', 'seed', 'tolerance'), [
    ({'rate_random_walk': 5e-5}, 3, 0, 0.15), ({'bias_instability': B}, 6, 4, 0.12),
    ({'gauss_markov': {'sigma': B, 'correlation_time_s': 100.0}}, 6, 1, 0.15)])
def test_slow_noise_comes_back_as_processes_of_its_allan_variance(terms, hours, seed, tolerance):
    model = model_of(simulate({'noise_density': N, **terms}, hours * HOUR, RATE, seed))
    assert model.noise_density == pytest.approx(N, rel=0.01)
    assert len(model.processes) >= 2 or 'bias_instability' not in terms
    tau = np.array([1.0, 10.0, 30.0, 100.0, 190.0, 600.0])
    known = {key: size for key, size in terms.items() if key != 'gauss_markov'}
    truth = allan_variance({'noise_density': N, **known}, tau)
    if not known:
        truth += gauss_markov_avar(B, 100.0, tau)
    np.testing.assert_allclose(np.sqrt(drift_avar(model, (), tau) / truth), 1, atol=tolerance)


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e6])
def test_the_model_scales_with_the_signal(scale):
    samples = simulate({'noise_density': N, 'bias_instability': B}, HOUR // 4, RATE)
    plain, scaled = model_of(samples), model_of(samples * scale)
    tau = np.array([0.2, 1.0, 10.0, 100.0])
    np.testing.assert_allclose(drift_avar(scaled, (), tau), scale**2 * drift_avar(plain, (), tau),
                               rtol=1e-3)


def test_a_short_record_says_nothing_wild():
    """Sixteen seconds of white noise must not turn into a drift of many times the noise."""
    groups = groups_of(simulate({'noise_density': N}, 64, RATE))
    assert fit_drift_model(groups.below(float(groups.frequency[6])), 1 / RATE) is None
    # Milliseconds have no frequency below any edge.
    fast = replace(groups, frequency=1e4 * groups.frequency)
    assert fit_drift_model(fast, 1e-4 / RATE) is not None
    for seed in range(10):
        model = model_of(simulate({'noise_density': N}, 800, RATE, seed))
        assert model.to_s < 6
        assert drift_avar(model, (), [5.0])[0] < 4 * N**2 / 5


def test_the_allan_variance_adds_noise_random_walk_processes_and_lines():
    model = DriftModel(2.0, 3.0, (GaussMarkov(0.5, 7.0),), 0.1, 100.0)
    tau = np.array([0.3, 5.0])
    np.testing.assert_allclose(
        drift_avar(model, (Tone(0.4, 0.2),), tau),
        4 / tau + 3 * tau + gauss_markov_avar(0.5, 7.0, tau) + line_avar(0.4, 0.2, tau))


@pytest.mark.parametrize('seconds', [60, 600])
@pytest.mark.parametrize('drift', [{'bias_instability': B}, {'rate_random_walk': 1e-5}])
def test_the_error_of_a_mean_counts_the_drift_that_a_short_record_does_not_show(drift, seconds):
    # The next mean differs by the square root of two errors.
    missed = []
    for seed in range(24):
        both = simulate({'noise_density': N, **drift}, 2 * seconds * 20, 20.0, seed)
        first, second = both.reshape(2, -1)
        error = error_of_mean(characterize(first, 20.0), seconds)
        missed.append((second.mean() - first.mean()) / (np.sqrt(2) * error))
    assert np.mean(np.abs(missed) < 1.96) > 0.8
    assert 0.3 < np.sqrt(np.mean(np.square(missed))) < 1.5


def test_where_measuring_is_exact_the_spread_is_that_of_the_sample():
    values = np.random.default_rng(9).normal(size=5)
    effects = random_effects(values, np.zeros(5))
    assert effects.mean == pytest.approx(values.mean())
    assert effects.between == pytest.approx(values.std(ddof=1), rel=1e-3)
    # Quantiles of chi-square with four degrees of freedom.
    assert effects.between_ci95 == pytest.approx(
        values.std(ddof=1) * (4 / np.array([11.143, 0.48442]))**0.5, rel=1e-3)
    values = np.arange(20.0)
    # One-sided tolerance factor of 20 values for 95 % with 95 % confidence, Owen's.
    assert random_effects(values, np.zeros(20)).tolerance() == pytest.approx(
        values.mean() + 2.396 * values.std(ddof=1), rel=1e-3)


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e6])
def test_scatter_that_measuring_explains_is_no_spread_but_leaves_one_possible(scale):
    wide = random_effects(np.array([-1.0, 1.0, -1.0, 1.0, 0.0]) * scale, np.full(5, 2.0 * scale))
    assert wide.between == wide.between_ci95[0] == 0.0
    # So close together that the likelihood of all small spreads is the same but for rounding.
    for values in ([1.0, 1.001, 1.002], [1.0, 1.0004, 1.0005]):
        close = random_effects(scale * np.array(values), scale * np.array([0.1, 0.11, 0.1]))
        assert close.between == 0.0
    effects = random_effects(scale * np.array([1.0, 1.01, 0.99, 1.0, 1.005]),
                             np.full(5, 0.1 * scale))
    assert effects.between == 0.0
    low, high = effects.between_ci95
    assert low == 0.0
    # Five equal values of an error of 0.1: by Q alone there would be no room for any spread.
    assert 0.05 * scale < high < 0.3 * scale
    assert effects.tolerance() > effects.percentile(0.95)


def test_scaling_and_shifting_the_units_scales_and_shifts_the_population():
    values, errors = np.random.default_rng(2).normal(size=12), np.full(12, 0.5)
    one, other = random_effects(values, errors), random_effects(7 * values + 3, 7 * errors)
    assert other.mean == pytest.approx(7 * one.mean + 3, rel=1e-6)
    assert other.between == pytest.approx(7 * one.between, rel=1e-3)
    assert other.tolerance() == pytest.approx(7 * one.tolerance() + 3, rel=1e-3)


@pytest.mark.parametrize('bounds', [0, 2])
def test_the_interval_of_a_spread_contains_it_however_unequal_the_errors_are(bounds):
    rng = np.random.default_rng(2)
    for _ in range(100):
        errors = np.exp(rng.normal(0, 2, 8))
        effects = random_effects(rng.normal(size=8) * np.hypot(1, errors), errors,
                                 rng.normal(-3, 1, bounds))
        low, high = effects.between_ci95
        assert low <= effects.between <= high


@pytest.mark.parametrize('shift', [6.0, -6.0])
def test_two_bad_units_do_not_hide_each_other(shift):
    rng = np.random.default_rng(4)
    values = rng.normal(size=20)
    values[[3, 11]] += 2 * shift
    assert np.flatnonzero(outliers(values, np.full(20, 0.1))).tolist() == [3, 11]


@pytest.mark.parametrize(('units', 'ratio', 'populations', 'off', 'limits'), [
    *((20, ratio, 150, 0.1, 0.9) for ratio in (0.0, 0.5, 1.0)),
    *(slow(units, ratio, 2000, 0.08, 0.935) for units, ratio in (
        (20, 0.0), (20, 0.5), (20, 1.0), (40, 1.0)))])
def test_spread_limit_and_outliers_over_many_populations(units, ratio, populations, off, limits):
    rng, samples = np.random.default_rng(7), []
    for _ in range(populations):
        errors = ratio * np.exp(rng.normal(0, 0.2, units))
        samples.append((rng.normal(size=units) + errors * rng.normal(size=units), errors))
    found = [random_effects(*sample) for sample in samples]
    assert np.mean([effects.between for effects in found]) == pytest.approx(1.0, abs=off)
    covered = np.mean([e.between_ci95[0] <= 1 <= e.between_ci95[1] for e in found])
    assert covered > 0.9
    # 95 % of a standard normal population lie below 1.645.
    assert np.mean([effects.tolerance() > 1.645 for effects in found]) > limits
    if populations == 2000:
        assert 0.92 < covered < 0.98
        assert np.mean([outliers(*sample).any() for sample in samples]) < 0.03
