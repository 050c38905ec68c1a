# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated noise, spectra and Allan variances: each says the same of the same noise."""

from decimal import Decimal, localcontext

from imu_allan.noise import spectrum, terms
from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean, rest_of_mean
from imu_allan.noise.simulate import MarkovBank, NoiseStream, simulate
from imu_allan.result import GaussMarkov
import numpy as np
import pytest
from scipy.fft import dct
from scipy.integrate import quad
from scipy.linalg import toeplitz
from whole_lines import refused

DT = 0.01
COLUMNS = {'quantization_noise': spectrum.quantization, 'noise_density': spectrum.white,
           'bias_instability': spectrum.flicker, 'rate_random_walk': spectrum.random_walk}
RATE = 100.0
SIZES = np.array([1, 2, 4, 8, 64])


def allan_variance_of(density, size, *parameter):
    """Integrate a spectrum of averaged samples against the Allan window."""
    def integrand(nu):
        window = 2 * np.sin(np.pi * size * nu) ** 4 / (size * np.sin(np.pi * nu)) ** 2
        return float(density(np.array([nu]), DT, *parameter)[0]) * window
    return 2 * quad(integrand, 1e-12, 0.5, limit=800)[0]


@pytest.mark.parametrize('size', [1, 2, 3, 4, 16, 64])
def test_spectra_of_terms_processes_and_power_laws_give_their_allan_variance(size):
    for key, density in COLUMNS.items():
        assert allan_variance_of(density, size) == pytest.approx(
            float(terms.allan_variance({key: 1.0}, size * DT)), rel=1e-9), key
    # On both sides of the series, too.
    for time in (0.02, 0.3, 9.0, 11.0, 40.0):
        assert allan_variance_of(spectrum.gauss_markov, size, time) == pytest.approx(
            float(terms.gauss_markov_avar(1.0, time, size * DT)), rel=1e-5), time
    for exponent in (0.4, 0.7, 1.0, 1.3, 1.8):
        assert allan_variance_of(spectrum.power_law, size, exponent) == pytest.approx(
            float(terms.power_law_avar(1.0, exponent, size * DT)), rel=1e-6), exponent


def test_gauss_markov_deviation_peaks_where_the_standard_says():
    tau = np.geomspace(0.1, 100, 20001)
    deviation = np.sqrt(terms.gauss_markov_avar(1.0, 1.0, tau))
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


def test_a_term_has_the_name_that_its_sensor_gives_it_and_its_coefficient_where_it_is_read():
    names = [terms.TERMS['noise_density'].name(quantity) for quantity in terms.Quantity]
    assert names == ['angle random walk', 'velocity random walk']
    for term in terms.TERMS.values():
        if term.read_at is not None:
            assert term.adev(3.0, term.read_at) == pytest.approx(3.0)
    assert terms.TERMS['bias_instability'].adev(1.0, 7.0) == pytest.approx(0.66428, abs=1e-5)


@pytest.mark.parametrize(('key', 'expected'), [
    ('quantization_noise', 3 * 4 / 25), ('noise_density', 4 / 5),
    ('bias_instability', 2 * np.log(2) / np.pi * 4), ('rate_random_walk', 4 * 5 / 3),
    ('rate_ramp', 4 * 25 / 2)])
def test_allan_variance_is_the_formula_of_the_standard(key, expected):
    for sign in (1, -1):
        assert terms.allan_variance({key: sign * 2.0}, 5.0) == pytest.approx(expected)
        assert terms.allan_variance({key: sign * 2.0, 'noise_density': 1.0}, 5.0) == pytest.approx(
            expected + (0.2 if key != 'noise_density' else 0.2 - expected))


