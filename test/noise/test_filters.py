# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The noise density behind a low-pass is the level of the pass band."""

from characterized import characterized, holds
from imu_allan.noise.posterior.shapes import LOW_PASSES, tables
import numpy as np
import pytest
from scipy.signal import lfilter


def test_a_corner_in_the_band_of_means_of_samples_leaves_the_noise_density():
    """Means of samples fold nothing that a filter has taken out: N was 2 % too low."""
    found = []
    for seed in range(8):
        white = np.random.default_rng(seed).standard_normal(21_700)
        axis, _ = characterized(lfilter(np.full(8, 1 / 8), 1.0, white)[100:], 1.0)
        found.append(axis.coefficients['noise_density'])
    assert sum(holds(one, 1.0) for one in found) >= 7
    assert np.mean([one.value for one in found]) == pytest.approx(1.0, abs=0.012)


def test_means_of_filtered_samples_have_what_they_fold():
    """Power of means of 4 of what a mean of 8 leaves, by the autocovariance of the samples."""
    nu = np.linspace(0.02, 0.11, 30)
    covariance = np.convolve(np.full(8, 1 / 8), np.full(8, 1 / 8))
    means = np.convolve(covariance, np.convolve(np.full(4, 1 / 4), np.full(4, 1 / 4)))
    lags = np.arange(len(means)) - len(means) // 2
    kept = lags % 4 == 0
    # Of white noise without a filter, means of 4 have a quarter of the variance.
    power = 4 * (means[kept] * np.cos(2 * np.pi * nu[:, None] * lags[kept])).sum(axis=1)
    table = tables(nu, np.full(30, 4.0)).low_pass
    family = [shape.key for shape in LOW_PASSES].index('moving_mean')
    at = table.start[family] + np.arange(table.count[family])
    corner = table.first[family] + table.step[family] * np.arange(table.count[family])
    found = np.array([np.interp(np.log(1 / 8), corner, row) for row in table.rows[at].T])
    np.testing.assert_allclose(np.exp(found), power, rtol=0.02, atol=2e-3)
