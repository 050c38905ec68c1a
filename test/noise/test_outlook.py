# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import several
from imu_allan.noise import spectrum
from imu_allan.noise.outlook import outlook
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from repeated import slow
from scipy.optimize import brentq

KEYS = ('noise_density', 'bias_instability', 'rate_random_walk')
SHAPES = (spectrum.white, spectrum.flicker, spectrum.random_walk)
DT = 0.5
LENGTH = 1000.0
SENSOR = {'noise_density': 1.0, 'bias_instability': 0.05, 'rate_random_walk': 0.002}


def standard_errors(coefficients, duration):
    """Cramer-Rao bound of the squared coefficients, summed over every mode."""
    n = int(duration / DT)
    nu = np.arange(1, n) / (2 * n)
    columns = np.array([shape(nu, DT) for shape in SHAPES])
    relative = columns / sum(coefficients.get(key, 0.0) ** 2 * column
                             for key, column in zip(KEYS, columns, strict=True))
    scale = np.sqrt(np.diag(relative @ relative.T / 2))
    inverse = np.linalg.inv(relative @ relative.T / 2 / np.outer(scale, scale))
    return dict(zip(KEYS, np.sqrt(np.diag(inverse)) / scale, strict=True))


def whole_time(coefficients, key, wanted):
    """Solve for the length of record at which the standard error is as wanted."""
    def excess(log_duration):
        return np.log(standard_errors(coefficients, np.exp(log_duration))[key] / wanted)
    return np.exp(brentq(excess, np.log(LENGTH), np.log(LENGTH * 128), xtol=1e-3))


@pytest.mark.parametrize('key', KEYS)
@pytest.mark.parametrize('coefficients', [
    SENSOR, {**SENSOR, 'bias_instability': 0.0}, {**SENSOR, 'rate_random_walk': 0.0}])
def test_halving_takes_as_long_as_the_fisher_information_says(coefficients, key):
    found = outlook(coefficients, dict.fromkeys(KEYS, True), DT, LENGTH)
    if not coefficients[key]:
        assert found[key] == (None, None)
        return
    expected = whole_time(coefficients, key, standard_errors(coefficients, LENGTH)[key] / 2)
    assert found[key][0] is None
    # Between octaves of the length it is interpolated.
    assert LENGTH + found[key][1] == pytest.approx(expected, rel=.04)


@pytest.mark.parametrize(('key', 'value'), [
    ('bias_instability', 0.05), ('rate_random_walk', 0.002)])
def test_a_term_is_expected_once_it_is_as_many_standard_errors_as_make_it_observable(key, value):
    coefficients = {'noise_density': 1.0, key: value}
    found = outlook(coefficients, {'noise_density': True}, DT, LENGTH)
    # Of a square that is zero 2 standard errors come once in 40 records, 3.5 once in 4000.
    first, last = (whole_time(coefficients, key, value**2 / errors) for errors in (2.0, 3.5))
    assert first > LENGTH
    assert first < LENGTH + found[key][0] < last
    assert found[key][1] is None


@pytest.mark.thorough
@pytest.mark.parametrize(('key', 'value'), [
    ('bias_instability', 3e-4), slow('rate_random_walk', 1e-4)])
def test_a_term_shows_by_then_in_most_records(key, value):
    coefficients = {'noise_density': 1e-3, key: value}
    wait = outlook(coefficients, {'noise_density': True}, 0.05, 60.0)[key][0]
    samples = round((60 + wait) * 20)
    # Nor does it show in most records a sixth of that length.
    for count, lowest, highest in ((samples, 0.25, 1.01), (samples // 6, -0.01, 0.5)):
        seen = [axis.coefficients[key].observable for axis in several(
            [simulate(coefficients, count, 20.0, seed) for seed in range(10)], 20.0)]
        assert lowest < np.mean(seen) < highest
