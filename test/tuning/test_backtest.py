# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Each half of a record predicted from the other."""

from drifting_axes import axis_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.result import Backtest, Coast
from imu_allan.tuning.backtest import backtest, bands_of
from imu_allan.tuning.uncertainty import spread_of_forecast
import numpy as np
import pytest

RATE = 20.0
TERMS = {'noise_density': 1e-3, 'bias_instability': 3e-4, 'rate_random_walk': 1e-5}


def halves_of(*columns):
    estimator = Estimator(len(columns))
    estimator.update(np.stack(columns, axis=1))
    finished = estimator.finished().periodogram
    return backtest(finished.series, finished.cell, 1 / RATE)


@pytest.fixture(scope='module')
def hours():
    return simulate(TERMS, round(4 * 3600 * RATE), RATE, seed=2)


def test_a_steady_sensor_is_predicted_as_well_as_it_predicts(hours):
    [found] = halves_of(hours)
    assert found.trained_s == found.tested_s == pytest.approx(7200, rel=0.01)
    assert [row.interval_s for row in found.innovations] == pytest.approx([3.2, 9.6, 60.8])
    for row in found.innovations:
        assert row.nis == pytest.approx(1, abs=5 * np.sqrt(2 / row.steps) + 0.05)
    assert [row.horizon_s for row in found.coast] == pytest.approx([10, 60, 300], rel=0.1)
    for row in found.coast:
        assert 0.6 < row.observed_rms / row.predicted_sigma < 1.6


def test_a_sensor_that_changes_half_way_is_caught():
    quiet, loud = (simulate({'noise_density': n}, round(3600 * RATE), RATE, seed)
                   for n, seed in ((1e-3, 1), (3e-3, 2)))
    [found] = halves_of(np.concatenate((quiet, loud)))
    # One direction sees nine times, the other a ninth of what it predicts.
    assert found.innovations[0].nis == pytest.approx((9 + 1 / 9) / 2, rel=0.1)
    assert found.innovations[0].of_halves == pytest.approx((1 / 9, 9), rel=0.1)


def test_the_band_of_the_observed_drift_is_that_of_its_outages():
    horizons = 10.0, 300.0
    axis = axis_of(1e-3, backtest=Backtest(1000.0, 1000.0, (), tuple(
        Coast(horizon, 2.0, 2.0) for horizon in horizons)))
    # Two halves of 1000 s: 99 outages of 10 s and 2 of 300 s in each, the first only learns.
    for (low, high), horizon, outages in zip(bands_of(axis), horizons, (198, 4), strict=True):
        spread = np.hypot(spread_of_forecast(axis, np.array([horizon]))[0],
                          np.sqrt(0.5 / outages))
        assert np.log(high / 2) == np.log(2 / low) == pytest.approx(1.96 * spread, rel=1e-4)
    assert bands_of(axis_of(1e-3)) == ()


@pytest.mark.parametrize('horizons', [10, 11, 12, 13])
def test_a_part_of_some_horizons_holds_an_outage_less_than_it_has_of_them(horizons):
    tested_s = horizons * 60.8
    axis = axis_of(1e-3, backtest=Backtest(tested_s, tested_s, (), (Coast(60.8, 2.0, 2.0),)))
    [(_, high)] = bands_of(axis)
    spread = np.hypot(spread_of_forecast(axis, np.array([60.8]))[0],
                      np.sqrt(0.5 / (2 * (horizons - 1))))
    assert np.log(high / 2) == pytest.approx(1.96 * spread, rel=1e-4)


def test_every_axis_is_tested_on_its_own(hours):
    both = halves_of(hours, 100 * hours)
    for one, other in zip(both[0].coast, both[1].coast, strict=True):
        assert other.observed_rms == pytest.approx(100 * one.observed_rms, rel=1e-6)


def test_a_constant_axis_and_a_short_record_are_not_tested(hours):
    constant, noisy = halves_of(np.zeros_like(hours), hours)
    assert constant is None
    assert noisy is not None
    assert halves_of(hours[:round(500 * RATE)]) == [None]


def test_only_the_longest_unbroken_segment_is_tested(hours):
    estimator = Estimator()
    estimator.update(hours[:round(3600 * RATE)])
    estimator.skip(round(1000 * RATE))
    estimator.update(hours[round(3600 * RATE):])
    finished = estimator.finished().periodogram
    [found] = backtest(finished.series, finished.cell, 1 / RATE)
    assert found.trained_s == pytest.approx(1.5 * 3600, rel=0.01)


def test_no_cells_give_no_test():
    finished = Estimator(2).finished().periodogram
    assert backtest(finished.series, finished.cell, 0.01) == [None, None]
