# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A random walk goes on all the time; what a mean does once is none, whatever its shape."""

from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.intervals import Estimate
from imu_allan.noise.simulate import simulate
from imu_allan.noise.walk_in_parts import either
import numpy as np
import pytest

RATE = 10.0
TWO_HOURS = 72_000
TIME = np.arange(TWO_HOURS) / RATE
STILL = {'noise_density': 7.9e-5, 'bias_instability': 2.4e-5}
WALKING = {**STILL, 'rate_random_walk': 4.4e-6}
B = STILL['bias_instability']

COURSES = {
    'warms up evenly': lambda size: size * B * np.maximum(1 - TIME / 1000, 0),
    'is switched on in two stages': lambda size: size * B * (
        np.exp(-TIME / 700) + 0.5 * np.expm1(-np.maximum(TIME - 2800, 0) / 700)),
    'goes over from one level to another': lambda size: size * B / (
        1 + np.exp((TIME - 2600) / 400)),
    'turns round': lambda size: size * B * np.abs(TIME - 3600) / 7200}


def fitted(terms, seed, course=0.0):
    estimator = Estimator()
    estimator.update(simulate(terms, TWO_HOURS, RATE, seed) + course)
    [found] = fit_axes(estimator.finished(), 1 / RATE)
    return found.fit


@pytest.mark.parametrize('size', [30, 300])
@pytest.mark.parametrize('course', COURSES)
def test_a_mean_that_moves_once_is_no_random_walk(course, size):
    found = fitted(STILL, 3, COURSES[course](size))
    assert not found.estimates['rate_random_walk'].observable
    flicker = found.estimates['bias_instability']
    assert (flicker.low if flicker.observable else 0) <= B <= flicker.upper


@pytest.mark.parametrize('course', [None, 'turns round'])
def test_a_random_walk_is_found_beside_a_mean_that_moves(course):
    found = fitted(WALKING, 3, COURSES[course](3) if course else 0.0)
    walk = found.estimates['rate_random_walk']
    assert walk.observable
    assert walk.low < WALKING['rate_random_walk'] < walk.high


def test_what_holds_either_way_reaches_over_both_and_is_observable_in_both():
    one, other = Estimate(True, 2.0, 1.5, 3.0, 3.0), Estimate(True, 4.0, 2.0, 5.0, 5.0)
    assert either(one, other) == Estimate(True, 2.0, 1.5, 5.0, 5.0)
    hidden = Estimate(False, 0.0, 0.0, 0.0, 4.0)
    assert either(one, hidden) == Estimate(False, 2.0, 1.5, 3.0, 4.0)


@pytest.mark.slow
def test_means_that_move_make_few_walks_and_cover_the_flicker():
    """Forty records of each course and size: binomial bounds of 99.9 % on 3 % and 95 %."""
    records = [fitted(STILL, seed, course(size)) for course in COURSES.values()
               for size in (30, 300) for seed in range(40)]
    walks = sum(one.estimates['rate_random_walk'].observable for one in records)
    assert walks <= 22
    flicker = [one.estimates['bias_instability'] for one in records]
    held = sum((one.low if one.observable else 0) <= B <= one.upper for one in flicker)
    assert held >= 288
