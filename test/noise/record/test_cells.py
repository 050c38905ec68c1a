# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.record.cells import Cells, cells_of, coarser, joined, no_cells, RUN_SHIFT
from imu_allan.noise.record.gaps import filled
import numpy as np
import pytest

ROWS = np.arange(20.0).reshape(2, 10) ** 2


def same(one, other):
    np.testing.assert_array_equal(one.keys, other.keys)
    np.testing.assert_array_equal(one.sums, other.sums)
    np.testing.assert_array_equal(one.counts, other.counts)


def test_samples_are_summed_on_the_grid_of_their_run():
    cells = cells_of(ROWS, run=3, first=5, size=4)
    assert (cells.keys - (3 << RUN_SHIFT)).tolist() == [1, 2, 3]
    assert cells.counts.tolist() == [3, 4, 3]
    np.testing.assert_array_equal(cells.sums, [[row[:3].sum(), row[3:7].sum(), row[7:].sum()]
                                               for row in ROWS])


@pytest.mark.parametrize('cut', range(1, 10))
@pytest.mark.parametrize('size', [1, 4])
def test_parts_join_to_the_whole(cut, size):
    parts = [cells_of(ROWS[:, :cut], 2, 5, size), cells_of(ROWS[:, cut:], 2, 5 + cut, size)]
    same(joined(*parts), cells_of(ROWS, 2, 5, size))


def test_nothing_joins_to_anything():
    cells = cells_of(ROWS, 0, 0, 2)
    same(joined(no_cells(2), cells), cells)
    same(joined(cells, no_cells(2)), cells)


@pytest.mark.parametrize('first', [0, 3])
def test_coarser_cells_are_those_of_the_samples(first):
    same(coarser(cells_of(ROWS, 1, first, 2), 2), cells_of(ROWS, 1, first, 8))


def test_coarser_cells_do_not_mix_runs():
    both = joined(cells_of(ROWS, 0, 0, 2), cells_of(ROWS, 1, 10, 2))
    same(coarser(both, 1), joined(cells_of(ROWS, 0, 0, 4), cells_of(ROWS, 1, 10, 4)))


def test_nothing_made_coarser_is_nothing():
    assert len(coarser(no_cells(2), 3)) == 0


def test_missing_cells_of_a_straight_line_are_filled_on_it():
    keys = np.array([7, 8, 11, 12]) + (1 << RUN_SHIFT)
    cells = Cells(keys, np.array([[2.0, 6.0, 18.0, 22.0]]), np.full(4, 2))
    np.testing.assert_allclose(filled(cells), [[1, 3, 5, 7, 9, 11]])


def test_what_is_known_stays_and_what_is_missing_lies_on_straight_lines():
    rng = np.random.default_rng(2)
    keys = np.array([0, 1, 2, 5, 6, 7, 8, 9, 13, 14, 20])
    cells = Cells(keys, rng.standard_normal((2, len(keys))), np.arange(1, len(keys) + 1))
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


def test_a_whole_series_is_its_means():
    np.testing.assert_array_equal(filled(cells_of(ROWS, 0, 4, 2)),
                                  (ROWS[:, ::2] + ROWS[:, 1::2]) / 2)


def test_noise_of_the_nearest_cells_is_not_spread_over_a_gap():
    rng = np.random.default_rng(4)
    keys = np.delete(np.arange(400), np.arange(150, 250))
    fills = [filled(Cells(keys, rng.standard_normal((1, 300)), np.ones(300, np.int64)))
             for _ in range(200)]
    # On a line between the two nearest cells alone it would be 0.7.
    assert np.std([fill[0, 150:250].mean() for fill in fills]) < 0.1
