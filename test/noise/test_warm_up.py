# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A warm-up thousands of times the noise leaves the coefficients as they are."""

from dataclasses import replace
import re

from characterized import characterized
from imu_allan.characterization.findings import with_start
from imu_allan.finding import Finding
from imu_allan.noise.simulate import simulate
from imu_allan.result import TemperatureDependence
from imu_allan.tuning.tune import tune
from imu_allan.writers.included import trend_notes
import numpy as np
import pytest

N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
MODEL = {N: 1e-4, B: 2e-5}


def warmed(mean, seed, rate=50.0, hours=1.0, model=MODEL):
    """Characterize a sensor whose mean follows a function of time."""
    count = round(hours * 3600 * rate)
    return characterized(
        simulate(model, count, rate, seed) + mean(np.arange(count) / rate), rate)


def covers(interval, value):
    return interval[0] <= value <= interval[1]


NIGHT = {'rate': 1.0, 'hours': 14.0, 'model': {N: 1e-3, B: 1e-4}}


@pytest.mark.parametrize(('amplitude', 'time', 'record'), [
    (0.01, 1800.0, {}), (0.1, 120.0, {}), (0.1, 7200.0, {}), (0.05, 300.0, NIGHT)])
def test_no_ramp_random_walk_or_low_pass_is_made_of_a_strong_warm_up(amplitude, time, record):
    axis, said = warmed(lambda t: amplitude * np.exp(-t / time), 3 if record else 1, **record)
    assert set(said) == {'warm_up'}
    assert axis.coefficients[N].value == pytest.approx(record.get('model', MODEL)[N], rel=0.01)
    assert axis.trend.ramp is None
    assert not axis.coefficients[K].observable
    assert axis.band_edge_hz is None
    warm = axis.trend.warm_up
    assert warm.amplitude == pytest.approx(amplitude, rel=0.1)
    assert said['warm_up']['amplitude'] == warm.amplitude
    assert covers(warm.time_constant_ci95, time)
    assert axis.trend.second_warm_up is None
    assert axis.stationarity.steady
    assert axis.tones == ()


def test_a_die_and_its_housing_are_two_exponentials():
    axis, said = warmed(lambda t: 0.01 * np.exp(-t / 120) + 0.005 * np.exp(-t / 1200), 2, hours=2)
    warm = axis.trend.warm_up
    assert covers(warm.time_constant_ci95, 120)
    assert covers(axis.trend.second_warm_up.time_constant_ci95, 1200)
    assert axis.coefficients[B].value == pytest.approx(2e-5, rel=0.3)
    assert not axis.coefficients[K].observable
    assert said['warm_up']['exponentials'] == 2
    assert said['warm_up']['steady_after_s'] > 120


def test_a_ramp_beside_a_warm_up_is_both():
    axis, _ = warmed(lambda t: 0.01 * np.exp(-t / 300) + 1e-7 * t, 3, hours=2)
    assert covers(axis.trend.ramp.ci95, 1e-7)
    assert covers(axis.trend.warm_up.time_constant_ci95, 300)


def test_the_advice_fits_the_length_of_the_record_and_numbers_for_a_filter_have_the_warm_up():
    short, _ = warmed(lambda t: 0.01 * np.exp(-t / 60), 4)
    long, _ = warmed(lambda t: 0.01 * np.exp(-t / 1800), 4)
    cold, _ = warmed(lambda t: 0 * t, 4)

    def start(*axes, length_s=3600.0, several=False):
        named = dict(zip(('gyro_x', 'gyro_y'), axes, strict=False))
        [found] = with_start([Finding('warm_up')], named, length_s, several=several)
        return found.values['start']

    assert start(short) == 'auto'
    assert start(long) is None
    # The recording begins once: there is one start for all axes.
    assert start(short, long) == 'auto'
    assert re.fullmatch(r'\d+min', start(long, length_s=4 * 3600.0, several=True))
    # The shortest of several recordings is over before.
    assert start(long, several=True) is None
    assert tune(short, 0.1, 60.0).random_walk > 10 * tune(cold, 0.1, 60.0).random_walk
    assert trend_notes({'gyro_x': cold}) == []
    heated = replace(long, trend=replace(long.trend, warm_up=None, temperature=(
        TemperatureDependence(1e-3, (9e-4, 1.1e-3), 20.0, 30.0))))
    cycling = replace(cold, trend=replace(cold.trend, cycle_s=1200.0))
    for axis, said in ((short, (
            'The warm-up of gyro y is in these numbers, unlike in the coefficients. Where the '
            'recording is long enough, --start auto or --start TIME of analyze leaves it out.')),
            (heated, 'What temperature does to gyro y is in these numbers, unlike in the '
             'coefficients: a recording at one temperature is without it.'),
            (cycling, "The slow cycle of gyro y, such as a heater's, of about 20 min is in these "
             'numbers, unlike in the coefficients. That is right where the filter will meet it, '
             'too; else record without it.')):
        assert trend_notes({'gyro_x': cold, 'gyro_y': axis})[0] == said


@pytest.mark.slow
def test_the_coefficients_beside_warm_ups_are_as_good_as_without():
    inside = {N: [], B: [], K: [], 'amplitude': [], 'time': []}
    wrong = []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        amplitude, time = np.exp(generator.uniform(np.log([1e-3, 120]), np.log([0.1, 7200])))
        hours = generator.choice([1.0, 2.0, 4.0])
        axis, said = warmed(lambda t, a=amplitude, c=time: a * np.exp(-t / c), seed, hours=hours)
        wrong.append(bool(set(said) - {'warm_up', 'short_recording'}))
        for key in (N, B):
            found = axis.coefficients[key]
            inside[key].append(covers(found.ci95, MODEL[key]) if found.observable
                               else found.upper95 > MODEL[key])
        inside[K].append(not axis.coefficients[K].observable)
        warm = axis.trend.warm_up
        if warm is not None:
            inside['amplitude'].append(covers(warm.ci95, amplitude))
            inside['time'].append(covers(warm.time_constant_ci95, time))
    assert np.mean(wrong) <= 0.05
    for key, each in inside.items():
        assert np.mean(each) > 0.85, key
