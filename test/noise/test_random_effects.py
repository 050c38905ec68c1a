# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.random_effects import outliers, random_effects
import numpy as np
import pytest
from repeated import slow


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


@pytest.mark.parametrize('shift', [6.0, -6.0])
def test_two_bad_units_do_not_hide_each_other(shift):
    rng = np.random.default_rng(4)
    values = rng.normal(size=20)
    values[[3, 11]] += 2 * shift
    assert np.flatnonzero(outliers(values, np.full(20, 0.1))).tolist() == [3, 11]


def population(rng, units, ratio):
    errors = ratio * np.exp(rng.normal(0, 0.2, units))
    return rng.normal(size=units) + errors * rng.normal(size=units), errors


@pytest.mark.parametrize(('units', 'ratio', 'populations', 'off', 'limits'), [
    *((20, ratio, 150, 0.1, 0.9) for ratio in (0.0, 0.5, 1.0)),
    *(slow(units, ratio, 2000, 0.08, 0.935) for units, ratio in (
        (20, 0.0), (20, 0.5), (20, 1.0), (40, 1.0)))])
def test_spread_interval_limit_and_false_outliers_over_many_populations(
        units, ratio, populations, off, limits):
    rng = np.random.default_rng(7)
    samples = [population(rng, units, ratio) for _ in range(populations)]
    found = [random_effects(*sample) for sample in samples]
    assert np.mean([effects.between for effects in found]) == pytest.approx(1.0, abs=off)
    covered = np.mean([e.between_ci95[0] <= 1 <= e.between_ci95[1] for e in found])
    assert covered > 0.9
    # 95 % of a standard normal population lie below 1.645.
    assert np.mean([effects.tolerance() > 1.645 for effects in found]) > limits
    if populations == 2000:
        assert 0.92 < covered < 0.98
        assert np.mean([outliers(*sample).any() for sample in samples]) < 0.03
