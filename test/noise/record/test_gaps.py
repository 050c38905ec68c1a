# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.characterization.axis import axis_results
from imu_allan.noise.record.cells import Cells, RUN_SHIFT
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.gaps import filled, NO_GAPS, noise_through_gaps, without_islands
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from repeated import combined, slow
from scipy.fft import dct

SLOW = ('bias_instability', 'rate_random_walk')


def cells_with(counts: np.ndarray, rows: np.ndarray) -> Cells:
    """Give cells of white noise, of which those with a count of 0 are missing."""
    keys = np.flatnonzero(counts)
    return Cells(keys, rows[:, keys] * np.sqrt(counts[keys]), counts[keys])


@pytest.mark.parametrize('name', ['half full', 'periodic', 'random', 'one long'])
def test_white_noise_through_gaps_has_the_power_that_is_worked_out(name):
    rng = np.random.default_rng(1)
    span, size = 600, 8
    counts = np.full(span, size)
    if name == 'half full':
        counts[:] = rng.integers(4, 9, span)
    elif name == 'periodic':
        counts[np.arange(span) % 10 < 3] = 0
    elif name == 'random':
        counts[:] = np.where(rng.random(span) < 0.2, 0, rng.integers(4, 9, span))
    else:
        counts[200:330] = 0
    counts[[0, -1]] = size
    found = noise_through_gaps(cells_with(counts, np.zeros((1, span))), size)
    assert found.filled == pytest.approx(np.mean(counts == 0))
    power = np.zeros(span)
    draws = 0
    for _ in range(20):
        rows = rng.standard_normal((50, span)) * np.sqrt(size)
        power += (dct(filled(cells_with(counts, rows)), norm='ortho') ** 2).sum(axis=0)
        draws += 50
    power /= draws
    low = slice(1, 48)
    assert np.abs(power[low] / found.white[low] - 1).max() < 0.2
    bands = np.array_split(np.arange(48, span), 12)
    for band in bands:
        assert power[band].mean() == pytest.approx(found.white[band].mean(), rel=0.04)


@pytest.mark.parametrize('name', ['periodic', 'random', 'stops'])
def test_slow_noise_through_gaps_has_the_power_that_is_worked_out(name):
    rng = np.random.default_rng(1)
    span = 400
    there = np.ones(span, dtype=bool)
    if name == 'periodic':
        there[np.arange(span) % 20 < 9] = False
    elif name == 'random':
        there[rng.random(span) < 0.45] = False
    else:
        edges = np.cumsum(rng.integers(1, 8, span))
        for begin, end in zip(edges[0::2], edges[1::2], strict=False):
            there[begin:end] = False
    there[[0, -1]] = True
    keys = np.flatnonzero(there)
    gaps = noise_through_gaps(Cells(keys, np.zeros((1, len(keys))), np.ones(len(keys), np.int64)),
                              1)
    for key, expected in (('bias_instability', gaps.flicker), ('rate_random_walk', gaps.walk)):
        rows = np.stack([simulate({key: 1.0}, span, 1.0, seed) for seed in range(600)])
        seen = filled(Cells(keys, rows[:, keys], np.ones(len(keys), np.int64)))
        full, found = ((dct(some, norm='ortho')**2).mean(axis=0) for some in (rows, seen))
        for band in (slice(1, 8), slice(8, 24), slice(24, 64), slice(64, 200), slice(200, 400)):
            assert found[band].sum() == pytest.approx((full * expected)[band].sum(), rel=0.08)


@pytest.mark.thorough
def test_a_week_of_short_stops_knows_flicker_and_random_walk():
    rate, week = 2.0, 7 * 86400
    true = {'noise_density': 1e-4, 'bias_instability': 2e-5, 'rate_random_walk': 2e-6}
    rows = np.stack([simulate(true, round(week * rate), rate, seed) for seed in range(3)], axis=1)
    rng = np.random.default_rng(4)
    estimator, last = Estimator(3), 0
    while True:
        # Drives of 10 s to 10 min between stops of 5 s to 10 min.
        begin = last + round(rng.uniform(10, 600) * rate)
        end = begin + round(np.exp(rng.uniform(np.log(5), np.log(600))) * rate)
        if end > len(rows):
            break
        estimator.skip(begin - last)
        estimator.update(rows[begin:end])
        last = end
    for axis, _ in axis_results(estimator, rate, [AXES['gyro_x']] * 3):
        assert axis.gauss_markov is None
        for key, value in true.items():
            low, high = axis.coefficients[key].ci95
            assert low - (high - low) / 4 < value < high + (high - low) / 4
            assert (high - low) / value < 0.6


def test_full_cells_change_nothing():
    cells = cells_with(np.full(100, 4), np.zeros((1, 100)))
    assert noise_through_gaps(cells, 4) is NO_GAPS


def test_a_few_cells_alone_beyond_a_gap_are_left_out():
    keys = np.concatenate([[0, 1], np.arange(20, 60), [70], np.arange(72, 100)])
    keys = keys + (3 << RUN_SHIFT)
    cells = Cells(keys, np.zeros((1, len(keys))), np.ones(len(keys), np.int64))
    assert np.array_equal(without_islands(cells).keys - (3 << RUN_SHIFT),
                          np.concatenate([np.arange(20, 60), np.arange(72, 100)]))


@pytest.mark.thorough
@pytest.mark.parametrize(('samples', 'pattern'), [
    slow(20_000, (12, 8)), (20_000, (80, 20)), (6000, (60, 40))])
def test_repeated_gaps_invent_no_slow_term(samples, pattern):
    on, off = pattern
    rng = np.random.default_rng(2)
    false, axes = 0, 0
    for _ in range(2):
        estimator = Estimator(6)
        rows = rng.standard_normal((samples, 6))
        for first in range(0, samples, on + off):
            estimator.update(rows[first:first + on])
            estimator.skip(off)
        for axis, _ in axis_results(estimator, 100.0, [AXES['gyro_x']] * 6):
            false += any(axis.coefficients[key].observable for key in SLOW)
            axes += 1
            density = axis.coefficients['noise_density']
            assert density.value == pytest.approx(0.1, rel=0.06)
    assert false <= 0.1 * axes


@pytest.mark.parametrize(('alone', 'where'), combined(
    [1, 2, 5], ['start', 'end'], everyday=[(1, 'start'), (5, 'end')]))
def test_samples_alone_beyond_a_gap_invent_no_slow_term(alone, where):
    rng = np.random.default_rng(3)
    false = 0
    for _ in range(4):
        estimator = Estimator(6)
        parts = [rng.standard_normal((alone, 6)), rng.standard_normal((6000, 6))]
        first, second = parts if where == 'start' else parts[::-1]
        estimator.update(first)
        estimator.skip(40)
        estimator.update(second)
        false += sum(any(axis.coefficients[key].observable for key in SLOW)
                     for axis, _ in axis_results(estimator, 100.0, [AXES['gyro_x']] * 6))
    assert false <= 2
