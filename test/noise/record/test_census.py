# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import shown
from imu_allan.noise.axis_fit import copies
from imu_allan.noise.record.census import OPPOSITE, SAME
import numpy as np

WHITE = np.random.default_rng(8).normal([0.1, -9.8, 3.0, 0.0], size=(30_000, 4))


def test_axes_that_repeat_another_are_found_whatever_the_sign():
    rows = WHITE.copy()
    rows[:, 2], rows[:, 3] = rows[:, 0], -rows[:, 1]
    assert copies(shown(rows)) == [(0, 2, SAME), (1, 3, OPPOSITE)]
    for rows in (WHITE, np.round(WHITE), np.round(WHITE, 1)):
        assert copies(shown(rows)) == []


def test_one_sample_that_differs_tells_axes_apart():
    for place in (0, 1, 12_345, len(WHITE) - 1):
        rows = WHITE.copy()
        rows[:, 2] = rows[:, 0]
        rows[place, 2] += 1e-9
        assert copies(shown(rows)) == []


def test_axes_without_noise_of_their_own_are_no_copies():
    still = np.zeros((1000, 3))
    # A knock moves coarse axes by a step at once.
    still[500] = 1.0
    assert copies(shown(still)) == []


def test_copies_stay_copies_in_several_records_and_some_of_the_axes():
    rows = WHITE.copy()
    rows[:, 3] = -rows[:, 1]
    merged = shown(rows[:9001])
    merged.merge(shown(rows[9001:]))
    assert copies(merged) == [(1, 3, OPPOSITE)]
    assert merged.select([2, 3]).census.copies() == []
    assert merged.select([3, 1]).census.copies() == [(1, 0, OPPOSITE)]
    assert merged.select([1, 3]).census.copies() == [(0, 1, OPPOSITE)]
    merged.merge(shown(WHITE))
    assert copies(merged) == []
