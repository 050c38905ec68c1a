# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A heater's cycle far above the noise leaves the coefficients as they are."""

from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.joint import joint_fits
from imu_allan.noise.simulate import simulate
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


def estimators(means, seed=1, model=MODEL):
    estimator = Estimator(len(means))
    estimator.update(np.stack([simulate(model, len(TIME), RATE, seed + axis) + mean
                               for axis, mean in enumerate(means)], axis=1))
    return estimator.finished()


def fitted(*means, seed=1, model=MODEL):
    return [axis.fit for axis in fit_axes(estimators(means, seed, model), 1 / RATE)]


@pytest.mark.parametrize(('shape', 'size', 'cycles'),
                         [(sine, 0.1, 26.3), (heater, 0.01, 6.37), (heater, 0.1, 3.4)])
def test_no_walk_process_or_low_pass_is_made_of_a_strong_cycle(shape, size, cycles):
    period = HOURS * 3600 / cycles
    [found] = fitted(size * shape(TIME / period + 0.3))
    [without] = fitted(0 * TIME)
    assert found.cycle_s == pytest.approx(period, rel=0.01)
    assert not found.estimates[K].observable
    assert found.estimates[K].upper < 2e-4
    assert found.gauss_markov is None
    assert found.edge_hz is found.window_s is None
    assert found.acceptable
    for key in (N, B):
        assert found.estimates[key].value == pytest.approx(without.estimates[key].value, rel=0.02)
    assert found.steady.steady


@pytest.mark.parametrize('records', [1, 2])
@pytest.mark.parametrize('shape', [sine, heater])
def test_a_vibration_beside_a_cycle_stays_and_the_harmonics_of_the_cycle_do_not(shape, records):
    # Whole periods of the vibration fit into one of the cycle, and some almost.
    found = []
    for seed in range(records):
        time = TIME[:15_000]
        line = sum(3e-3 * np.sin(2 * np.pi * hertz * time) for hertz in (1.0, 2.0, 3.003))
        estimator = Estimator(1)
        estimator.update(simulate({N: 1e-3, B: 2e-5}, len(time), RATE, seed)
                         + line + 0.01 * shape(time / 60 + 0.1 * seed))
        found.append(estimator.finished())
    [axis] = fit_axes(found[0], 1 / RATE) if records == 1 else joint_fits(found, 1 / RATE)
    assert axis.fit.cycle_s == pytest.approx(60, rel=1e-3)
    assert sorted(round(tone.frequency_hz, 2) for tone in axis.lines) == [1.0, 2.0, 3.0]


def test_a_walk_beside_a_cycle_is_found():
    walk = 3e-4
    [found] = fitted(0.01 * sine(TIME / 700), model={**MODEL, K: walk})
    assert found.cycle_s == pytest.approx(700, rel=0.01)
    assert found.estimates[K].low < walk < found.estimates[K].high


def test_a_cycle_and_a_warm_up_are_told_from_one_another():
    [found] = fitted(0.01 * sine(TIME / 500) + 1.0 * np.exp(-TIME / 900), seed=4)
    assert found.cycle_s == pytest.approx(500, rel=0.01)
    [warm] = found.warmings
    assert warm.shortest_s < 900 < warm.longest_s
    assert not found.estimates[K].observable
    assert found.edge_hz is None


def test_the_cycle_of_one_axis_is_looked_for_in_the_others():
    weak = 0.6e-3 * sine(TIME / 600)
    [alone] = fitted(weak)
    beside = fitted(weak, 0.01 * sine(TIME / 600), 0 * TIME)
    assert alone.cycle_s is None
    assert [one.cycle_s is not None for one in beside] == [True, True, False]


def test_a_cycle_of_several_records_has_one_period_and_a_size_in_each():
    records = [estimators([size * heater(TIME / 800 + phase)], seed)
               for seed, size, phase in ((1, 0.01, 0.2), (2, 0.03, 0.7))]
    [axis] = joint_fits(records, 1 / RATE)
    assert axis.fit.cycle_s == pytest.approx(800, rel=0.01)
    assert not axis.fit.estimates[K].observable


@pytest.mark.slow
@pytest.mark.parametrize(('walk', 'found'), [(0.0, 0.02), (1.8e-4, 1.0)])
def test_cycles_of_ten_times_the_flicker_and_more_give_no_walk_and_hide_none(walk, found):
    walks, covered, wrong = [], [], []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        cycles, size = np.exp(generator.uniform(np.log([3, 0.01]), np.log([30, 0.03])))
        shape = (sine, heater)[seed % 2]
        [one] = fitted(size * shape(TIME / (HOURS * 3600) * cycles), seed=seed,
                       model={**MODEL, K: walk})
        k = one.estimates[K]
        walks.append(k.observable)
        covered.append(k.low <= walk <= k.high if k.observable else k.upper >= walk)
        wrong.append(one.gauss_markov is not None or one.window_s is not None)
    assert np.mean(walks) <= found
    assert np.mean(covered) > 0.88
    assert np.mean(wrong) <= 0.05
