# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A random walk and the flicker beside it hold where it may be a process that levels off."""

from battery.bounds import reference_widths
from battery.sensors import Sensor
from characterized import characterized, ends, holds
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

RATE = 10.0
NOISE = {'noise_density': 1e-3, 'bias_instability': 3e-4}
RANDOM_WALK, FLICKER = 'rate_random_walk', 'bias_instability'
SIGMA, TIME_S = 1e-3, 60.0


@pytest.fixture(scope='module')
def beside_a_process():
    """Twenty records of a process of a minute, each too short to show it well."""
    terms = {**NOISE, 'gauss_markov': {'sigma': SIGMA, 'correlation_time_s': TIME_S}}
    return [characterized(simulate(terms, round(2500 * RATE), RATE, seed), RATE)
            for seed in range(20)]


def test_a_process_is_seldom_reported_as_a_random_walk(beside_a_process):
    # Of .39 +- .04 of such records more than 13 in 20 come once in 200.
    walks = [axis.coefficients[RANDOM_WALK].observable for axis, _ in beside_a_process]
    assert sum(walks) <= 13


def test_flicker_beside_such_a_process_is_seldom_too_large(beside_a_process):
    flicker = [axis.coefficients[FLICKER] for axis, _ in beside_a_process
               if axis.gauss_markov is None]
    assert sum(one.observable and one.ci95[0] > NOISE[FLICKER] for one in flicker) <= 1


def test_a_random_walk_that_goes_on_is_known_nearly_as_well_as_by_the_bound():
    terms = {**NOISE, RANDOM_WALK: 1e-4}
    walks = [characterized(simulate(terms, 72_000, RATE, seed), RATE)[0].coefficients[RANDOM_WALK]
             for seed in range(20, 30)]
    assert all(walk.observable for walk in walks)
    # Two of ten outside come once in 12 such tests, three once in 90; these are fixed.
    assert sum(holds(walk, terms[RANDOM_WALK]) for walk in walks) >= 8
    bound = reference_widths(Sensor(RATE, 7200, terms))[RANDOM_WALK]
    assert 0.8 < np.median([high - low for low, high in map(ends, walks)]) / bound < 1.5
