# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The level of the drift within a segment: that its interval holds it."""

from imu_allan.noise.drift_level import drift_levels, drift_of_means
from imu_allan.result import DriftModel, GaussMarkov
import numpy as np
import pytest

PARTS, PART_S = 16, 10.0
RECORDS = 2000
MODELS = {
    'white': DriftModel(1e-3, 0.0, (), 0.1, 1e4),
    'white and random walk': DriftModel(1e-3, 1e-5, (), 0.1, 1e4),
    'walk': DriftModel(1e-6, 1e-4, (), 0.1, 1e4),
    'fast process': DriftModel(1e-4, 0.0, (GaussMarkov(1e-3, 20.0),), 0.1, 1e4),
    'several': DriftModel(5e-4, 2e-6, (GaussMarkov(2e-4, 5.0), GaussMarkov(2e-4, 300.0)),
                          0.1, 1e4)}


def spreads(model, seed):
    """Draw the mean squares of the means of many segments; with what each holds on average."""
    drift = drift_of_means(model, PART_S, PARTS)
    white = model.noise_density**2 / PART_S
    means = np.random.default_rng(seed).multivariate_normal(
        np.zeros(PARTS), drift + white * np.eye(PARTS), RECORDS)
    return np.var(means, axis=1), white, drift, spread_of(drift)


def spread_of(covariance):
    """Return the mean square about the mean of all."""
    return (np.trace(covariance) - covariance.mean() * PARTS) / PARTS


@pytest.mark.parametrize('kind', MODELS)
def test_nineteen_intervals_of_twenty_hold_the_level(kind):
    seen, white, shape, truth = spreads(MODELS[kind], 1)
    levels = drift_levels(seen, white, shape)
    held = np.mean([low <= truth**0.5 <= high for _, (low, high) in levels])
    # No level lies below zero: where there is next to no drift only one side can miss it.
    assert 0.935 < held < 0.985
    assert all(low <= level <= high for level, (low, high) in levels)


def test_the_level_is_that_of_the_drift_alone():
    seen, white, shape, truth = spreads(MODELS['several'], 2)
    squares = np.array([level**2 for level, _ in drift_levels(seen, white, shape)])
    assert squares.mean() == pytest.approx(truth, rel=0.1)


def test_a_random_walk_has_the_spread_that_its_increments_make():
    rate, steps = 1e-4, 100
    walk = np.cumsum(np.random.default_rng(3).normal(
        0, rate * (PART_S / steps)**0.5, (RECORDS, PARTS * steps)), axis=1)
    means = walk.reshape(RECORDS, PARTS, steps).mean(axis=2)
    expected = spread_of(drift_of_means(MODELS['walk'], PART_S, PARTS))
    assert np.var(means, axis=1).mean() == pytest.approx(expected, rel=0.08)


def test_less_spread_than_white_noise_makes_is_a_bound_and_drift_alone_has_its_interval():
    no_shape = np.zeros((PARTS, PARTS))
    [(level, (low, high))] = drift_levels(np.array([1e-9]), 1e-6, no_shape)
    assert (level, low) == (0, 0)
    assert 5e-4 < high < 1e-2
    [(level, (low, high))] = drift_levels(np.array([1e-6]), 0.0, no_shape)
    assert level == pytest.approx(1e-3)
    assert 4e-4 < low < 6e-4
    assert 3e-3 < high < 6e-3
    # A constant segment has no drift.
    assert drift_levels(np.zeros(1), 0.0, no_shape) == [(0.0, (0.0, 0.0))]