@pytest.mark.parametrize('share', [1.0, 0.5, 0.2, 0.05])
@pytest.mark.parametrize('size', [1, 2, 7, 8, 9, 16, 300])
def test_allan_variance_behind_a_exponential_average_is_that_of_its_weights(share, size):
    # The difference of two cluster means is a weighted sum of independent samples.
    dt, nu = 0.25, np.geomspace(1e-4, 0.5, 200)
    difference = np.concatenate((np.full(size, -1.0), np.full(size, 1.0))) / size
    weights = np.convolve(difference, share * (1 - share) ** np.arange(400))
    passed = share**2 / (share**2 + 4 * (1 - share) * np.sin(np.pi * nu)**2)
    found = FittedModel({'noise_density': 3.0}, (nu / dt, passed)).allan_variance([size], dt)
    assert found == pytest.approx(0.5 * weights @ weights * 3.0**2 / dt, rel=0.02)


@pytest.mark.parametrize('model', [
    FittedModel({'quantization_noise': 2e-5, 'noise_density': 1e-3, 'bias_instability': 2e-3,
                 'rate_random_walk': 1e-3}),
    FittedModel({'noise_density': 1e-3, 'bias_instability': 1e-4}, ((1.0, 40.0), (1.0, 0.1))),
    FittedModel({'noise_density': 1e-3}, None, (GaussMarkov(1e-3, 0.5), GaussMarkov(3e-3, 20.0)))],
    ids=['terms', 'low-pass', 'processes'])
@pytest.mark.parametrize('m', [1, 3, 16, 100])
def test_allan_variance_is_the_integral_over_the_spectrum(model, m):
    integral = allan_variance_of(lambda nu, dt: model.density(nu / dt, dt) / dt, m)
    assert model.allan_variance([m], DT)[0] == pytest.approx(integral, rel=2e-3)


@pytest.mark.parametrize('interval', [1e-6, 5e-4, 0.99e-3, 1.01e-3, 0.1, 1.0, 30.0])
def test_moments_of_a_mean_are_exact_on_both_sides_of_the_series(interval):
    with localcontext() as context:
        context.prec = 50
        x = Decimal(interval)
        weight = (1 - (-x).exp()) / x
        variance = 2 / x * (1 - weight)
        rest = variance - weight**2
    assert float(on_mean(1.0, interval)) == pytest.approx(float(weight), rel=1e-12)
    assert float(mean_variance(1.0, interval)) == pytest.approx(float(variance), rel=1e-9)
    # What the state does not tell.
    assert float(rest_of_mean(1.0, interval)) == pytest.approx(float(rest), rel=1e-8)


def mean_allan_variance(draw, runs, sizes=SIZES):
    """Allan variance at `sizes`, averaged over records, and its standard error."""
    found = []
    for seed in range(runs):
        phase = np.concatenate(([0.0], np.cumsum(draw(seed)))) / RATE
        found.append([np.mean((phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m]) ** 2)
                      / (2 * (m / RATE) ** 2) for m in sizes])
    return np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(runs)


def streamed(model, samples, seed):
    """Draw in parts of few and of many samples: no seam may show."""
    stream = NoiseStream(model, RATE, seed)
    return np.concatenate([stream.draw(n) for n in (*[20] * 100, samples - 2000)])


HOW = [lambda model, samples, seed: simulate(model, samples, RATE, seed), streamed]
PROCESS = {'gauss_markov': {'sigma': 2.0, 'correlation_time_s': 0.3}}


@pytest.mark.parametrize('model', [*({key: 2.0} for key in COLUMNS), PROCESS],
                         ids=lambda model: next(iter(model)))
@pytest.mark.parametrize('how', HOW)
def test_samples_have_the_allan_variance_of_the_model_at_every_cluster_size(model, how):
    found, error = mean_allan_variance(lambda seed: how(model, 8000, seed), 40)
    expected = (terms.gauss_markov_avar(2.0, 0.3, SIZES / RATE) if model is PROCESS
                else terms.allan_variance(model, SIZES / RATE))
    assert np.all(np.abs(found - expected) < 4 * error)
    # At the shortest times, where the usual shortcuts are off by up to 44 %, 2 % are seen.
    np.testing.assert_allclose(found[:3], expected[:3], rtol=0.02)


@pytest.mark.parametrize('how', HOW)
def test_same_seed_gives_the_same_record_and_another_seed_another(how):
    for model in ({'noise_density': 1.0, 'bias_instability': 1.0}, PROCESS):
        np.testing.assert_array_equal(how(model, 2100, 3), how(model, 2100, 3))
        assert np.any(how(model, 2100, 3) != how(model, 2100, 4))


