# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A mean that warms up, cycles or steps far above the noise: found, and no coefficient moves."""

from characterized import (
    axes_of,
    B,
    characterized,
    covers,
    holds,
    K,
    N,
    results_of,
    simulated,
    taken_in,
)
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.noise.simulate import simulate
from imu_allan.noise.trends import kinds
from imu_allan.noise.trends.leakage import leaks
import numpy as np
import pytest
from scipy.fft import dct

MODEL = {N: 1e-4, B: 2e-5}
NIGHT = {'rate': 1.0, 'hours': 14.0, 'model': {N: 1e-3, B: 1e-4}}
RATE, HOURS = 10.0, 2.0
TIME = np.arange(round(HOURS * 3600 * RATE)) / RATE
STEADY = {N: 1e-3, B: 1e-3}


def warmed(mean, seed, rate=50.0, hours=1.0, model=MODEL):
    time = np.arange(round(hours * 3600 * rate)) / rate
    return characterized(simulate(model, len(time), rate, seed) + mean(time), rate)


@pytest.mark.parametrize(('amplitude', 'time', 'record'), [
    (0.01, 1800.0, {}), (0.1, 120.0, {}), (0.1, 7200.0, {}), (0.05, 300.0, NIGHT)])
def test_no_ramp_random_walk_or_low_pass_is_made_of_a_strong_warm_up(amplitude, time, record):
    axis, said = warmed(lambda t: amplitude * np.exp(-t / time), 3 if record else 1, **record)
    warm = axis.trend.warm_up
    assert warm.amplitude == pytest.approx(amplitude, rel=0.1)
    assert covers(warm.time_constant_ci95, time)
    assert [*said] == ['warm_up']
    assert said['warm_up']['amplitude'] == warm.amplitude
    assert axis.coefficients[N].value == pytest.approx(record.get('model', MODEL)[N], rel=0.01)
    assert not axis.coefficients[K].observable
    assert axis.stationarity.steady
    assert (axis.trend.ramp, axis.trend.second_warm_up, axis.band_edge_hz, axis.tones) == (
        None, None, None, ())


def test_a_die_and_its_housing_are_two_exponentials():
    axis, said = warmed(lambda t: 0.01 * np.exp(-t / 120) + 0.005 * np.exp(-t / 1200), 2, hours=2)
    assert covers(axis.trend.warm_up.time_constant_ci95, 120)
    assert covers(axis.trend.second_warm_up.time_constant_ci95, 1200)
    assert axis.coefficients[B].value == pytest.approx(2e-5, rel=0.3)
    assert not axis.coefficients[K].observable
    assert said['warm_up']['exponentials'] == 2
    assert said['warm_up']['steady_after_s'] > 120


def test_another_trend_is_one_entry_of_the_table(monkeypatch):
    def pulse(time):
        return 6e-4 * np.exp(-0.5 * ((time - 1500) / 100)**2)

    without, _ = warmed(pulse, 5)
    monkeypatch.setattr(kinds, 'TRENDS', (*kinds.TRENDS, kinds.TrendKind(
        'pulse', 0.05, lambda duration: duration * np.arange(1, 36) / 36,
        lambda at, _: (lambda time: np.exp(-0.5 * ((time - at) / 100)**2),))))
    beside, _ = warmed(pulse, 5)
    plain, _ = warmed(np.zeros_like, 5)
    assert not beside.coefficients[K].observable
    for axis, near in (without, False), (beside, True):
        assert (axis.coefficients[B].value == pytest.approx(
            plain.coefficients[B].value, rel=0.05)) is near


@pytest.mark.parametrize(('time', 'length'), [(50.0, 1024), (300.0, 1024), (300.0, 64)])
def test_what_a_warm_up_leaks_into_blocks_is_known_in_odd_and_in_even_coefficients(time, length):
    def mean(seconds):
        return np.exp(-seconds / time)

    step, index = 0.32, np.arange(20, length)
    blocks = mean((np.arange(8 * length) + 0.5) * step).reshape(8, length)
    power = np.mean(dct(blocks, norm='ortho')**2, axis=0)[index]
    section = SpectrumSection(1, length, 8, 20, length, np.zeros((1, length)))
    bins = bins_of([section], step)
    assert leaks([section], bins, step, 8 * length * step, mean) == pytest.approx(power, rel=0.03)


