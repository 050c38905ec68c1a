# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A mean that follows the temperature, and noise that only seems to."""

from functools import partial

from characterized import B, characterized, covers, ends, holds, K, N
from imu_allan.noise.simulate import simulate
from imu_allan.noise.trends.temperature_series import TemperatureSeries
import numpy as np
import pytest
from scipy.signal import lfilter

RATE = 4.0
DURATION = 7200.0
TIME = np.arange(round(DURATION * RATE)) / RATE
NOISE = {N: 1e-3, B: 3e-4}
RANDOM_WALK = {**NOISE, K: 3e-5}


def warm_up_and_cycle(seed=0):
    """Give a temperature that settles by 10 K in a quarter of an hour, and swings by 2 K."""
    phase = np.random.default_rng(seed).uniform(0, 6)
    return 20 + 10 * (1 - np.exp(-TIME / 900)) + 2 * np.sin(2 * np.pi * TIME / 5000 + phase)


def heated(seed=0):
    """Give a temperature that a heater's thermostat swings by 2 K in periods of half an hour."""
    turn = (TIME / 1800 + np.random.default_rng(seed).uniform()) % 1
    return 22 + 2 * np.where(turn < 0.4, 1 - 2 * np.exp(-turn / 0.08), -1 + 2 * np.exp(
        (0.4 - turn) / 0.12))


def walking(seed=0):
    steps = np.random.default_rng(seed).standard_normal(len(TIME))
    return 20 + 3 * np.cumsum(steps) / np.sqrt(len(TIME))


def lagging(celsius, seconds):
    """Give what a thermometer shows that is so slow."""
    share = 1 / (seconds * RATE)
    return lfilter([share], [1, share - 1], celsius, zi=[(1 - share) * celsius[0]])[0]


def axes_at(model, celsius, mean=None, records=3):
    """Characterize records that have a mean, each with the temperature of a thermometer."""
    return [characterized(simulate(model, len(TIME), RATE, seed) + (mean(seed) if mean else 0.0),
                          RATE, celsius and TemperatureSeries(TIME, celsius(seed)))[0]
            for seed in range(records)]


def test_a_mean_that_follows_the_temperature_is_no_random_walk():
    without, beside = (axes_at(NOISE, celsius, lambda seed: 1e-3 * warm_up_and_cycle(seed))
                       for celsius in (None, warm_up_and_cycle))
    heat = [one.trend.temperature for one in beside]
    assert np.mean([one.coefficients[K].observable for one in beside]) <= 0.1
    assert all(one is not None for one in heat)
    assert np.mean([covers(one.ci95, 1e-3) for one in heat]) > 0.7
    widths = [np.mean([np.diff(ends(one.coefficients[B])) for one in some])
              for some in (beside, without)]
    # Without a thermometer a warm-up and a cycle take its place.
    assert widths[0] == pytest.approx(widths[1], rel=0.02)
    assert all(holds(one.coefficients[B], 3e-4) for one in beside)


def test_a_random_walk_is_not_made_of_a_temperature_whose_lag_is_unknown():
    for one in axes_at(NOISE, lambda seed: lagging(walking(seed), 400.0),
                       lambda seed: 1e-3 * walking(seed)):
        assert not one.coefficients[K].observable


LATE = partial(lagging, seconds=180.0)


@pytest.mark.parametrize(('lag', 'shown', 'felt'), [
    (180.0, LATE, np.array), (-180.0, np.array, LATE), (None, np.array, np.array)])
def test_a_thermometer_behind_the_sensor_and_a_sensor_behind_it_are_reported(lag, shown, felt):
    found = axes_at(NOISE, lambda seed: shown(heated(seed)),
                    lambda seed: 1e-3 * felt(heated(seed)), 4)
    heat = [one.trend.temperature for one in found]
    assert all(one is not None for one in heat)
    late = [one for one in heat if one.lag_s is not None]
    assert len(late) >= 3 if lag else not late
    assert not late or np.mean([covers(one.lag_ci95, lag) for one in late]) > 0.7
    assert np.mean([covers(one.ci95, 1e-3) for one in heat]) > 0.7
    assert np.mean([one.coefficients[K].observable for one in found]) <= 0.25


def test_a_warm_up_that_cannot_show_a_lag_has_the_slope_without_one():
    # A lag of the exponential only scales it.
    def warming(_):
        return 20 + 10 * (1 - np.exp(-TIME / 900))

    found = [one.trend.temperature for one in axes_at(
        {N: 1e-3}, warming, lambda seed: 1e-3 * warming(seed), 6)]
    assert [one.per_kelvin for one in found] == pytest.approx([1e-3] * 6, rel=0.05)
    assert not any(one.lag_s for one in found)
    assert np.mean([covers(one.ci95, 1e-3) for one in found]) > 0.6


def test_what_a_lag_does_to_a_temperature_is_undone():
    celsius = 20 + 3 * np.sin(2 * np.pi * TIME / 1800)
    trend = TemperatureSeries(TIME[::16], lagging(celsius, 120.0)[::16])
    inner = slice(50, -50)
    assert trend.of_sensor(120.0).celsius[inner] == pytest.approx(celsius[::16][inner], abs=0.02)
    assert TemperatureSeries(TIME[::16], celsius[::16]).of_sensor(-120.0).celsius[inner] \
        == pytest.approx(trend.celsius[inner], abs=0.02)


def test_a_lag_does_not_make_a_spike_of_the_jump_between_two_runs():
    sensor = 20 + 3 * np.sin(2 * np.pi * TIME / 1800)
    # A quarter of a cycle is missing, in which both become 3 K cooler.
    kept = np.flatnonzero((TIME < 450) | (TIME > 900))[::16]
    time, begins = TIME[:16 * len(kept):16], int(np.argmax(TIME[kept] > 900))
    trend = TemperatureSeries(time, lagging(sensor, 120.0)[kept], np.array([begins]))
    off = np.abs(trend.of_sensor(120.0).celsius - sensor[kept])
    # With the slope of the jump it would be 7 K.
    assert off.max() < 1.0
    assert np.median(off) < 0.01


@pytest.mark.slow
def test_false_coefficients_and_random_walks_made_of_a_lag_are_rare():
    def temperatures(number):
        phase = number * 1000
        return [lambda seed, one=one: one(phase + seed) for one in (
            warm_up_and_cycle, heated, lambda seed: 20 + np.cumsum(
                np.random.default_rng(seed).standard_normal(len(TIME))) / 50)]

    named = [one.trend.temperature is not None for model in (NOISE, RANDOM_WALK)
             for celsius in temperatures(1) for one in axes_at(model, celsius, records=60)]
    walks = [one.coefficients[K].observable for celsius in temperatures(2)
             for one in axes_at(NOISE, lambda seed, c=celsius: lagging(c(seed), 180.0),
                                lambda seed, c=celsius: 1e-3 * c(seed), records=60)]
    assert np.mean(named) <= 0.05
    assert np.mean(walks) <= 0.05
