# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import axes_of, holds
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.interpolation import InterpolationSums, LAGS
from imu_allan.timeline.grid import interpolate
import numpy as np
import pytest
from repeated import combined
from scipy.fft import dct

SAMPLES = 1024


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


def shares_of(there):
    """Give the weight of every sample (columns) in every place (rows)."""
    eye = np.eye(SAMPLES)
    return np.hstack([with_interpolation(eye[:, at:at + 6], there) for at in range(0, SAMPLES, 6)])


@pytest.mark.parametrize(('pattern', 'step'), combined(
    [0.02, 0.4, 0.6, '110', '11100'], [1, 2, 16],
    everyday=[(0.02, 16), (0.4, 1), (0.6, 2), ('110', 1), ('11100', 16)]))
def test_white_noise_that_the_timeline_interpolates_has_the_power_that_is_worked_out(
        pattern, step):
    there = received(pattern)
    weights = shares_of(there)
    covariance = weights @ weights.T
    sums = InterpolationSums()
    sums.add(np.flatnonzero(~there).tolist(), SAMPLES)
    interpolation = sums.interpolation(float(np.mean(~there)))
    np.testing.assert_allclose(
        interpolation.covariance,
        [np.trace(covariance, lag) / (SAMPLES - lag) for lag in range(LAGS)], atol=1e-12)
    points = SAMPLES // step
    transform = dct(np.eye(points), axis=0, norm='ortho') @ np.kron(
        np.eye(points), np.full(step, step**-0.5))
    exact = ((transform @ covariance) * transform).sum(axis=1)
    given = interpolation.white_power(points, step)
    # Means are fitted up to a quarter of their rate.
    for band in np.array_split(np.arange(1, points if step == 1 else points // 2), 6):
        assert given[band].mean() == pytest.approx(exact[band].mean(), rel=0.03)


@pytest.mark.parametrize('pattern', [0.5, '1100'])
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
    found = [axis.coefficients['noise_density'] for axis in axes]
    for density in found:
        # With the first order of the losses alone it was 20 % too high.
        assert density.value == pytest.approx(1.0, rel=0.03)
        assert 0.9 * density.ci95[1] < density.ci95[0]
    # Of six intervals of 95 % two or more fail in 3 of 100 such tests.
    assert sum(holds(density, 1.0) for density in found) >= 5
