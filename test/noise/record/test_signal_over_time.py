# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import taken_in
from hypothesis import given, settings, strategies as st
from imu_allan.characterization import characterize
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.signal_over_time import COLUMNS
import numpy as np
import pytest

ROWS = np.random.default_rng(1).normal([[5.0], [-3.0]], 1.0, (2, 9000))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, ROWS.shape[1]), max_size=20), st.integers(1, ROWS.shape[1]))
def test_columns_hold_the_mean_and_extremes_of_their_samples(cuts, length):
    estimator, rows = Estimator(2), ROWS[:, :length]
    for part in np.split(rows.T, sorted(cut for cut in cuts if cut < length)):
        estimator.update(part)
    finished = estimator.finished()
    columns, level = finished.signal.columns(), finished.reference[:, None]
    parts = np.split(rows, np.arange(columns.width, length, columns.width), axis=1)
    assert len(columns.counts) == len(parts) <= COLUMNS
    assert columns.counts.tolist() == [part.shape[1] for part in parts]
    for found, of in ((columns.low, np.min), (columns.high, np.max), (columns.mean, np.mean)):
        np.testing.assert_allclose(found + level, np.transpose([of(part, axis=1)
                                                                for part in parts]), rtol=1e-12)


def test_missing_places_are_empty_columns_and_a_merged_record_stands_behind():
    one, other = Estimator(2), taken_in(ROWS.T[2000:4300])
    one.update(ROWS.T[:1000])
    one.skip(1000)
    one.update(ROWS.T[1000:2000])
    columns = one.finished().signal.columns()
    assert columns.width == 8
    assert columns.counts.tolist() == [8] * 125 + [0] * 125 + [8] * 125
    assert np.isnan(columns.mean[:, 125:250]).all()
    one.merge(other)
    columns = one.finished().signal.columns()
    there = columns.counts > 0
    assert columns.counts.sum() == 4300
    behind = -(-3000 // columns.width)
    assert columns.counts[behind] == columns.width
    assert columns.low[0, behind:].min() + one.reference[0] == pytest.approx(
        ROWS[0, 2000:4300].min())
    assert (columns.mean * columns.counts)[:, there].sum(axis=1) / 4300 + one.reference == (
        pytest.approx(ROWS[:, :4300].mean(axis=1)))


def test_the_signal_of_an_axis_stands_in_its_result():
    signal = characterize(ROWS[0], 100.0).signal
    assert signal.step_s == pytest.approx(0.32)
    parts = np.array_split(ROWS[0], np.arange(32, 9000, 32))
    for found, of in ((signal.low, np.min), (signal.high, np.max), (signal.mean, np.mean)):
        np.testing.assert_allclose(found, [of(part) for part in parts], atol=1e-4)
    constant = characterize(np.full(100, 0.1), 100.0).signal
    assert {*constant.low, *constant.mean, *constant.high} == {0.1}
