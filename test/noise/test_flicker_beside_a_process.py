# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A Gauss-Markov process that is not reported makes no bias instability that is too large."""

from imu_allan.characterization.axis import characterize
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.signal import lfilter

RATE = 10.0
FLICKER = 3e-5
SENSOR = {'noise_density': 1e-4, 'bias_instability': FLICKER}


def bias_instability(hours, sigma, time_s, seed):
    """Return B of a record with a process of so many B."""
    samples = round(hours * 3600 * RATE)
    record = simulate(SENSOR, samples, RATE, seed)
    if sigma:
        kept = np.exp(-1 / (time_s * RATE))
        white = np.random.default_rng([seed, 1]).normal(
            0, sigma * FLICKER * np.sqrt(1 - kept**2), 2 * samples)
        record += lfilter([1.0], [1.0, -kept], white)[samples:]
    return characterize(record, RATE).coefficients['bias_instability']


def test_a_process_too_weak_to_be_reported_is_no_flicker():
    above = [found.ci95[0] > FLICKER for seed in range(10)
             if (found := bias_instability(1, 1.5, 20.0, seed)).observable]
    # Without the uncertainty about a process nine are.
    assert sum(above) <= 6


# Of 40 are too large, without it: 36, 10 and 27.
@pytest.mark.slow
@pytest.mark.parametrize(('hours', 'sigma', 'time_s', 'most'), [
    (1, 1.5, 20.0, 22), (1, 2.0, 60.0, 6), (3, 1.0, 60.0, 18)])
def test_flicker_beside_a_process_is_seldom_too_large(hours, sigma, time_s, most):
    found = [bias_instability(hours, sigma, time_s, seed) for seed in range(40)]
    above = sum(one.observable and one.ci95[0] > FLICKER for one in found)
    bounds = sum(not one.observable for one in found)
    print(f'{hours} h, {sigma:g} B, {time_s:g} s: too large in {above} of 40, a bound in {bounds}')
    assert above <= most


@pytest.mark.slow
def test_flicker_alone_keeps_its_value():
    found = [bias_instability(1, 0, 0.0, seed) for seed in range(200)]
    bounds = sum(not one.observable for one in found)
    covered = sum(one.ci95[0] <= FLICKER <= one.ci95[1] for one in found if one.observable)
    print(f'flicker alone, 1 h: a bound in {bounds} of 200, {covered} of the others hold')
    assert bounds <= 8
