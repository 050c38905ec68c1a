# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A random walk goes on all the time; what a mean does once is none, whatever its shape."""

from characterized import characterized, holds
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from repeated import slow

RATE = 10.0
TWO_HOURS = 72_000
TIME = np.arange(TWO_HOURS) / RATE
STILL = {'noise_density': 7.9e-5, 'bias_instability': 2.4e-5}
WALKING = {**STILL, 'rate_random_walk': 4.4e-6}
B = STILL['bias_instability']

TRENDS = {
    'warms up evenly': lambda size: size * B * np.maximum(1 - TIME / 1000, 0),
    'is switched on in two stages': lambda size: size * B * (
        np.exp(-TIME / 700) + 0.5 * np.expm1(-np.maximum(TIME - 2800, 0) / 700)),
    'goes over from one level to another': lambda size: size * B / (
        1 + np.exp((TIME - 2600) / 400)),
    'turns round': lambda size: size * B * np.abs(TIME - 3600) / 7200}


def coefficients(terms, seed, trend=0.0):
    return characterized(simulate(terms, TWO_HOURS, RATE, seed) + trend, RATE)[0].coefficients


@pytest.mark.parametrize(('trend', 'size'), [
    ('warms up evenly', 30), ('goes over from one level to another', 300),
    slow('turns round', 30)])
def test_a_mean_that_moves_once_is_seldom_a_random_walk(trend, size):
    found = [coefficients(STILL, seed, TRENDS[trend](size)) for seed in range(3, 9)]
    assert sum(one['rate_random_walk'].observable for one in found) <= 1
    assert sum(not holds(one['bias_instability'], B) for one in found) <= 2


@pytest.mark.parametrize('size', [slow(30), 300])
@pytest.mark.parametrize('trend', TRENDS)
def test_a_mean_that_moves_in_any_way_leaves_the_noise_density(trend, size):
    density = coefficients(STILL, 3, TRENDS[trend](size))['noise_density']
    assert density.value == pytest.approx(7.9e-5, rel=0.02)


@pytest.mark.parametrize('trend', [None, 'turns round'])
def test_a_random_walk_is_found_beside_a_mean_that_moves(trend):
    found = coefficients(WALKING, 3, TRENDS[trend](3) if trend else 0.0)
    walk = found['rate_random_walk']
    assert walk.observable
    assert holds(walk, WALKING['rate_random_walk'])


@pytest.mark.slow
def test_means_that_move_make_few_random_walks_and_cover_the_flicker():
    """Forty records of each trend and size: binomial bounds of 99.9 % on 3 % and 95 %."""
    records = [coefficients(STILL, seed, trend(size)) for trend in TRENDS.values()
               for size in (30, 300) for seed in range(40)]
    walks = sum(one['rate_random_walk'].observable for one in records)
    assert walks <= 22
    held = sum(holds(one['bias_instability'], B) for one in records)
    assert held >= 288


def test_a_random_walk_that_an_hour_just_shows_is_reported():
    found = [characterized(simulate(WALKING, 36_000, RATE, seed), RATE)[0]
             .coefficients['rate_random_walk'] for seed in range(40, 50)]
    assert sum(one.observable for one in found) >= 8
    assert sum(holds(one, WALKING['rate_random_walk']) for one in found) >= 9
