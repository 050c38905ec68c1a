# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from itertools import pairwise

from hypothesis import given, settings, strategies as st
from imu_allan.characterization import characterize
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.signal_over_time import COLUMNS, Signal
import numpy as np
import pytest

ROWS = np.random.default_rng(1).normal([[5.0], [-3.0]], 1.0, (2, 9000))


def taken(rows, *cuts):
    signal = Signal(len(rows))
    for begin, end in pairwise([0, *cuts, rows.shape[1]]):
        signal.absorb(rows[:, begin:end])
    return signal


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, ROWS.shape[1]), max_size=20), st.integers(1, ROWS.shape[1]))
def test_columns_hold_the_mean_and_extremes_of_their_samples(cuts, length):
    columns = taken(ROWS[:, :length], *sorted(cut for cut in cuts if cut < length)).columns()
    for column, count in enumerate(columns.counts):
        part = ROWS[:, :length][:, column * columns.width:(column + 1) * columns.width]
        assert count == part.shape[1]
        assert columns.low[:, column].tolist() == part.min(axis=1).tolist()
        assert columns.high[:, column].tolist() == part.max(axis=1).tolist()
        assert columns.mean[:, column] == pytest.approx(part.mean(axis=1))
    assert len(columns.counts) * columns.width >= length
    assert len(columns.counts) <= COLUMNS


def test_missing_places_are_empty_columns():
    signal = taken(ROWS[:, :1000])
    signal.skip(1000)
    signal.absorb(ROWS[:, 1000:2000])
    columns = signal.columns()
    assert columns.width == 8
    assert columns.counts.tolist() == [8] * 125 + [0] * 125 + [8] * 125
    assert np.isnan(columns.mean[:, 125:250]).all()
    assert np.isfinite(columns.mean[:, 250:]).all()


def test_a_merged_record_stands_behind_the_first():
    one, other = Estimator(2), Estimator(2)
    one.update(ROWS.T[:700])
    other.update(ROWS.T[700:3000])
    one.merge(other)
    columns = one.finished().signal.columns()
    assert columns.counts.sum() == 3000
    behind = -(-700 // columns.width)
    assert columns.counts[behind] == columns.width
    assert columns.low[0, behind:].min() + one.reference[0] == pytest.approx(
        ROWS[0, 700:3000].min())
    assert (columns.mean * columns.counts).sum(axis=1) / 3000 + one.reference == pytest.approx(
        ROWS[:, :3000].mean(axis=1))


def test_the_signal_of_an_axis_stands_in_its_result():
    axis = characterize(ROWS[0], 100.0)
    assert axis.signal.step_s == pytest.approx(0.32)
    assert min(axis.signal.low) == pytest.approx(ROWS[0].min(), abs=1e-4)
    assert max(axis.signal.high) == pytest.approx(ROWS[0].max(), abs=1e-4)
    assert axis.signal.mean[7] == pytest.approx(ROWS[0, 7 * 32:8 * 32].mean(), abs=1e-4)


def test_the_signal_of_a_constant_axis_is_that_constant():
    axis = characterize(np.full(100, 0.1), 100.0)
    assert set(axis.signal.low) == set(axis.signal.mean) == set(axis.signal.high) == {0.1}
