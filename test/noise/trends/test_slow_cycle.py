# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A heater's cycle far above the noise leaves the coefficients as they are."""

from characterized import axes_of, characterized, holds, taken_in, together
from imu_allan.noise.simulate import simulate
from imu_allan.writers.included import trend_notes
import numpy as np
import pytest

N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
RATE, HOURS = 10.0, 2.0
TIME = np.arange(round(HOURS * 3600 * RATE)) / RATE
MODEL = {N: 1e-3, B: 1e-3}


def sine(phase):
    return np.sin(2 * np.pi * phase)


def heater(phase):
    """Heated for two fifths of a cycle, cooling for the rest, exponentially."""
    part = phase % 1
    return np.where(part < 0.4, 1 - np.exp(-part / 0.1),
                    np.exp(-(part - 0.4) / 0.15) * (1 - np.exp(-4))) * 2 - 1


def cycling(*means, seed=1, model=MODEL):
    """Characterize the axes of a sensor, each with a mean that moves."""
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
    assert found.gauss_markov is None
    assert found.band_edge_hz is found.band_limit_s is None
    assert found.goodness_of_fit.acceptable
    for key in (N, B):
        assert found.coefficients[key].value == pytest.approx(without.coefficients[key].value,
                                                              rel=0.02)
    assert found.stationarity.steady


@pytest.mark.parametrize(('walk', 'size'), [(0.0, 3e-3), (0.0, 0.0), (2e-4, 0.0)])
def test_a_cycle_of_a_few_times_the_flicker_is_named_and_where_the_mean_stands_or_walks_nothing_is(
        walk, size):
    axis, remarks = characterized(simulate({**MODEL, K: walk}, len(TIME), RATE, 3)
                                  + size * sine(TIME / 1200 + 0.2), RATE)
    if size:
        assert remarks['slow_cycle'] == {'period_s': axis.trend.cycle_s}
        assert axis.trend.cycle_s == pytest.approx(1200, rel=0.05)
    else:
        assert not remarks.keys() & {'warm_up', 'slow_cycle', 'trend_or_walk'}
        assert axis.trend.cycle_s is None
        assert trend_notes({'gyro_y': axis}) == []
    assert axis.trend.warm_up is None
    assert axis.coefficients[K].observable == (walk > 0)


@pytest.mark.parametrize(('shape', 'records'), [(sine, 2), (heater, 1)])
def test_a_vibration_beside_a_cycle_stays_and_the_harmonics_of_the_cycle_do_not(shape, records):
    # Whole periods of the vibration fit into one of the cycle, and some almost.
    time = TIME[:15_000]
    line = sum(3e-3 * np.sin(2 * np.pi * hertz * time) for hertz in (1.0, 2.0, 3.003))
    shaken = [simulate({N: 1e-3, B: 2e-5}, len(time), RATE, seed)
              + line + 0.01 * shape(time / 60 + 0.1 * seed) for seed in range(records)]
    axis, _ = characterized(shaken[0], RATE) if records == 1 else together(shaken, RATE)
    assert axis.trend.cycle_s == pytest.approx(60, rel=1e-3)
    assert sorted(round(tone.frequency_hz, 2) for tone in axis.tones) == [1.0, 2.0, 3.0]


@pytest.mark.parametrize('seed', [2, 16, 27])
def test_chance_makes_no_cycle_of_a_short_record(seed):
    # Harmonics that are fitted to noise take some of it: what is left is no measure of the rest.
    assert characterized(simulate(MODEL, 3000, RATE, seed), RATE)[0].trend.cycle_s is None


def test_a_random_walk_beside_a_cycle_is_found():
    walk = 3e-4
    [found] = cycling(0.01 * sine(TIME / 700), model={**MODEL, K: walk})
    assert found.trend.cycle_s == pytest.approx(700, rel=0.01)
    assert found.coefficients[K].observable
    assert holds(found.coefficients[K], walk)


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
                        model={**MODEL, K: walk})
        walks.append(one.coefficients[K].observable)
        covered.append(holds(one.coefficients[K], walk))
        wrong.append(one.gauss_markov is not None or one.band_limit_s is not None)
    assert np.mean(walks) <= found
    assert np.mean(covered) > 0.88
    assert np.mean(wrong) <= 0.05
