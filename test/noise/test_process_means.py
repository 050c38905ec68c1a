# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Moments of means over an interval, against the same formulas in fifty digits."""

from decimal import Decimal, localcontext

from imu_allan.noise.process_means import dct_power, mean_variance, on_mean, rest_of_mean
import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz


def moments(interval: float) -> tuple[float, float, float]:
    """Weight of the state in the mean, variance of the mean, and what the state does not tell."""
    with localcontext() as context:
        context.prec = 50
        x = Decimal(interval)
        weight = (1 - (-x).exp()) / x
        variance = 2 / x * (1 - weight)
        return float(weight), float(variance), float(variance - weight**2)


@pytest.mark.parametrize('interval', [1e-6, 5e-4, 0.99e-3, 1.01e-3, 0.1, 1.0, 30.0])
def test_moments_of_a_mean_are_exact_on_both_sides_of_the_series(interval):
    weight, variance, rest = moments(interval)
    assert float(on_mean(1.0, interval)) == pytest.approx(weight, rel=1e-12)
    assert float(mean_variance(1.0, interval)) == pytest.approx(variance, rel=1e-9)
    assert float(rest_of_mean(1.0, interval)) == pytest.approx(rest, rel=1e-8)


@pytest.mark.parametrize('length', [2, 3, 16, 60, 501])
@pytest.mark.parametrize('time', [0.01, 0.3, 8.0, 5000.0, 1e5])
@pytest.mark.parametrize('interval', [1.0, 20.0])
def test_the_power_of_a_cosine_in_means_is_that_of_their_covariance(length, time, interval):
    x = interval / time
    covariance = toeplitz(np.concatenate((
        [mean_variance(1.0, x)], on_mean(1.0, x) ** 2 * np.exp(-x * np.arange(length - 1)))))
    cosines = dct(np.eye(length), norm='ortho', axis=0)[1:]
    exact = np.einsum('ja,ab,jb->j', cosines, covariance, cosines)
    np.testing.assert_allclose(dct_power(time, interval, length), exact, rtol=1e-8)
