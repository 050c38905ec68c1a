# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The noise density behind a low-pass is the level of the pass band."""

from characterized import holds, several
from imu_allan.noise.posterior.shapes import LOW_PASSES, Response
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
