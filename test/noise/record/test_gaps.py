# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Samples that are missing: how they are filled in, and what that does to noise."""

import tracemalloc

from characterized import axes_of, B, holds, K, N
from imu_allan.noise.record.cells import Cells
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.gaps import filled, noise_through_gaps
from imu_allan.timeline.placing import interpolate
import numpy as np
import pytest
from repeated import slow
from scipy.fft import dct

SIZE = 8
SAMPLES = 1024


def cells_with(counts, rows):
    """Give cells of white noise, of which those with a count of 0 are missing."""
    keys = np.flatnonzero(counts)
    return Cells(keys, rows[:, keys] * np.sqrt(counts[keys]), counts[keys])


def test_what_is_known_stays_and_what_is_missing_lies_on_straight_lines():
    keys = np.array([0, 1, 2, 5, 6, 7, 8, 9, 13, 14, 20])
    cells = Cells(keys, np.random.default_rng(2).standard_normal((2, len(keys))),
                  np.arange(1, len(keys) + 1))
    grid = filled(cells)
    assert grid.shape == (2, 21)
    np.testing.assert_array_equal(grid[:, keys], cells.means)
    for begin, end in ((3, 5), (10, 13), (15, 20)):
        np.testing.assert_allclose(np.diff(grid[:, begin:end], 2), 0, atol=1e-12)
    # The line goes through the means of what is there of twice as many, four at least.
    for missing, left, right in (((3, 4), slice(0, 3), slice(3, 7)),
                                 ((10, 11, 12), slice(2, 8), slice(8, 11))):
        x0, x1 = keys[left].mean(), keys[right].mean()
        y0, y1 = cells.means[:, left].mean(axis=1), cells.means[:, right].mean(axis=1)
        for place in missing:
            np.testing.assert_allclose(grid[:, place], y0 + (y1 - y0) * (place - x0) / (x1 - x0))


@pytest.mark.parametrize('counts', [
    lambda rng, at: rng.integers(4, 9, len(at)),
    lambda _, at: np.where(at % 10 < 3, 0, SIZE),
    lambda rng, at: np.where(rng.random(len(at)) < 0.2, 0, rng.integers(4, 9, len(at))),
    lambda _, at: np.where((at >= 200) & (at < 330), 0, SIZE)],
    ids=['half full', 'periodic', 'random', 'one long'])
def test_white_noise_through_gaps_has_the_power_that_is_worked_out(counts):
    rng, span = np.random.default_rng(1), 600
    counts = counts(rng, np.arange(span))
    counts[[0, -1]] = SIZE
    found = noise_through_gaps(cells_with(counts, np.zeros((1, span))), SIZE)
    assert found.filled == pytest.approx(np.mean(counts == 0))
    rows = rng.standard_normal((1000, span)) * np.sqrt(SIZE)
    power = (dct(filled(cells_with(counts, rows)), norm='ortho')**2).mean(axis=0)
    np.testing.assert_allclose(power[1:48], found.white[1:48], rtol=0.2)
    for band in np.array_split(np.arange(48, span), 12):
        assert power[band].mean() == pytest.approx(found.white[band].mean(), rel=0.04)


# Of six axes in each record: with repeated gaps, and with samples alone beyond one.
@pytest.mark.parametrize(('runs', 'gap', 'records', 'most'), [
    slow([12] * 1000, 8, 2, 1), ([80] * 200, 20, 2, 1), ([60] * 60, 40, 2, 1),
    ([1, 6000], 40, 4, 2), ([6000, 5], 40, 4, 2),
    *(slow(runs, 40, 4, 2) for runs in ([2, 6000], [5, 6000], [6000, 1], [6000, 2]))])
def test_gaps_invent_no_slow_term(runs, gap, records, most):
    rng, false = np.random.default_rng(2), 0
    for _ in range(records):
        estimator = Estimator(6)
        for samples in runs:
            estimator.update(rng.standard_normal((samples + gap, 6))[:samples])
            estimator.skip(gap)
        for axis in axes_of(estimator, 100.0):
            assert axis.coefficients[N].value == pytest.approx(0.1, rel=0.06)
            false += any(axis.coefficients[key].observable for key in (B, K))
    assert false <= most


def received(pattern):
    """Tell which places have a sample: some in turn, or all but a share at random."""
    there = (np.random.default_rng(5).random(SAMPLES) >= pattern if isinstance(pattern, float)
             else np.resize([kept == '1' for kept in pattern], SAMPLES))
    there[[0, -1]] = True
    return there


def with_interpolation(rows, there):
    """Fill what is missing as the timeline does."""
    places = np.flatnonzero(there)
    behind = np.flatnonzero(np.diff(places) > 1) + 1
    means = interpolate(rows[there], behind, np.zeros(len(places), dtype=np.int64))
    full = rows.copy()
    full[~there] = np.repeat(means, np.diff(places)[behind - 1] - 1, axis=0)
    return full


@pytest.mark.parametrize('pattern', [0.5, '11110'])
def test_the_noise_density_of_a_record_with_interpolated_samples_is_right(pattern):
    rng, there = np.random.default_rng(3), received(pattern)
    estimator = Estimator(axes=6)
    for _ in range(20):
        rows = rng.standard_normal((SAMPLES, 6))
        estimator.update(with_interpolation(rows, there), np.flatnonzero(~there))
        estimator.skip(20)
    axes = axes_of(estimator, 1.0)
    # What the means take out of high and add to low frequencies does not pass for a low-pass.
    assert [axis.band_limit_s for axis in axes] == [None] * 6
    found = [axis.coefficients[N] for axis in axes]
    for density in found:
        assert density.value == pytest.approx(1.0, rel=0.03)
        assert 0.9 * density.ci95[1] < density.ci95[0]
    # Of six intervals of 95 % two or more fail in 3 of 100 such tests.
    assert sum(holds(density, 1.0) for density in found) >= 5


def test_one_missing_cell_costs_little_memory():
    counts = np.full(8192, SIZE)
    counts[4000] = 0
    cells = cells_with(counts, np.zeros((1, 8192)))
    tracemalloc.start()
    noise_through_gaps(cells, SIZE)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 70e6
