# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Each half of a record predicted from the other."""

from characterized import taken_in
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
    return predictions(taken_in(np.stack(columns, axis=1)))


def predictions(estimator):
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


def test_what_is_too_short_or_nothing_is_not_tested(hours):
    assert halves_of(hours[:round(500 * RATE)]) == [None]
    assert predictions(Estimator(2)) == [None, None]
