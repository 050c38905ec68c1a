# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Filters with stated numbers over simulated recordings: as predicted, noisier, in stop and go."""

from drifting_axes import axis_of
from imu_allan.block import EvenBlock
from imu_allan.characterization.axis import characterize
from imu_allan.noise.simulate import simulate
from imu_allan.tuning.field_test import field_test
from imu_allan.tuning.means import Means
from imu_allan.tuning.tune import tune
from imu_allan.tuning.verification import verify
import numpy as np
import pytest
from whole_lines import refused

RATE = 20.0
N, K = 1e-3, 1e-4
FLICKER = tuple((3e-4 * np.sqrt(np.log(4) / np.pi), 0.01 * 4.0**k) for k in range(16))
AXES = {'gyro_x': axis_of(N, K), 'gyro_y': axis_of(N, K, processes=((3e-4, 100.0),))}


def rest(seconds, noise=1.0, drift=1.0, seed=0):
    """Return samples of both axes, shape (n, 6), the others absent."""
    n = round(seconds * RATE)
    rows = np.full((n, 6), np.nan)
    for axis in range(2):
        terms = {'noise_density': noise * N, 'rate_random_walk': drift * K}
        if axis:
            terms['gauss_markov'] = {'sigma': drift * 3e-4, 'correlation_time_s': 100.0}
        rows[:, axis] = simulate(terms, n, RATE, 2 * seed + axis)
    return rows


def means_of(*blocks):
    means = Means()
    means.take(blocks, 1e9 / RATE)
    return means


def met_in(rows, **times):
    return field_test(AXES, means_of(EvenBlock(rows, 0)), 1.0, **times)


def test_the_same_sensor_is_met_as_predicted():
    for one in met_in(rest(7200)).values():
        assert one.stops == 1
        assert one.tested_s == pytest.approx(7200)
        assert [row.interval_s for row in one.full.innovations] == [1, 10, 60]
        for row in one.full.innovations:
            assert row.nis == pytest.approx(1, abs=5 * np.sqrt(2 / row.steps))
        for coast, (low, high) in zip(one.full.coasts, one.full.bands, strict=True):
            assert low < coast.predicted_sigma < high
            assert low < coast.observed_rms < high
        assert [coast.horizon_s for coast in one.tuned.coasts] == [10, 60, 300]
        assert one.noise_ci95[0] < 1 < one.noise_ci95[1]
        assert one.random_walk_ci95[0] < 1 < one.random_walk_ci95[1]
        assert one.random_walk_ci95[1] / one.random_walk_ci95[0] < 2


def test_threefold_noise_is_a_factor_of_the_noise_and_fourfold_drift_of_the_random_walk():
    for one in met_in(rest(7200, noise=3.0)).values():
        assert one.tuned.innovations[0].nis == pytest.approx(8, abs=1.5)
        assert one.noise_ci95[0] < 3 < one.noise_ci95[1]
        assert one.noise_factor == pytest.approx(3, rel=0.1)
        assert one.random_walk_ci95[0] < 1 < one.random_walk_ci95[1]
    # However far.
    for one in met_in(rest(600, noise=3000.0)).values():
        assert 2000 < one.noise_ci95[0] < one.noise_factor < one.noise_ci95[1] < 4000
    for one in met_in(rest(7200, drift=4.0)).values():
        assert one.full.innovations[1].nis > 2
        assert one.noise_ci95[0] < 1 < one.noise_ci95[1]
        assert one.random_walk_factor == pytest.approx(4, rel=0.3)
        assert one.random_walk_ci95[0] < 4 < one.random_walk_ci95[1]


def test_a_recording_without_a_stop_is_reported_and_other_axes_are_left_out():
    with refused('nothing is at rest for 16 s in a row: too short to run a filter over'):
        met_in(rest(10))
    assert field_test({'accel_x': AXES['gyro_x']}, means_of(EvenBlock(rest(60), 0))) == {}


@pytest.mark.slow
@pytest.mark.parametrize('fitted_min', [None, 20, 120])
@pytest.mark.parametrize(('terms', 'processes'), [
    ({'rate_random_walk': K}, ()), ({'bias_instability': 3e-4}, FLICKER)], ids=['N+K', 'N+B'])
