# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What filters predict over recordings: of each half the other, of a field test the bench."""

from characterized import covers, taken_in
from exact_results import axis_of, FLICKER
from imu_allan.block import EvenBlock
from imu_allan.characterization.axis import characterize
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.result import Backtest, Coast
from imu_allan.tuning.backtest import backtest, bands_of
from imu_allan.tuning.field_test import field_test
from imu_allan.tuning.means import Means
from imu_allan.tuning.tune import tune
from imu_allan.tuning.uncertainty import spread_of_forecast
import numpy as np
import pytest
from whole_lines import refused

RATE = 20.0
N, K = 1e-3, 1e-4
AXES = {'gyro_x': axis_of(N, K), 'gyro_y': axis_of(N, K, processes=((3e-4, 100.0),))}
ROWS = np.random.default_rng(1).normal(size=(1050, 6))
TERMS = {'noise_density': 1e-3, 'bias_instability': 3e-4, 'rate_random_walk': 1e-5}


def rest(seconds, noise=1.0, drift=1.0, seed=0):
    n = round(seconds * RATE)
    rows = np.full((n, 6), np.nan)
    for axis in range(2):
        terms = {'noise_density': noise * N, 'rate_random_walk': drift * K}
        if axis:
            terms['gauss_markov'] = {'sigma': drift * 3e-4, 'correlation_time_s': 100.0}
        rows[:, axis] = simulate(terms, n, RATE, 2 * seed + axis)
    return rows


def means_of(*blocks, rate=RATE, axes=('gyro_x', 'gyro_y')):
    means = Means(axes)
    means.take(blocks, 1e9 / rate)
    return means


def met_in(rows):
    return field_test(AXES, means_of(EvenBlock(rows, 0)), 1.0)


def factors_hold(one, noise, drift):
    assert covers(one.noise_ci95, noise)
    assert covers(one.random_walk_ci95, drift)


def test_the_same_sensor_is_met_as_predicted():
    for one in met_in(rest(7200)).values():
        assert (one.stops, one.tested_s) == (1, pytest.approx(7200))
        assert [row.interval_s for row in one.full.innovations] == [1, 10, 60]
        for row in one.full.innovations:
            assert row.nis == pytest.approx(1, abs=5 * np.sqrt(2 / row.steps))
        for coast, (low, high) in zip(one.full.coasts, one.full.bands, strict=True):
            assert low < coast.predicted_sigma < high
            assert low < coast.observed_rms < high
        assert [coast.horizon_s for coast in one.tuned.coasts] == [10, 60, 300]
        factors_hold(one, 1, 1)
        assert one.random_walk_ci95[1] / one.random_walk_ci95[0] < 2


def test_threefold_noise_is_a_factor_of_the_noise_and_fourfold_drift_of_the_random_walk():
    for one in met_in(rest(7200, noise=3.0)).values():
        assert one.tuned.innovations[0].nis == pytest.approx(8, abs=1.5)
        assert one.noise_factor == pytest.approx(3, rel=0.1)
        factors_hold(one, 3, 1)
    # However far.
    for one in met_in(rest(600, noise=3000.0)).values():
        assert 2000 < one.noise_ci95[0] < one.noise_factor < one.noise_ci95[1] < 4000
    for one in met_in(rest(7200, drift=4.0)).values():
        assert one.full.innovations[1].nis > 2
        assert one.random_walk_factor == pytest.approx(4, rel=0.3)
        factors_hold(one, 1, 4)


def test_a_recording_without_a_stop_is_reported_and_other_axes_are_left_out():
    with refused('nothing is at rest for 16 s in a row: too short to run a filter over'):
        met_in(rest(10))
    assert field_test({'accel_x': AXES['gyro_x']}, means_of(EvenBlock(rest(60), 0))) == {}


@pytest.mark.slow
@pytest.mark.parametrize('fitted_min', [None, 20, 120])
@pytest.mark.parametrize(('terms', 'processes'), [
    ({'rate_random_walk': K}, ()), ({'bias_instability': 3e-4}, FLICKER)], ids=['N+K', 'N+B'])
