# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan import characterize, simulate
from imu_allan.characterization.joint import remark_on_exponents
from imu_allan.finding import finding
from imu_allan.noise.uncertainty import exponents_differ, with_own_exponents
from imu_allan.result import PowerLaw
import pytest


@pytest.fixture(scope='module')
def plain():
    axis = characterize(simulate({'noise_density': 1e-3}, 10_000, 50.0), 50.0)
    assert not axis.coefficients['bias_instability'].observable
    return axis


def law(axis, exponent, error=0.02):
    return replace(axis, power_law=PowerLaw(
        exponent, (exponent - 1.96 * error, exponent + 1.96 * error), 1e-9))


def shown(axis, key, value, ends):
    found = replace(axis.coefficients[key], observable=True, value=value, ci95=ends, upper95=None)
    return replace(axis, coefficients={**axis.coefficients, key: found})


def bounded(axis, key, upper):
    found = replace(axis.coefficients[key], observable=False, value=None, ci95=None,
                    upper95=upper)
    return replace(axis, coefficients={**axis.coefficients, key: found})


def density_of(axis, *singles):
    return with_own_exponents(axis, singles).coefficients['noise_density']


def test_which_exponents_of_recordings_are_not_one(plain):
    flicker = shown(plain, 'bias_instability', 2e-4, (1.8e-4, 2.2e-4))
    one = law(plain, 0.7)
    assert not exponents_differ(law(plain, 0.71), [one, *[plain] * 5])
    assert not exponents_differ(law(plain, 0.71), [plain, flicker])
    assert exponents_differ(law(plain, 0.71), [one, flicker])
    # The joint fit tells none, or one that is not that of the recordings.
    assert exponents_differ(plain, [one, plain])
    for exponents in ((0.6, 0.8), (0.7,)):
        singles = [law(plain, exponent) for exponent in exponents]
        assert exponents_differ(law(plain, 0.8), [*singles, plain])


def test_a_recording_that_knows_next_to_nothing_leaves_the_interval_of_another_as_it_is(plain):
    known = shown(plain, 'noise_density', 1.05e-3, (1.0177e-3, 1.0614e-3))
    own = density_of(plain, known)
    assert own.value == pytest.approx(1.05e-3)
    assert own.ci95 == pytest.approx((1.0177e-3, 1.0614e-3))
    beside = density_of(plain, known, shown(plain, 'noise_density', 1.2e-3, (0.6e-3, 2.4e-3)))
    assert beside.ci95 == pytest.approx((1.0177e-3, 1.0614e-3), rel=2e-3)


def test_error_averages_out_and_uncertainty_on_one_side_does_not(plain):
    same = [shown(plain, 'noise_density', 1.0e-3, (0.94e-3, 1.01e-3))] * 4
    low, high = density_of(plain, *same).ci95
    assert high == pytest.approx(1.005e-3, rel=1e-3)
    assert 0.94e-3 < low < 0.95e-3


def test_where_no_recording_shows_the_lower_end_of_the_density_it_is_a_bound(plain):
    one, other = (law(bounded(plain, 'noise_density', upper), exponent)
                  for upper, exponent in ((1.2e-3, 0.7), (1.5e-3, 1.3)))
    own = density_of(plain, one, other)
    assert (own.observable, own.value, own.ci95, own.upper95) == (False, None, None, 1.5e-3)
    assert remark_on_exponents({'a': one, 'b': other}) == finding(
        'power_law', recordings=['a', 'b'], exponents=[0.7, 1.3], density_is_mean=False)
    own = density_of(plain, shown(plain, 'noise_density', 1e-3, (0.0, 1.3e-3)))
    assert (own.value, own.upper95) == (None, 1.3e-3)
