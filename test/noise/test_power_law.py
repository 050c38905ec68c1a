# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Slow noise with an exponent of its own, and what must not be taken for it."""

from characterized import characterized, holds, several
from imu_allan.characterization.axis import characterize
from imu_allan.noise.curve import edf
from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.simulate import flicker, simulate
from imu_allan.noise.terms import power_law_avar
from imu_allan.result import PowerLaw
import numpy as np
import pytest
from repeated import slow
from scipy.signal import butter, lfilter

DT = 0.01
DENSITY = 1e-3
HOUR = 360_000


def drawn(exponent, crossing_hz, samples, seed):
    """Draw white noise and a power law that is as strong at a frequency."""
    amplitude = DENSITY * (2 * np.pi * crossing_hz) ** (exponent / 2)
    rng = np.random.default_rng([seed, 77])
    return simulate({'noise_density': DENSITY}, samples, 1 / DT, seed) \
        + amplitude * DT ** ((exponent - 1) / 2) * flicker(samples, rng, exponent)


@pytest.mark.parametrize('exponent', [0.5, 1.3, 1.7])
def test_a_drawn_power_law_has_its_allan_variance(exponent):
    phase = np.concatenate(([0.0], np.cumsum(flicker(1 << 18, np.random.default_rng(1),
                                                     exponent))))
    for m in (1, 2, 32):
        second = phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m]
        expected = float(power_law_avar(1.0, exponent, m))
        assert np.mean(second**2) / (2 * m**2) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(('exponent', 'key'), [(1.0, 'bias_instability'),
                                               (2.0, 'rate_random_walk')])
def test_a_power_law_with_the_exponent_of_a_term_has_its_curve_and_spectrum(exponent, key):
    law = PowerLaw(exponent, (exponent, exponent), 1e-4 / (2 * np.pi)**exponent)
    for size in (1, 8, 1024):
        own = edf({'noise_density': 1e-3}, size, 1, 5000, DT, law)
        assert own == pytest.approx(edf({'noise_density': 1e-3, key: 1e-2}, size, 1, 5000, DT))
    model = FittedModel({'noise_density': 1e-3}, power_law=law)
    same = FittedModel({'noise_density': 1e-3, key: 1e-2})
    np.testing.assert_allclose(model.density([0.01, 1, 40], DT), same.density([0.01, 1, 40], DT))
    np.testing.assert_allclose(model.allan_variance([1, 99], DT), same.allan_variance([1, 99], DT))


@pytest.mark.parametrize(('exponent', 'crossing_hz'), [(0.5, 5), (0.7, 1), (0.7, 5), (1.3, 5)])
def test_strong_noise_of_another_exponent_leaves_the_noise_density_as_it_is(
        exponent, crossing_hz):
    axis = characterize(drawn(exponent, crossing_hz, HOUR, 1), 1 / DT)
    assert holds(axis.coefficients['noise_density'], DENSITY)
    assert np.diff(axis.coefficients['noise_density'].ci95) < 0.08 * DENSITY
    assert axis.power_law.exponent == pytest.approx(exponent, abs=0.04)
    assert axis.band_limit_s is None
    assert axis.goodness_of_fit.acceptable
    # That of the last octaves may lie anywhere.
    sure = np.array(axis.curve.edf) > 50
    np.testing.assert_allclose(np.array(axis.curve.model_adev)[sure],
                               np.array(axis.curve.adev)[sure], rtol=0.25)


@pytest.mark.parametrize(('time', 'seed'), [(0.05, 0), (0.1, 1)])
def test_white_noise_that_is_level_again_above_a_band_has_the_level_of_that_band(time, seed):
    # At the slow end the process is as strong as the white noise.
    process = {'sigma': DENSITY / np.sqrt(2 * time), 'correlation_time_s': time}
    terms = {'noise_density': DENSITY, 'gauss_markov': process}
    axis, words = characterized(simulate(terms, HOUR, 1 / DT, seed), 1 / DT)
    assert axis.goodness_of_fit.acceptable
    assert 'band_limited' in words
    density = axis.coefficients['noise_density']
    assert holds(density, np.sqrt(2) * DENSITY)
    assert density.value == pytest.approx(np.sqrt(2) * DENSITY, rel=0.03)


SLOW = {'bias_instability': 3e-4}
PROCESS = {'gauss_markov': {'sigma': 2e-3, 'correlation_time_s': 2.0}}


@pytest.mark.parametrize(('terms', 'low_pass'), [
    ({**SLOW, 'rate_random_walk': 6e-5}, None), (SLOW, butter(1, 20, fs=100)),
    (SLOW, ([0.967, 0.033], [1.0])), (PROCESS, None)],
    ids=['flicker and a random walk', 'low-pass of the first order',
         'low-pass that takes an eighth', 'correlated over seconds'])
def test_nothing_else_is_taken_for_a_power_law(terms, low_pass):
    record = simulate({'noise_density': DENSITY, **terms}, HOUR, 1 / DT, 6)
    if low_pass is not None:
        record = lfilter(*low_pass, record)[1000:]
    axis = characterize(record, 1 / DT)
    assert axis.power_law is None
    assert (axis.band_limit_s is not None) == (low_pass is not None)
    assert (axis.gauss_markov is not None) == ('gauss_markov' in terms)


@pytest.mark.parametrize(('rate_hz', 'duration_s', 'crossing_hz', 'share'), [
    (20.0, 300, 0.7, 0.26), slow(20.0, 1800, 0.7, 0.26), slow(20.0, 300, 0.1, 0.26),
    slow(50.0, 300, 5, 0.12), slow(100.0, 60, 2, 0.2), (100.0, 300, 5, 0.12)])
def test_flicker_that_reaches_into_a_recursive_mean_is_no_power_law(
        rate_hz, duration_s, crossing_hz, share):
    terms = {'noise_density': DENSITY,
             'bias_instability': DENSITY * np.sqrt(2 * np.pi * crossing_hz)}
    records = [simulate(terms, int(rate_hz * duration_s) + 500, rate_hz, seed)
               for seed in range(4)]
    filtered = lfilter([1 - share], [1, -share], records)[:, 500:]
    assert [axis.power_law for axis in several(filtered, rate_hz)] == [None] * 4