def test_factors_hold_for_numbers_stated_or_from_a_recording(fitted_min, terms, processes):
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
        [one] = field_test({'gyro_x': axis}, means_of(*stops, axes=['gyro_x']), 1.0).values()
        own = tune(axis, 1.0)
        drift = right.random_walk / own.random_walk
        found.append((covers(one.noise_ci95, right.noise_density / own.noise_density),
                      covers(one.random_walk_ci95, drift), one.random_walk_factor / drift))
    inside, off = np.mean(found, axis=0)[:2], np.median(found, axis=0)[2]
    assert np.all(inside > 0.89)
    # The lowest coefficients of stops of a minute hold a quarter less.
    assert fitted_min or off == pytest.approx(1, rel=0.05)


def test_the_blocks_they_came_in_make_no_difference():
    whole = means_of(EvenBlock(ROWS, 0), rate=10.0)
    batched = means_of(*(EvenBlock(ROWS[i:i + 7], i) for i in range(0, 1050, 7)), rate=10.0)
    np.testing.assert_allclose(batched.series.means, whole.series.means, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(whole.series.means[:, :100].T, ROWS[:1000, :2].reshape(
        100, 10, 2).mean(axis=1), rtol=1e-12, atol=1e-15)
    assert whole.cell_s == 1.0


@pytest.mark.parametrize('size', [1050, 100, 7])
def test_an_axis_that_comes_late_or_drops_out_leaves_a_gap(size):
    rows = ROWS.copy()
    rows[:200, 1] = rows[400:450, 1] = np.nan
    means = means_of(*(EvenBlock(rows[i:i + size], i) for i in range(0, 1050, size)), rate=10.0)
    assert means.columns.tolist() == [0, 1]
    places = means.series.keys & (2**40 - 1)
    assert places.tolist() == [*range(20, 40), *range(45, 105)]
    assert len(np.unique(means.series.keys >> 40)) == 2
    np.testing.assert_allclose(means.series.means[:, 20], ROWS[450:460, :2].mean(axis=0))


def predictions(estimator):
    finished = estimator.finished().periodogram
    return backtest(finished.series, finished.cell, 1 / RATE)


def test_a_steady_sensor_is_predicted_as_well_as_it_predicts():
    hours = simulate(TERMS, round(4 * 3600 * RATE), RATE, seed=2)
    [found] = predictions(taken_in(hours))
    assert found.trained_s == found.tested_s == pytest.approx(7200, rel=0.01)
    assert [row.interval_s for row in found.innovations] == pytest.approx([3.2, 9.6, 60.8])
    for row in found.innovations:
        assert row.nis == pytest.approx(1, abs=5 * np.sqrt(2 / row.steps) + 0.05)
    assert [row.horizon_s for row in found.coast] == pytest.approx([10, 60, 300], rel=0.1)
    for row in found.coast:
        assert 0.6 < row.observed_rms / row.predicted_sigma < 1.6
    # What is too short or nothing is not tested.
    assert predictions(taken_in(hours[:round(500 * RATE)])) == [None]
    assert predictions(Estimator(2)) == [None, None]


def test_a_sensor_that_changes_half_way_is_caught():
    quiet, loud = (simulate({'noise_density': n}, round(3600 * RATE), RATE, seed)
                   for n, seed in ((1e-3, 1), (3e-3, 2)))
    [found] = predictions(taken_in(np.concatenate((quiet, loud))))
    # One direction sees nine times, the other a ninth of what it predicts.
    assert found.innovations[0].nis == pytest.approx((9 + 1 / 9) / 2, rel=0.1)
    assert found.innovations[0].of_halves == pytest.approx((1 / 9, 9), rel=0.1)


@pytest.mark.parametrize(('tested_s', 'horizon', 'outages'), [
    # Two halves of 1000 s: 99 outages of 10 s and 2 of 300 s in each, the first only learns.
    (1000.0, 10.0, 198), (1000.0, 300.0, 4),
    # Multiples of a horizon, whose quotient may be rounded down.
    *((count * 60.8, 60.8, 2 * (count - 1)) for count in (10, 11, 12, 13))])
def test_the_band_of_the_observed_drift_is_that_of_its_outages(tested_s, horizon, outages):
    axis = axis_of(1e-3, backtest=Backtest(tested_s, tested_s, (), (Coast(horizon, 2.0, 2.0),)))
    [(low, high)] = bands_of(axis)
    spread = np.hypot(spread_of_forecast(axis, np.array([horizon]))[0], np.sqrt(0.5 / outages))
    assert np.log(high / 2) == np.log(2 / low) == pytest.approx(1.96 * spread, rel=1e-4)
    assert bands_of(axis_of(1e-3)) == ()
