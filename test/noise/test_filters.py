# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The noise density behind a low-pass is the level of the pass band."""

from characterized import holds, one_axis, several, taken_in
from imu_allan.block import NEIGHBOURS
from imu_allan.noise.posterior.shapes import LOW_PASSES, Response, tables
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz
from scipy.signal import butter, lfilter, sosfilt


def test_a_corner_in_the_band_of_means_of_samples_leaves_the_noise_density():
    """Means of samples fold nothing that a filter has taken out: N was 2 % too low."""
    white = [np.random.default_rng(seed).standard_normal(21_700) for seed in range(8)]
    found = [axis.coefficients['noise_density'] for axis in several(
        lfilter(np.full(8, 1 / 8), 1.0, white)[:, 100:], 1.0)]
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
    table = tables(nu, np.full(30, 4.0), np.full(30, 1e9), np.zeros(30)).low_pass
    family = [shape.key for shape in LOW_PASSES].index('moving_mean')
    at = table.start[family] + np.arange(table.count[family])
    corner = table.first[family] + table.step[family] * np.arange(table.count[family])
    found = np.array([np.interp(np.log(1 / 8), corner, row) for row in table.rows[at].T])
    np.testing.assert_allclose(np.exp(found), power, rtol=0.02, atol=2e-3)


@pytest.mark.parametrize(('key', 'error'), [
    ('recursive_mean', 0.02), ('butterworth_2', 0.03), ('gauss', 0.03), ('butterworth_4', 0.15)])
def test_blocks_hold_what_the_ends_leak_into_a_stop_band(key, error):
    """Power of the coefficients of blocks of 64, by the covariance of the samples."""
    [shape] = [shape for shape in LOW_PASSES if shape.key == key]
    corner, length = np.log(0.01), 64
    every = np.linspace(0, 0.5, 40_001)[1::2]
    spectrum = shape.power(every, corner)
    covariance = toeplitz([np.mean(spectrum * np.cos(2 * np.pi * every * lag))
                           for lag in range(length)])
    exact = np.diag(dct(dct(covariance, axis=0, norm='ortho'), axis=1, norm='ortho'))
    # Even and odd ones leak by turns.
    index = np.arange(20, 60, 2)
    pairs = (exact[index] + exact[index + 1]) / 2
    nu = (index + 0.5) / (2 * length)
    seen = Response(nu, np.ones(len(nu)), np.full(len(nu), float(length)), np.zeros(len(nu)))
    np.testing.assert_allclose(seen.of(shape.power, corner), pairs, rtol=error)


def test_the_curve_behind_a_slow_filter_bounds_no_flicker_that_is_there():
    """Over averaging times that the filter shortens it was down to a tenth of the truth."""
    flicker, slow = 1e-4, butter(2, 0.5, fs=100, output='sos')
    samples = [simulate({'noise_density': 1e-3, 'bias_instability': flicker}, 80_000, 100, seed)
               for seed in range(3)]
    for axis in several(sosfilt(slow, samples)[:, 20_000:], 100):
        found = axis.coefficients['bias_instability']
        assert not found.observable
        assert flicker < found.upper95 < 4 * flicker


def lost_and_filled(samples, share, rng):
    """Lose samples at random, and fill them in as the timeline does; return their places, too."""
    lost = rng.random(len(samples)) < share
    received, found = np.flatnonzero(~lost), samples.copy()
    for place in np.flatnonzero(lost):
        at = np.searchsorted(received, place)
        found[place] = samples[received[max(at - NEIGHBOURS, 0):at + NEIGHBOURS]].mean()
    return found, np.flatnonzero(lost)


@pytest.mark.parametrize(('share', 'corner'), [(0.03, 0.2), (0.1, 0.1)])
def test_lost_samples_behind_a_filter_leave_the_noise_density(share, corner):
    """Filled in by smooth neighbours they take little noise out: N was 1 to 4 % too low."""
    rng, found = np.random.default_rng(4), []
    for _ in range(6):
        noise = sosfilt(butter(2, 2 * corner, output='sos'), rng.standard_normal(181_000))[1000:]
        estimator = taken_in(*lost_and_filled(noise, share, rng))
        found.append(one_axis(estimator, 1.0)[0].coefficients['noise_density'])
    assert sum(holds(one, 1.0) for one in found) >= 5
    assert np.mean([one.value for one in found]) == pytest.approx(1.0, abs=0.004)


def test_the_last_band_ends_at_half_the_sample_rate():
    """A band that half the rate cuts short was taken for a whole eighth of an octave."""
    [shape] = [shape for shape in LOW_PASSES if shape.key == 'butterworth_1']
    nu, one = np.array([0.4985]), np.ones(1)
    passed = Response(nu, one, 4096 * one, 0 * one).of(shape.power, 0.3)
    np.testing.assert_allclose(passed, shape.power(nu, 0.3), rtol=0.5)
