# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A warm-up thousands of times the noise leaves the coefficients as they are."""


from characterized import characterized
from imu_allan.noise.simulate import simulate
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