@pytest.mark.parametrize(('amplitude', 'time'), [(0.08, 281.0), (0.03, 129.0)])
def test_noise_beside_a_strong_warm_up_is_steady(amplitude, time):
    _, said = warmed(lambda t: amplitude * np.exp(-t / time), 10, hours=4.0)
    assert [*said] == ['warm_up']


@pytest.mark.slow
def test_the_coefficients_beside_warm_ups_are_as_good_as_without():
    inside = {N: [], B: [], K: [], 'amplitude': [], 'time': []}
    wrong = []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        amplitude, time = np.exp(generator.uniform(np.log([1e-3, 120]), np.log([0.1, 7200])))
        hours = generator.choice([1.0, 2.0, 4.0])
        axis, said = warmed(lambda t, a=amplitude, c=time: a * np.exp(-t / c), seed, hours=hours)
        # The mean of a record that is shorter only bends.
        bends = {'trend_or_walk'} if time > 3600 * hours else set()
        wrong.append(bool(set(said) - {'warm_up', 'short_recording'} - bends))
        for key in (N, B):
            inside[key].append(holds(axis.coefficients[key], MODEL[key]))
        inside[K].append(not axis.coefficients[K].observable)
        warm = axis.trend.warm_up
        if warm is not None:
            inside['amplitude'].append(covers(warm.ci95, amplitude))
            inside['time'].append(covers(warm.time_constant_ci95, time))
    assert np.mean(wrong) <= 0.05
    for key, each in inside.items():
        assert np.mean(each) > 0.85, key


def sine(phase):
    return np.sin(2 * np.pi * phase)


def heater(phase):
    """Heated for two fifths of a cycle, cooling for the rest, exponentially."""
    part = phase % 1
    return np.where(part < 0.4, 1 - np.exp(-part / 0.1),
                    np.exp(-(part - 0.4) / 0.15) * (1 - np.exp(-4))) * 2 - 1


def cycling(*means, seed=1, model=STEADY):
    return axes_of(taken_in(np.stack([simulate(model, len(TIME), RATE, seed + axis) + mean
                                      for axis, mean in enumerate(means)], axis=1)), RATE)


@pytest.mark.parametrize(('shape', 'size', 'cycles'),
                         [(sine, 0.1, 26.3), (heater, 0.01, 6.37), (heater, 0.1, 3.4)])
def test_no_random_walk_process_or_low_pass_is_made_of_a_strong_cycle(shape, size, cycles):
    period = HOURS * 3600 / cycles
    [found] = cycling(size * shape(TIME / period + 0.3))
    [without] = cycling(0 * TIME)
    assert found.trend.cycle_s == pytest.approx(period, rel=0.01)
    assert not found.coefficients[K].observable
    assert found.coefficients[K].upper95 < 2e-4
    for key in (N, B):
        assert found.coefficients[key].value == pytest.approx(without.coefficients[key].value,
                                                              rel=0.02)
    assert (found.gauss_markov, found.band_edge_hz, found.band_limit_s) == (None, None, None)
    assert found.goodness_of_fit.acceptable
    assert found.stationarity.steady


@pytest.mark.parametrize(('walk', 'size', 'period', 'error'), [
    (0.0, 3e-3, 1200, 0.05), (3e-4, 0.01, 700, 0.01), (0.0, 0.0, 1, None), (2e-4, 0.0, 1, None)])
def test_a_cycle_of_a_few_times_the_flicker_is_named_and_nothing_else(walk, size, period, error):
    axis, remarks = characterized(simulate({**STEADY, K: walk}, len(TIME), RATE, 3)
                                  + size * sine(TIME / period + 0.2), RATE)
    if size:
        assert remarks['slow_cycle'] == {'period_s': axis.trend.cycle_s}
        assert axis.trend.cycle_s == pytest.approx(period, rel=error)
    else:
        assert not remarks.keys() & {'warm_up', 'slow_cycle', 'trend_or_walk'}
        assert axis.trend.cycle_s is None
    assert axis.trend.warm_up is None
    assert axis.coefficients[K].observable == (walk > 0)
    assert holds(axis.coefficients[K], walk)


