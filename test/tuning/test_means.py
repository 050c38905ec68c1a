# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Means over a second: the same however the samples came, and never more than some."""

from imu_allan.block import EvenBlock
from imu_allan.tuning import means as module
from imu_allan.tuning.means import Means
import numpy as np
import pytest

ROWS = np.random.default_rng(1).normal(size=(1050, 6))


def taken(*blocks, interval_ns=100000000.0):
    means = Means()
    means.take(blocks, interval_ns)
    return means


def test_the_blocks_they_came_in_make_no_difference():
    whole = taken(EvenBlock(ROWS, 0))
    batched = taken(*(EvenBlock(ROWS[i:i + 7], i) for i in range(0, 1050, 7)))
    np.testing.assert_allclose(batched.series.means, whole.series.means, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(whole.series.means[:, :100].T, ROWS[:1000].reshape(
        100, 10, 6).mean(axis=1), rtol=1e-12, atol=1e-15)
    assert whole.cell_s == 1.0


def test_gaps_and_runs_keep_their_places():
    means = taken(EvenBlock(ROWS[:100], 0), EvenBlock(ROWS[100:200], 150),
                  EvenBlock(ROWS[200:300], 0, new_run=True))
    places = means.series.keys & (2**44 - 1)
    assert places.tolist() == [*range(10), *range(15, 25), *range(10)]
    assert np.all(np.diff(means.series.keys) > 0)


def test_a_restart_voids_what_was_and_an_absent_axis_has_no_column():
    half = ROWS.copy()
    half[:, 3:] = np.nan
    means = taken(EvenBlock(ROWS, 0), EvenBlock(half[:100], 0, restart=True))
    assert means.columns.tolist() == [0, 1, 2]
    assert means.series.sums.shape == (3, 10)


@pytest.mark.parametrize('size', [1050, 100, 7])
def test_an_axis_that_comes_late_or_drops_out_leaves_a_gap(size):
    rows = ROWS.copy()
    rows[:200, 1] = rows[400:450, 1] = np.nan
    means = Means(['gyro_x', 'gyro_y'])
    means.take([EvenBlock(rows[i:i + size], i) for i in range(0, 1050, size)], 1e8)
    assert means.columns.tolist() == [0, 1]
    places = means.series.keys & (2**44 - 1)
    assert places.tolist() == [*range(20, 40), *range(45, 105)]
    assert len(np.unique(means.series.keys >> 44)) == 2
    np.testing.assert_allclose(means.series.means[:, 20], ROWS[450:460, :2].mean(axis=0))


def test_long_recordings_cost_no_more_memory(monkeypatch):
    monkeypatch.setattr(module, 'MOST', 64)
    means = taken(*(EvenBlock(ROWS[i:i + 50], i) for i in range(0, 1050, 50)))
    assert len(means.series) <= 64
    assert means.cell_s == 2.0
    np.testing.assert_allclose(means.series.means[:, 3], ROWS[60:80].mean(axis=0))
