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
    return characterize(simulate({'noise_density': 1e-3}, 10_000, 50.0), 50.0)


def law(axis, exponent, error=0.02):
    return replace(axis, power_law=PowerLaw(
        exponent, (exponent - 1.96 * error, exponent + 1.96 * error), 1e-9))


def shown(axis, key, value, ends, upper95=None):
    found = replace(axis.coefficients[key], observable=value is not None, value=value, ci95=ends,
                    upper95=upper95)
    return replace(axis, coefficients={**axis.coefficients, key: found})


def density_of(axis, *singles):
    return with_own_exponents(axis, singles).coefficients['noise_density']


def test_recordings_of_other_exponents_have_the_mean_of_their_densities(plain):
    known = shown(plain, 'noise_density', 1.05e-3, (1.0177e-3, 1.0614e-3))
    own = density_of(plain, known)
    assert own.value == pytest.approx(1.05e-3)
    assert own.ci95 == pytest.approx((1.0177e-3, 1.0614e-3))
    # One that knows next to nothing leaves the interval of another as it is.
    beside = density_of(plain, known, shown(plain, 'noise_density', 1.2e-3, (0.6e-3, 2.4e-3)))
    assert beside.ci95 == pytest.approx((1.0177e-3, 1.0614e-3), rel=2e-3)
    # Error averages out, and uncertainty on one side does not.
    same = [shown(plain, 'noise_density', 1.0e-3, (0.94e-3, 1.01e-3))] * 4
    low, high = density_of(plain, *same).ci95
    assert high == pytest.approx(1.005e-3, rel=1e-3)
    assert 0.94e-3 < low < 0.95e-3


def test_where_no_recording_shows_the_lower_end_of_the_density_it_is_a_bound(plain):
    one, other = (law(shown(plain, 'noise_density', None, None, upper), exponent)
                  for upper, exponent in ((1.2e-3, 0.7), (1.5e-3, 1.3)))
    own = density_of(plain, one, other)
    assert (own.observable, own.value, own.ci95, own.upper95) == (False, None, None, 1.5e-3)
    assert remark_on_exponents({'a': one, 'b': other}) == finding(
        'power_law', recordings=['a', 'b'], exponents=[0.7, 1.3], density_is_mean=False)
    own = density_of(plain, shown(plain, 'noise_density', 1e-3, (0.0, 1.3e-3)))
    assert (own.value, own.upper95) == (None, 1.3e-3)


def test_which_exponents_of_recordings_are_not_one(plain):
    flicker = shown(plain, 'bias_instability', 2e-4, (1.8e-4, 2.2e-4))
    joint, one = law(plain, 0.71), law(plain, 0.7)
    assert not exponents_differ(joint, [one, *[plain] * 5])
    assert not exponents_differ(joint, [plain, flicker])
    # The joint fit may tell none, or one that is not that of the recordings.
    for whole, singles in ((joint, [one, flicker]), (plain, [one, plain]),
                           (law(plain, 0.8), [law(plain, 0.6), law(plain, 0.8), plain]),
                           (law(plain, 0.8), [one, plain])):
        assert exponents_differ(whole, singles)