@pytest.mark.parametrize('shape', [sine, heater])
def test_a_vibration_beside_a_cycle_stays_and_the_harmonics_of_the_cycle_do_not(shape):
    # Whole periods of the vibration fit into one of the cycle, and some almost.
    time = TIME[:15_000]
    line = sum(3e-3 * np.sin(2 * np.pi * hertz * time) for hertz in (1.0, 2.0, 3.003))
    axis, _ = characterized(simulate({N: 1e-3, B: 2e-5}, len(time), RATE, 0)
                            + line + 0.01 * shape(time / 60), RATE)
    assert axis.trend.cycle_s == pytest.approx(60, rel=1e-3)
    assert sorted(round(tone.frequency_hz, 2) for tone in axis.tones) == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(('period', 'hours', 'seed'), [
    (60, 1.0, 3), (60, 1.0, 4), (60, 4.0, 1), (100, 2.0, 7)])
def test_no_cycle_or_warm_up_is_made_of_the_side_lobes_of_a_slow_line(period, hours, seed):
    axis, said = warmed(lambda t: 2e-4 * np.sin(2 * np.pi * t / period + 0.7 * seed), seed, 10.0,
                        hours, {N: 1e-4})
    assert ([tone.frequency_hz for tone in axis.tones], [*said]) == (
        [pytest.approx(1 / period, rel=2e-3)], [])


@pytest.mark.parametrize('seed', [2, 16, 27])
def test_chance_makes_no_cycle_of_a_short_record(seed):
    # Harmonics that are fitted to noise take some of it: what is left is no measure of the rest.
    assert characterized(simulate(STEADY, 3000, RATE, seed), RATE)[0].trend.cycle_s is None


