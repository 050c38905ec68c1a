# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What filters predict over recordings: of each half the other, of a field test the bench."""

from characterized import covers, taken_in
from exact_results import axis_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.result import Backtest, Coast
from imu_allan.tuning.backtest import backtest, bands_of, field_test
from imu_allan.tuning.forecast import spread_of_forecast
import numpy as np
import pytest

RATE = 20.0
N, K = 1e-3, 1e-4
AXES = {'gyro_x': axis_of(N, K), 'gyro_y': axis_of(N, K, processes=((3e-4, 100.0),))}
TERMS = {'noise_density': 1e-3, 'bias_instability': 3e-4, 'rate_random_walk': 1e-5}


def rest(seconds, noise=1.0, drift=1.0, seed=0):
    n = round(seconds * RATE)
    rows = np.empty((n, 2))
    for axis in range(2):
        terms = {'noise_density': noise * N, 'rate_random_walk': drift * K}
        if axis:
            terms['gauss_markov'] = {'sigma': drift * 3e-4, 'correlation_time_s': 100.0}
        rows[:, axis] = simulate(terms, n, RATE, 2 * seed + axis)
    return rows


def met_in(rows, axes=AXES):
    spectrum = taken_in(rows).finished().periodogram
    return field_test(axes, ['gyro_x', 'gyro_y'], spectrum, 1 / RATE, 1.0)


def factors_hold(one, noise, drift):
    assert one.noise_factor[0] == pytest.approx(noise, rel=0.1)
    assert covers(one.drift_factor[1], drift)


def test_the_same_sensor_is_met_as_predicted():
    for one in met_in(rest(7200)).values():
        assert (one.stops, one.tested_s) == (1, pytest.approx(7200))
        assert [row.interval_s for row in one.full.innovations] == pytest.approx(
            [1.6, 9.6, 60.8])
        for row in one.full.innovations:
            assert row.nis == pytest.approx(1, abs=5 * np.sqrt(2 / row.steps))
        for coast, (low, high) in zip(one.full.coasts, one.full.bands, strict=True):
            assert low < coast.predicted_sigma < high
            assert low < coast.observed_rms < high
        assert [coast.horizon_s for coast in one.tuned.coasts] == pytest.approx(
            [9.6, 60.8, 300.8])
        factors_hold(one, 1, 1)
        assert covers(one.noise_factor[1], 1)


def test_threefold_noise_is_a_factor_of_the_noise_and_fourfold_drift_of_the_random_walk():
    for one in met_in(rest(7200, noise=3.0)).values():
        assert one.tuned.innovations[0].nis == pytest.approx(8, abs=1.5)
        factors_hold(one, 3, 1)
    for one in met_in(rest(7200, drift=4.0)).values():
        assert one.full.innovations[1].nis > 2
        assert one.drift_factor[0] == pytest.approx(4, rel=0.3)
        assert covers(one.drift_factor[1], 4)


def test_a_sensor_far_noisier_or_quieter_has_factors_with_intervals():
    for factor in 3000.0, 1e-3:
        for one in met_in(rest(600, factor, factor)).values():
            for found, (low, high) in (one.noise_factor, one.drift_factor):
                assert 0.4 * factor < low < found < high < 2.5 * factor


def test_what_is_not_at_rest_or_not_known_is_left_out_and_short_stops_have_no_drift():
    assert met_in(rest(10)) == {}
    assert met_in(rest(60), {'accel_x': AXES['gyro_x']}) == {}
    assert list(met_in(rest(60), {'gyro_y': AXES['gyro_y']})) == ['gyro_y']
    assert met_in(rest(30))['gyro_x'].drift_factor is None


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
