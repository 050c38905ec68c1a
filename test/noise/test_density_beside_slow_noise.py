# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The interval of the noise density holds beside slow noise that only passes for flicker."""

from battery.bounds import reference_widths
from battery.sensors import Sensor
from characterized import characterized, ends, holds
from imu_allan.noise.simulate import flicker, simulate
import numpy as np
import pytest
from repeated import slow

RATE = 50.0
DENSITY = 1e-3


def passing_for_flicker(samples, exponent, crossing_hz, seed):
    """White noise and a power law that is as strong at a frequency."""
    size = DENSITY * (2 * np.pi * crossing_hz / RATE) ** (exponent / 2) * np.sqrt(RATE)
    return simulate({'noise_density': DENSITY}, samples, RATE, seed) + size * flicker(
        samples, np.random.default_rng([seed, 77]), exponent)


@pytest.mark.thorough
@pytest.mark.parametrize(('minutes', 'exponent', 'crossing_hz'), [
    (5, 0.7, 1.0), slow(20, 0.7, 0.1)])
def test_the_density_holds_in_records_too_short_to_know_the_exponent(minutes, exponent,
                                                                     crossing_hz):
    held = 0
    for seed in range(20):
        axis, _ = characterized(passing_for_flicker(round(60 * minutes * RATE), exponent,
                                                    crossing_hz, seed), RATE)
        held += holds(axis.coefficients['noise_density'], DENSITY)
    # Of nine in ten that hold, fewer than 14 of 20 are as rare as 1 in 100.
    assert held >= 14


@pytest.mark.parametrize('terms', [
    {'noise_density': DENSITY, 'bias_instability': 1e-3}, slow({'noise_density': DENSITY}),
    slow({'noise_density': DENSITY, 'rate_random_walk': 1e-3})])
def test_beside_flicker_the_interval_is_at_most_twice_that_of_the_bound(terms):
    samples = 5000 if 'rate_random_walk' in terms else 20_000
    widths = []
    for seed in range(20, 32):
        axis, _ = characterized(simulate(terms, samples, RATE, seed), RATE)
        low, high = ends(axis.coefficients['noise_density'])
        widths.append(high - low)
    bound = reference_widths(Sensor(RATE, samples / RATE, terms))['noise_density']
    assert 0.9 < np.median(widths) / bound < 2.2
    # An exponent that the record hardly knows is no reason for more.
    assert max(widths) / bound < 3