def test_the_cycle_of_one_axis_is_looked_for_in_the_others():
    weak = 0.75e-3 * sine(TIME / 600)
    assert cycling(weak)[0].trend.cycle_s is None
    beside = cycling(weak, 0.01 * sine(TIME / 600), 0 * TIME)
    assert [one.trend.cycle_s is not None for one in beside] == [True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize(('walk', 'found'), [(0.0, 0.02), (1.8e-4, 1.0)])
def test_cycles_of_ten_times_the_flicker_and_more_give_no_random_walk_and_hide_none(walk, found):
    walks, covered, wrong = [], [], []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        cycles, size = np.exp(generator.uniform(np.log([3, 0.01]), np.log([30, 0.03])))
        shape = (sine, heater)[seed % 2]
        [one] = cycling(size * shape(TIME / (HOURS * 3600) * cycles), seed=seed,
                        model={**STEADY, K: walk})
        walks.append(one.coefficients[K].observable)
        covered.append(holds(one.coefficients[K], walk))
        wrong.append(one.gauss_markov is not None or one.band_limit_s is not None)
    assert np.mean(walks) <= found
    assert np.mean(covered) > 0.88
    assert np.mean(wrong) <= 0.05


FLICKER = 4.8e-5
CONSUMER = {N: 1.4e-4, B: FLICKER, K: 4.8e-6}
NOISES = {
    'white': {N: 1.4e-4}, 'flicker': {N: 1.4e-4, B: FLICKER},
    'weak walk': {N: 1.4e-4, K: 4.8e-6}, 'strong walk': {N: 1.4e-4, K: 20 * 4.8e-6},
    'all': CONSUMER,
    'process': {N: 1.4e-4, 'gauss_markov': {'sigma': 5 * FLICKER, 'correlation_time_s': 300.0}},
    'ramp': {N: 1.4e-4, B: FLICKER, 'rate_ramp': 5 * FLICKER / 3600}}


def test_a_ramp_is_as_uncertain_as_the_trends_beside_it():
    # A random walk passes for a trend, but other models without that trend are nearly as probable.
    ramp = 1e-6
    records = [simulate({N: 1e-3, B: 5e-5, K: 3e-6, 'rate_ramp': ramp}, 36_000, RATE, seed)
               for seed in (51, 98, 112, 119)]
    for axis, _ in results_of(taken_in(np.transpose(records)), RATE):
        found = axis.trend.ramp
        assert found is None or found.ci95[0] < ramp < found.ci95[1]


def test_no_bound_of_a_ramp_lies_above_the_measured_curve():
    # Beside a warm-up of the opposite sign, one a thousand times as steep fits as well.
    for axis in simulated(NOISES['flicker'], 3000, RATE, (362, 363, 370)):
        tau, adev = axis.curve.tau_s[-1], axis.curve.adev[-1]
        assert axis.coefficients['rate_ramp'].upper95 * tau / np.sqrt(2) < 50 * adev


@pytest.mark.parametrize('at', [3_000, 18_000, 33_000])
@pytest.mark.parametrize(('size', 'walk', 'most'), [
    (20 * FLICKER, 0.0, 3e-5), (-100 * FLICKER, 0.0, 1e-4), (10 * FLICKER, 1.6e-6, 3e-5)])
def test_a_step_is_found_with_its_place_and_size_and_bounds_the_random_walk(at, size, walk, most):
    samples = simulate({**NOISES['flicker'], K: walk}, 36_000, RATE, 1)
    samples[at:] += size
    axis, remarks = characterized(samples, RATE)
    assert remarks['bias_step'] == {'size': pytest.approx(size, abs=5 * FLICKER), 'unit': 'rad/s',
                                    'after_s': pytest.approx(at / RATE, abs=60)}
    found = axis.coefficients[K]
    assert (found.observable, found.observable_in_s) == (False, None)
    assert walk < found.upper95 < most


def test_the_segment_with_a_step_is_no_louder_than_the_others():
    step = 2e-3 * (np.arange(90_000) > 36_000)
    axis, said = characterized(simulate({N: 1e-4}, len(step), 25.0, 1) + step, 25.0)
    assert ([*said], axis.stationarity.steady) == (['bias_step'], True)


def test_noise_of_any_colour_has_no_step():
    records = [simulate(terms, 36_000, RATE, seed)
               for terms in NOISES.values() for seed in range(3)]
    assert not [remarks for _, remarks in results_of(taken_in(np.transpose(records)), RATE)
                if 'bias_step' in remarks]


def test_a_step_too_small_to_be_certain_is_seldom_a_random_walk():
    found = [characterized(simulate({N: 7.9e-5, B: 2.4e-5}, 144_000, 20.0, seed)
                           + 5 * 2.4e-5 * (np.arange(144_000) > 43_200), 20.0)
             for seed in range(8)]
    # One in ten; more than three of eight come once in 200 times.
    assert sum(axis.coefficients[K].observable for axis, _ in found) <= 3
    assert any('bias_step' in remarks for _, remarks in found)


def test_two_steps_too_small_to_be_certain_are_seldom_one_or_a_random_walk():
    at = np.arange(36_000)
    steps = 5 * FLICKER * (at > 13_000) - 7.5 * FLICKER * (at > 25_000)
    found = results_of(taken_in(np.transpose([
        simulate(NOISES['flicker'], 36_000, RATE, seed) + steps for seed in range(16)])), RATE)
    # 3 and 5 of 16; with one step in a model at most they were 11 and 13.
    assert sum(axis.coefficients[K].observable for axis, _ in found) <= 5
    assert sum('bias_step' in remarks for _, remarks in found) <= 7
    assert any('trend_or_walk' in remarks for _, remarks in found)


@pytest.mark.slow
def test_shares_of_steps_that_are_found_and_of_false_ones():
    def is_found(size, at, seed, noise='flicker'):
        step = size * (np.arange(72_000) >= at)
        return 'bias_step' in characterized(
            simulate(NOISES[noise], 72_000, RATE, seed) + step, RATE)[1]

    false = sum(is_found(0.0, 0, seed, noise) for noise in NOISES for seed in range(200))
    rng = np.random.default_rng(1)
    found = [np.mean([is_found(size * FLICKER, int(rng.uniform(0.03, 0.97) * 72_000), 1000 + seed)
                      for seed in range(40)]) for size in (10, 30)]
    assert false <= 3
    assert found[0] > 0.9
    assert found[1] > 0.95
