# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A single step of the mean: found where it stands out, never in noise of any colour."""

from characterized import characterized, taken_in
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

RATE = 10.0
N, B, K = 1.4e-4, 4.8e-5, 4.8e-6
"""Those of a consumer gyroscope."""
KINDS = {
    'white': {'noise_density': N},
    'flicker': {'noise_density': N, 'bias_instability': B},
    'weak walk': {'noise_density': N, 'rate_random_walk': K},
    'strong walk': {'noise_density': N, 'rate_random_walk': 20 * K},
    'all': {'noise_density': N, 'bias_instability': B, 'rate_random_walk': K},
    'process': {'noise_density': N,
                'gauss_markov': {'sigma': 5 * B, 'correlation_time_s': 300.0}},
    'ramp': {'noise_density': N, 'bias_instability': B, 'rate_ramp': 5 * B / 3600}}


def step_of(rows):
    """Return the step that the characterization of a record tells, or None."""
    [fit] = fit_axes(taken_in(rows).finished(), 1 / RATE)
    return fit and fit.fit.bias_step


def stepped(size, at, seed=1, terms=KINDS['flicker'], samples=36_000):
    rows = simulate(terms, samples, RATE, seed)
    rows[at:] += size
    return step_of(rows)


@pytest.mark.parametrize('at', [3_000, 18_000, 33_000])
@pytest.mark.parametrize('size', [20 * B, -100 * B])
def test_a_step_is_found_with_its_place_and_size(at, size):
    found = stepped(size, at)
    assert abs(found.at_s * RATE - at) < 600
    assert found.size == pytest.approx(size, abs=5 * B)


def test_noise_of_any_colour_has_no_step():
    rows = np.transpose([simulate(terms, 36_000, RATE, seed)
                         for terms in KINDS.values() for seed in range(3)])
    fits = fit_axes(taken_in(rows).finished(), 1 / RATE)
    assert [fit.fit.bias_step for fit in fits] == [None] * (3 * len(KINDS))


def test_a_step_too_small_to_be_certain_is_seldom_a_random_walk():
    found = [characterized(simulate({'noise_density': 7.9e-5, 'bias_instability': 2.4e-5}, 144_000,
                                    20.0, seed) + 5 * 2.4e-5 * (np.arange(144_000) > 43_200), 20.0)
             for seed in range(8)]
    # One in ten; more than three of eight come once in 200 times.
    assert sum(axis.coefficients['rate_random_walk'].observable for axis, _ in found) <= 3
    assert any('bias_step' in remarks for _, remarks in found)


def test_two_steps_too_small_to_be_certain_are_seldom_one_or_a_random_walk():
    at = np.arange(36_000)
    rows = np.transpose([simulate(KINDS['flicker'], 36_000, RATE, seed)
                         + 5 * B * (at > 13_000) - 7.5 * B * (at > 25_000) for seed in range(16)])
    found = [fit.fit for fit in fit_axes(taken_in(rows).finished(), 1 / RATE)]
    # 3 and 5 of 16; with one step in a model at most they were 11 and 13.
    assert sum(fit.estimates['rate_random_walk'].observable for fit in found) <= 5
    assert sum(fit.bias_step is not None for fit in found) <= 7
    assert any(fit.random_walk_unclear for fit in found)


@pytest.mark.slow
def test_shares_of_steps_that_are_found_and_of_false_ones():
    false = sum(stepped(0.0, 0, seed, terms, 72_000) is not None
                for terms in KINDS.values() for seed in range(200))
    rng = np.random.default_rng(1)
    found = [np.mean([stepped(size * B, int(rng.uniform(0.03, 0.97) * 72_000), 1000 + seed,
                              samples=72_000) is not None for seed in range(40)])
             for size in (3, 10, 30)]
    print(f'false: {false} of {200 * len(KINDS)}; found of 3, 10, 30 B: {found}')
    assert false <= 3
    assert found[1] > 0.9
    assert found[2] > 0.95
