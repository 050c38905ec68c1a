# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The fitted model: its curve and its spectrum say the same."""

from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.simulate import simulate
from imu_allan.result import GaussMarkov
import numpy as np
import pytest
from scipy.signal import lfilter, welch

DT = 0.01
MODELS = {
    'terms': FittedModel({'quantization_noise': 2e-5, 'noise_density': 1e-3,
                          'bias_instability': 2e-3, 'rate_random_walk': 1e-3}),
    'low-pass': FittedModel({'noise_density': 1e-3, 'bias_instability': 1e-4}, 0.075),
    'processes': FittedModel({'noise_density': 1e-3}, None,
                             (GaussMarkov(1e-3, 0.5), GaussMarkov(3e-3, 20.0))),
}


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('m', [1, 3, 16, 100])
def test_allan_variance_is_the_integral_over_the_spectrum(name, m):
    # Fine enough for the random walk at its slow end: the weight falls with nu squared there.
    nu = np.geomspace(1e-7, 0.5, 400_000)
    weight = 4 * np.sin(np.pi * m * nu)**4 / (m * np.sin(np.pi * nu))**2
    integrand = MODELS[name].density(nu / DT, DT) / DT * weight
    integral = float(np.sum((integrand[1:] + integrand[:-1]) / 2 * np.diff(nu)))
    assert MODELS[name].allan_variance([m], DT)[0] == pytest.approx(integral, rel=2e-3)


def test_spectrum_of_a_low_passed_axis_lies_on_the_data():
    record = lfilter(np.ones(8) / 8, [1.0], simulate({'noise_density': 1e-3}, 400_000, 100, 5))
    frequency, one_sided = welch(record[8:], fs=100, nperseg=2000)
    model = FittedModel({'noise_density': 1e-3}, np.sqrt(63) / 100)
    # At the zeros of the filter the window of the estimate leaks more than there is.
    passed = np.abs(np.sin(np.pi * 8 * frequency / 100)) > 0.3
    ratio = one_sided[passed][1:] / 2 / model.density(frequency[passed][1:], 0.01)
    assert 0.8 < np.median(ratio) < 1.2
    assert 0.3 < ratio.min() < ratio.max() < 3
