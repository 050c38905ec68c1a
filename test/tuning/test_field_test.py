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


def test_a_filter_with_a_process_is_run_as_one():
    axes = {'gyro_y': AXES['gyro_y']}
    means = means_of(EvenBlock(rest(7200, drift=3.0), 0))
    [process] = field_test(axes, means, 1.0, bias='gauss_markov').values()
    [walk] = field_test(axes, means, 1.0).values()
    assert process.full == walk.full
    for bias, one in (('gauss_markov', process), ('random_walk', walk)):
        horizon, _, predicted = tune(axes['gyro_y'], 1.0, 60.0, bias).consistency[-1]
        [coast] = [coast for coast in one.tuned.coasts if coast.horizon_s == horizon]
        assert coast.predicted_sigma == pytest.approx(predicted, rel=0.01)
    own = tune(axes['gyro_y'], 1.0, bias='gauss_markov')
    there = tune(axis_of(N, 3 * K, processes=((9e-4, 100.0),)), 1.0, bias='gauss_markov',
                 correlation_time_s=own.correlation_time_s)
    assert process.random_walk_ci95[0] < there.sigma / own.sigma < process.random_walk_ci95[1]
    assert process.random_walk_factor > 1.8
    assert process.noise_ci95[0] < 1 < process.noise_ci95[1]


def test_another_posture_at_every_stop_is_no_drift():
    blocks = []
    for stop in range(30):
        level = 0.1 * np.random.default_rng(stop).normal()
        blocks.append(EvenBlock(rest(40, seed=stop) + level, round(stop * 100 * RATE)))
    for one in field_test(AXES, means_of(*blocks), 1.0).values():
        assert one.stops == 30
        assert one.tested_s == pytest.approx(1200)
        assert one.full.innovations[0].nis == pytest.approx(1, abs=0.25)
        assert one.random_walk_ci95[0] < 1
        assert one.random_walk_factor < 2


def test_a_factor_that_the_recording_cannot_tell_is_said_to_be_open():
    [one] = field_test({'gyro_x': axis_of(N, 1e-12)}, means_of(EvenBlock(rest(60), 0)),
                       1.0).values()
    assert one.random_walk_ci95 == (0, np.inf)
    [one] = field_test({'gyro_x': axis_of(N)}, means_of(EvenBlock(rest(60), 0)), 1.0).values()
    assert one.random_walk_ci95 == (0, np.inf)
    assert one.noise_ci95[0] < 1 < one.noise_ci95[1]


def test_a_recording_without_a_stop_is_reported_and_other_axes_are_left_out():
    with refused('nothing is at rest for 16 s in a row: too short to run a filter over'):
        met_in(rest(10))
    assert field_test({'accel_x': AXES['gyro_x']}, means_of(EvenBlock(rest(60), 0))) == {}


@pytest.mark.parametrize('drift', [1.0, 1e-9], ids=['as predicted', 'nearly gone'])
def test_the_factor_of_a_drift_that_is_badly_known_is_open_wider(drift):
    """However far the likeliest factor of one that is nearly gone lies below the bound."""
    means = means_of(EvenBlock(rest(1800, drift=drift), 0))
    long, short = (field_test({'gyro_x': axis_of(N, K, known=(0.01, known_s))}, means, 1.0)[
        'gyro_x'] for known_s in (1e6, 400.0))
    # 1.5 * 1200/60 degrees of freedom, and of the variance over 60 s nine tenths are drift.
    half_width = 1.96 * (2 * 1.5 * 1200 / 60)**-0.5 * (1 + (N / K)**2 * 3 / 60**2)
    assert short.random_walk_factor == long.random_walk_factor
    assert short.noise_ci95 == long.noise_ci95
    if drift == 1.0:
        ours, other = (np.log(np.array(one.random_walk_ci95) / one.random_walk_factor)
                       for one in (short, long))
        assert ours**2 == pytest.approx(other**2 + half_width**2, rel=0.05)
        return
    assert short.random_walk_factor < 0.1 * short.random_walk_ci95[1]
    assert short.random_walk_ci95[0] == long.random_walk_ci95[0] == 0
    assert short.random_walk_ci95[1] / long.random_walk_ci95[1] == pytest.approx(
        np.exp(half_width), rel=0.05)


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