@pytest.mark.parametrize(('model', 'samples', 'rate', 'line'), [
    ({'arw': 1.0}, 10, 100.0, "unknown noise term 'arw'; known: quantization_noise, "
     'noise_density, bias_instability, rate_random_walk, rate_ramp'),
    ({'gauss_markov': {'sigma': 1.0}}, 10, 100.0,
     "gauss_markov needs sigma and correlation_time_s, not {'sigma': 1.0}"),
    ({'gauss_markov': 5}, 10, 100.0, 'gauss_markov needs sigma and correlation_time_s, not 5'),
    ({'gauss_markov': {'sigma': -1.0, 'correlation_time_s': 1.0}}, 10, 100.0,
     'sigma must be a number in SI units, zero or more, not -1'),
    ({'gauss_markov': {'sigma': 1.0, 'correlation_time_s': 0.0}}, 10, 100.0,
     'correlation_time_s must be a number from 1e-30 to 1e+30, not 0'),
    *(({'mean': mean}, 10, 100.0, f'mean must be a number in SI units, not {mean}')
      for mean in (np.nan, None)),
    ({'noise_density': -1e-3}, 10, 100.0,
     'noise_density must be a number in SI units, zero or more, not -0.001'),
    ({'noise_density': '1 deg/sqrt(h)'}, 10, 100.0, 'noise_density must be a number in SI units, '
     "zero or more, not '1 deg/sqrt(h)'"),
    ({'rate_random_walk': np.nan}, 10, 100.0,
     'rate_random_walk must be a number in SI units, zero or more, not nan'),
    *(({}, samples, 100.0, f'samples must be a whole number, 1 or above, not {samples}')
      for samples in (0, 10.5, None)),
    ({}, 10, 0.0, 'sample_rate_hz must be a number from 1e-30 to 1e+30, not 0')])
def test_impossible_requests_are_refused(model, samples, rate, line):
    with refused(line, ValueError):
        simulate(model, samples, rate)


def test_arguments_of_a_wrong_type_are_refused():
    with refused('coefficients must be a mapping, not float', TypeError):
        simulate(1e-3, 10, 100.0)
    with refused('seed must be a whole number, 0 or above, not 1.5'):
        simulate({}, 10, 100.0, 1.5)


@pytest.mark.thorough
def test_streamed_flicker_is_as_flat_at_long_times():
    sizes = 2 ** np.array([8, 10, 12, 14])
    found, _ = mean_allan_variance(lambda seed: streamed({'bias_instability': 1.0}, 200_000, seed),
                                   12, sizes)
    np.testing.assert_allclose(found, 2 * np.log(2) / np.pi, rtol=0.35)
    np.testing.assert_allclose(found[:2], 2 * np.log(2) / np.pi, rtol=0.05)


@pytest.mark.parametrize('interval', [1e-4, 5e-4, 9.99e-4, 1.001e-3, 0.1, 10.0])
def test_end_and_mean_of_a_gauss_markov_process_have_their_joint_law(interval):
    dt = 0.5
    bank = MarkovBank(np.array([dt / interval]), np.array([3.0]), dt, np.random.default_rng(0))
    a = np.longdouble(interval)
    decay = np.exp(-a)
    # Of a process that stands at s: mean s (1 - decay) / a, end s decay, and what comes on top.
    mean_var = (2 * a - 3 + 4 * decay - decay**2) / a**2
    cross = (1 - decay)**2 / a
    assert bank.decay[0] == pytest.approx(float(decay))
    assert bank.gain[0] == pytest.approx(float(3 * (1 - decay) / a), rel=1e-9)
    assert bank.end[0]**2 == pytest.approx(float(1 - decay**2), rel=1e-9)
    assert bank.mean_on_end[0] * bank.end[0] == pytest.approx(float(3 * cross), rel=1e-6)
    assert bank.mean_on_end[0]**2 + bank.mean_rest[0]**2 == pytest.approx(
        float(9 * mean_var), rel=2e-6)