def test_factors_hold_where_the_numbers_are_stated_or_come_from_a_recording(
        fitted_min, terms, processes):
    """Half an hour of stops of a minute each with more noise and drift: 200 pairs."""
    walk = terms.get('rate_random_walk', 0.0)
    stated, there = axis_of(N, walk, processes), axis_of(
        2 * N, 3 * walk, tuple((3 * sigma, time) for sigma, time in processes))
    right, found = tune(there, 1.0), []
    for seed in range(200):
        axis = stated if fitted_min is None else characterize(simulate(
            {'noise_density': N, **terms}, round(60 * fitted_min * RATE), RATE, 1000 + seed), RATE)
        rows = np.full((108_000, 6), np.nan)
        rows[:, 0] = simulate({'noise_density': 2 * N, **{
            key: 3 * value for key, value in terms.items()}}, 108_000, RATE, 5000 + seed)
        stops = [EvenBlock(rows[at:at + 1200], at) for at in range(0, 108_000, 3600)]
        [one] = field_test({'gyro_x': axis}, means_of(*stops), 1.0).values()
        own = tune(axis, 1.0)
        noise, drift = (right.noise_density / own.noise_density,
                        right.random_walk / own.random_walk)
        found.append((one.noise_ci95[0] < noise < one.noise_ci95[1],
                      one.random_walk_ci95[0] < drift < one.random_walk_ci95[1],
                      one.random_walk_factor / drift))
    inside, off = np.mean(found, axis=0)[:2], np.median(found, axis=0)[2]
    print(f'{terms}, {fitted_min} min: factors of N and K in their intervals {inside}; K {off:g}')
    assert np.all(inside > 0.89)
    # The lowest coefficients of stops of a minute hold a quarter less.
    assert fitted_min or off == pytest.approx(1, rel=0.05)


ROWS = np.random.default_rng(1).normal(size=(1050, 6))


def taken(*blocks):
    means = Means()
    means.take(blocks, 1e8)
    return means


def test_the_blocks_they_came_in_make_no_difference():
    whole = taken(EvenBlock(ROWS, 0))
    batched = taken(*(EvenBlock(ROWS[i:i + 7], i) for i in range(0, 1050, 7)))
    np.testing.assert_allclose(batched.series.means, whole.series.means, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(whole.series.means[:, :100].T, ROWS[:1000].reshape(
        100, 10, 6).mean(axis=1), rtol=1e-12, atol=1e-15)
    assert whole.cell_s == 1.0


@pytest.mark.parametrize('size', [1050, 100, 7])
def test_an_axis_that_comes_late_or_drops_out_leaves_a_gap(size):
    rows = ROWS.copy()
    rows[:200, 1] = rows[400:450, 1] = np.nan
    means = Means(['gyro_x', 'gyro_y'])
    means.take([EvenBlock(rows[i:i + size], i) for i in range(0, 1050, size)], 1e8)
    assert means.columns.tolist() == [0, 1]
    places = means.series.keys & (2**44 - 1)
    assert places.tolist() == [*range(20, 40), *range(45, 105)]
    assert len(np.unique(means.series.keys >> 44)) == 2
    np.testing.assert_allclose(means.series.means[:, 20], ROWS[450:460, :2].mean(axis=0))


HERE = axis_of(1e-3, 5e-5)


@pytest.mark.parametrize(('noise', 'drift'), [(1, 1), (3, 1), (1, 4)],
                         ids=['the same', 'more noise in motion', 'more drift in motion'])
def test_more_noise_or_drift_is_a_factor_of_its_number_alone(noise, drift):
    found = verify(HERE, axis_of(noise * 1e-3, drift * 5e-5), tune(HERE, 1.0))
    assert found.noise_factor == pytest.approx(noise, rel=0.05 if drift > 1 else 0.02)
    assert found.random_walk_factor == pytest.approx(drift, rel=0.15)
    assert found.excess[0].ratio == pytest.approx(noise, rel=0.01)
    if noise == drift:
        assert found.noise_factor == found.random_walk_factor == 1
        assert found.met.nis == pytest.approx(1, abs=0.02)
        assert [excess.ratio for excess in found.excess] == pytest.approx([1, 1, 1, 1])
    elif noise > 1:
        assert found.met.nis > 5
        assert found.excess[-1].ratio < 1.5
    else:
        assert found.met.coast_ratio > 5
        assert found.excess[-1].ratio > 3


def test_the_factor_of_a_drift_that_is_badly_known_is_open_wider():
    short = axis_of(1e-3, 5e-5, known=(0.01, 400.0))
    there = axis_of(1e-3, 2e-4)
    # 1.5 * 1200/60 degrees of freedom, and of the variance over 60 s three quarters are drift.
    half = 1.96 * (2 * 1.5 * 1200 / 60)**-0.5 * (1 + (1e-3 / 5e-5)**2 * 3 / 60**2)
    found = verify(short, there, tune(short, 1.0))
    low, high = found.random_walk_ci95
    # The other's curve is stated without an interval.
    factor = found.random_walk_factor
    assert np.log([factor / low, high / factor]) == pytest.approx([half, half], rel=0.05)
    assert found.noise_ci95 == (found.noise_factor, found.noise_factor)
