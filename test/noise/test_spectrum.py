# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise import spectrum
from imu_allan.noise.terms import allan_variance, gauss_markov_avar, power_law_avar
import numpy as np
import pytest
from scipy.fft import dct
from scipy.integrate import quad
from scipy.linalg import toeplitz

DT = 0.01
COLUMNS = {'quantization_noise': spectrum.quantization, 'noise_density': spectrum.white,
           'bias_instability': spectrum.flicker, 'rate_random_walk': spectrum.random_walk}


def allan_variance_of(density, size):
    """Integrate a spectrum of averaged samples against the Allan window."""
    def integrand(nu):
        window = 2 * np.sin(np.pi * size * nu) ** 4 / (size * np.sin(np.pi * nu)) ** 2
        return float(density(np.array([nu]))[0]) * window
    return 2 * quad(integrand, 1e-12, 0.5, limit=800)[0]


@pytest.mark.parametrize('key', COLUMNS)
@pytest.mark.parametrize('size', [1, 2, 3, 16])
def test_spectrum_gives_the_ieee_formula_at_every_cluster_size(key, size):
    found = allan_variance_of(lambda nu: COLUMNS[key](nu, DT), size)
    assert found == pytest.approx(float(allan_variance({key: 1.0}, size * DT)), rel=1e-9)


@pytest.mark.parametrize('size', [1, 4, 64])
def test_spectra_of_processes_and_power_laws_give_their_allan_variance(size):
    # On both sides of the series, too.
    for time in (0.02, 0.3, 9.0, 11.0, 40.0):
        found = allan_variance_of(lambda nu, time=time: spectrum.gauss_markov(nu, DT, time), size)
        assert found == pytest.approx(float(gauss_markov_avar(1.0, time, size * DT)), rel=1e-5)
    for exponent in (0.4, 0.7, 1.0, 1.3, 1.8):
        found = allan_variance_of(lambda nu, of=exponent: spectrum.power_law(nu, DT, of), size)
        assert found == pytest.approx(float(power_law_avar(1.0, exponent, size * DT)), rel=1e-6)


def test_gauss_markov_deviation_peaks_where_the_standard_says():
    tau = np.geomspace(0.1, 100, 20001)
    deviation = np.sqrt(gauss_markov_avar(1.0, 1.0, tau))
    assert tau[deviation.argmax()] == pytest.approx(1.8926, abs=1e-3)
    assert deviation.max() == pytest.approx(0.6174, abs=1e-4)


@pytest.mark.parametrize('n', [16, 257, 4096])
def test_ramp_transform_is_that_of_a_ramp(n):
    expected = dct(np.arange(n) * DT, norm='ortho')[1:]
    np.testing.assert_allclose(spectrum.ramp_dct(n, DT), expected, atol=1e-9 * abs(expected[0]))


def test_flicker_transform_factor_is_the_mean_power_of_the_transform():
    # Phase t^2 ln t is the generalised covariance of flicker noise: it holds for sums of weight
    # zero, which every coefficient but the first is.
    n = 2048
    lag = np.arange(n + 1.0)
    phase = lag**2 * np.log(np.maximum(lag, 1)) / (2 * np.pi) * 2
    covariance = np.empty(n)
    covariance[1:] = (2 * phase[1:-1] - phase[2:] - phase[:-2]) / 2
    covariance[0] = (2 * phase[0] - 2 * phase[1]) / 2
    rows = np.cos(np.pi * np.outer(np.arange(1, 21), np.arange(n) + .5) / n) * np.sqrt(2 / n)
    power = np.einsum('ij,ij->i', rows @ toeplitz(covariance), rows)
    expected = power / spectrum.flicker(np.arange(1, 21) / (2 * n), DT)
    np.testing.assert_allclose(spectrum.flicker_dct_factor(np.arange(1, 21)), expected, rtol=2e-3)
    factor = spectrum.flicker_dct_factor(np.arange(1, 200))
    assert np.all(np.diff(factor) > 0)
    assert factor[-1] == pytest.approx(1 - 2 / (np.pi**2 * 199))


@pytest.mark.parametrize('a', [1e-6, 3e-5, 9.9e-5, 1.01e-4, 1e-3, 0.1, 10.0])
def test_gauss_markov_spectrum_is_exact_on_both_sides_of_its_series(a):
    # In extended precision the closed form does not cancel as far.
    nu = np.array([1e-3, 0.1, 0.5])
    wide = np.longdouble(a)
    decay = -np.expm1(-wide)
    z = np.exp(2j * np.pi * nu.astype(np.longdouble))
    exact = (2 / wide**2 * (wide - decay)
             + 2 * (decay / wide) ** 2 * np.real(z / (1 - np.exp(-wide) * z)))
    np.testing.assert_allclose(spectrum.gauss_markov(nu, DT, DT / a), exact.astype(float),
                               rtol=1e-6)


@pytest.mark.parametrize('key', COLUMNS)
def test_model_is_self_similar_under_averaging(key):
    # The mean of m samples has the aliased, sinc-weighted spectrum of the samples.
    m, nu = 4, np.array([0.03, 0.2, 0.41])
    total = np.zeros(3)
    for k in range(m):
        fine = (nu + k) / m
        fine = np.where(fine > 0.5, 1 - fine, fine)
        weight = (np.sin(np.pi * nu) / (m * np.sin(np.pi * (nu + k) / m))) ** 2
        total += weight * COLUMNS[key](fine, DT) / m
    np.testing.assert_allclose(total, COLUMNS[key](nu, m * DT), rtol=1e-9)
