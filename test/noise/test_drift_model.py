# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The drift model: what it finds, what it must not invent, and where it is known."""

from characterized import shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.drift_model import drift_avar, fit_drift_model, MOST_PROCESSES
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import allan_variance, gauss_markov_avar, line_avar
from imu_allan.result import DriftModel, GaussMarkov, Tone
import numpy as np
import pytest
from scipy.signal import butter, lfilter

RATE = 50.0
HOUR = round(3600 * RATE)
N, B, K = 1e-3, 3e-4, 5e-5


def groups_of(samples, rate=RATE):
    return fit_axes(shown(samples), 1 / rate)[0].groups


def model_of(samples, rate=RATE):
    return fit_drift_model(groups_of(samples, rate), 1 / rate)


@pytest.mark.parametrize(('terms', 'hours', 'seed', 'tolerance'), [
    ({'rate_random_walk': K}, 3, 0, 0.15), ({'bias_instability': B}, 6, 4, 0.12),
    ({'gauss_markov': {'sigma': B, 'correlation_time_s': 100.0}}, 6, 1, 0.15)])
def test_slow_noise_comes_back_as_processes_of_its_allan_variance(terms, hours, seed, tolerance):
    model = model_of(simulate({'noise_density': N, **terms}, hours * HOUR, RATE, seed))
    assert model.noise_density == pytest.approx(N, rel=0.01)
    assert len(model.processes) >= 2 or 'bias_instability' not in terms
    tau = np.array([1.0, 10.0, 30.0, 100.0, 190.0, 600.0])
    known = {key: size for key, size in terms.items() if key != 'gauss_markov'}
    truth = allan_variance({'noise_density': N, **known}, tau)
    if not known:
        truth += gauss_markov_avar(B, 100.0, tau)
    np.testing.assert_allclose(np.sqrt(drift_avar(model, (), tau) / truth), 1, atol=tolerance)


def test_a_process_that_the_fit_has_found_keeps_the_long_end_down():
    """Uncertainty about a random walk that the data has already ruled out is worth nothing."""
    terms = {'noise_density': N, 'gauss_markov': {'sigma': N, 'correlation_time_s': 60.0}}
    groups = groups_of(simulate(terms, HOUR, RATE, seed=1))
    truth = gauss_markov_avar(N, 60.0, [600.0])[0]
    given, withheld = (drift_avar(fit_drift_model(groups, 1 / RATE, time), (), [600.0])[0] / truth
                       for time in (60.0, None))
    assert given < 3
    assert withheld > 2 * given


def test_processes_are_in_order_and_no_more_than_four():
    for seed in range(4):
        processes = model_of(simulate({'noise_density': N, 'bias_instability': 10 * B,
                                       'rate_random_walk': K}, HOUR, RATE, seed)).processes
        times = [process.correlation_time_s for process in processes]
        assert times == sorted(times)
        assert len(times) <= MOST_PROCESSES
        assert all(process.sigma > 0 for process in processes)


@pytest.mark.parametrize(('rate', 'edge_s'), [(RATE, 0.1), (10.0, 0.2)])
def test_horizons_reach_from_the_band_edge_which_follows_a_low_rate_to_a_third_of_the_record(
        rate, edge_s):
    model = model_of(simulate({'noise_density': N}, round(3600 * rate), rate), rate)
    assert model.from_s == pytest.approx(edge_s)
    assert model.to_s == pytest.approx(1200, rel=0.01)


def test_what_is_fast_and_fits_no_model_is_left_above_the_band_edge():
    samples = simulate({'noise_density': N, 'rate_random_walk': K}, HOUR + 1000, RATE)
    hump = lfilter(*butter(2, [7, 12], 'bandpass', fs=RATE),
                   simulate({'noise_density': 5 * N}, HOUR + 1000, RATE, seed=9))
    model = model_of((samples + hump)[1000:])
    assert model.from_s in (pytest.approx(0.2), pytest.approx(0.4))
    assert model.noise_density == pytest.approx(N, rel=0.05)


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e6])
def test_the_model_scales_with_the_signal(scale):
    samples = simulate({'noise_density': N, 'bias_instability': B}, HOUR // 4, RATE)
    plain, scaled = model_of(samples), model_of(samples * scale)
    tau = np.array([0.2, 1.0, 10.0, 100.0])
    np.testing.assert_allclose(drift_avar(scaled, (), tau), scale**2 * drift_avar(plain, (), tau),
                               rtol=1e-3)


def test_a_short_record_says_nothing_wild():
    """Sixteen seconds of white noise must not turn into a drift of many times the noise."""
    groups = groups_of(simulate({'noise_density': N}, 64, RATE))
    assert fit_drift_model(groups.below(float(groups.frequency[6])), 1 / RATE) is None
    for seed in range(10):
        model = model_of(simulate({'noise_density': N}, 800, RATE, seed))
        assert model.to_s < 6
        assert drift_avar(model, (), [5.0])[0] < 4 * N**2 / 5


def test_the_allan_variance_adds_noise_random_walk_processes_and_lines():
    model = DriftModel(2.0, 3.0, (GaussMarkov(0.5, 7.0),), 0.1, 100.0)
    tau = np.array([0.3, 5.0])
    np.testing.assert_allclose(
        drift_avar(model, (Tone(0.4, 0.2),), tau),
        4 / tau + 3 * tau + gauss_markov_avar(0.5, 7.0, tau) + line_avar(0.4, 0.2, tau))
