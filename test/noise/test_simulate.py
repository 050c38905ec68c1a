# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.simulate import MarkovBank, NoiseStream, simulate
from imu_allan.noise.terms import allan_variance, gauss_markov_avar
import numpy as np
import pytest
from whole_lines import refused

RATE = 100.0
SIZES = np.array([1, 2, 4, 8, 64])


def mean_allan_variance(draw, runs, sizes=SIZES):
    """Allan variance at `sizes`, averaged over records, and its standard error."""
    found = []
    for seed in range(runs):
        phase = np.concatenate(([0.0], np.cumsum(draw(seed)))) / RATE
        found.append([np.mean((phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m]) ** 2)
                      / (2 * (m / RATE) ** 2) for m in sizes])
    return np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(runs)


def streamed(coefficients, samples, seed):
    """Draw in parts of few and of many samples: no seam may show."""
    stream = NoiseStream(coefficients, RATE, seed)
    parts = [20] * 100
    return np.concatenate([stream.draw(n) for n in (*parts, samples - sum(parts))
                           if n > 0])[:samples]


HOW = [lambda model, samples, seed: simulate(model, samples, RATE, seed), streamed]


@pytest.mark.parametrize('key', ['quantization_noise', 'noise_density', 'bias_instability',
                                 'rate_random_walk'])
@pytest.mark.parametrize('how', HOW)
def test_samples_have_the_allan_variance_of_the_model_at_every_cluster_size(key, how):
    found, error = mean_allan_variance(lambda seed: how({key: 2.0}, 8000, seed), 40)
    expected = allan_variance({key: 2.0}, SIZES / RATE)
    assert np.all(np.abs(found - expected) < 4 * error)
    # At the shortest times, where the usual shortcuts are off by up to 44 %, 2 % are seen.
    np.testing.assert_allclose(found[:3], expected[:3], rtol=0.02)


@pytest.mark.parametrize('how', HOW)
def test_gauss_markov_process_has_its_allan_variance(how):
    model = {'gauss_markov': {'sigma': 2.0, 'correlation_time_s': 0.3}}
    found, error = mean_allan_variance(lambda seed: how(model, 8000, seed), 40)
    assert np.all(np.abs(found - gauss_markov_avar(2.0, 0.3, SIZES / RATE)) < 4 * error)


def test_same_seed_gives_the_same_record_and_another_seed_another():
    for model in ({'noise_density': 1.0, 'bias_instability': 1.0},
                  {'gauss_markov': {'sigma': 2.0, 'correlation_time_s': 0.3}}):
        for how in HOW:
            np.testing.assert_array_equal(how(model, 800, 3), how(model, 800, 3))
            assert np.any(how(model, 800, 3) != how(model, 800, 4))


@pytest.mark.parametrize(('model', 'samples', 'rate', 'line'), [
    ({'arw': 1.0}, 10, 100.0, "unknown noise term 'arw'; known: quantization_noise, "
     'noise_density, bias_instability, rate_random_walk, rate_ramp'),
    ({'gauss_markov': {'sigma': 1.0}}, 10, 100.0,
     'gauss_markov needs sigma and correlation_time_s, not sigma'),
    ({'noise_density': -1e-3}, 10, 100.0, 'noise_density must be zero or more, not -0.001'),
    ({'rate_random_walk': np.nan}, 10, 100.0, 'rate_random_walk must be zero or more, not nan'),
    ({}, 0, 100.0, 'samples must be at least 1, not 0'),
    ({}, 10, 0.0, 'sample_rate_hz must be positive, not 0.0')])
def test_impossible_requests_are_refused(model, samples, rate, line):
    with refused(line, ValueError):
        simulate(model, samples, rate)


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
