# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The curve: published values, its degrees of freedom and its intervals."""

import allantools
from characterized import B, K, N, shown
from imu_allan.characterization.axis import characterize
from imu_allan.noise import chi_square, spectrum
from imu_allan.noise.allan_deviation import edf, interval, octaves
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.stats import chi2

DT = 0.25
SHAPES = {'quantization_noise': (1.1, spectrum.quantization),
          N: (1.3, spectrum.white), B: (1.5, spectrum.flicker),
          K: (0.9, spectrum.random_walk)}
"""Terms of about one size, and their spectra."""


def test_nbs14_and_stable32_to_the_printed_digits():
    points = octaves(shown([892, 809, 823, 798, 671, 644, 883, 903, 677]))
    assert points.size.tolist()[:2] == [1, 2]
    assert [f'{avar**0.5:.5f}' for avar in points.avar[:2, 0]] == ['91.22945', '85.95287']
    # The 1000 points of NIST SP 1065, a multiplicative congruential generator.
    numbers = [1234567890]
    while len(numbers) < 1000:
        numbers.append(16807 * numbers[-1] % 2147483647)
    points = octaves(shown(np.array(numbers) / 2147483647))
    assert points.size.tolist()[:8] == [1, 2, 4, 8, 16, 32, 64, 128]
    for avar, expected in zip(points.avar[:8, 0], (
            '0.2922319', '0.20102', '0.14479', '0.10570', '0.061915', '0.048082', '0.036237',
            '0.027674'), strict=True):
        assert f'{avar**0.5:.{len(expected) - 2}f}' == expected


@pytest.mark.parametrize(('key', 'expected'), [
    (N, [666.22, 570.20, 346.06, 181.88, 91.15, 44.63, 21.23, 9.55]),
    (B, [880.06, 566.01, 289.64, 144.34, 71.30, 34.75, 16.49, 7.38]),
    (K, [888.10, 461.82, 230.46, 114.47, 56.47, 27.47, 12.97, 5.73])])
def test_degrees_of_freedom_are_exact_to_a_thousandth(key, expected):
    sizes = 2 ** np.arange(8)
    found = [edf({key: 1.0}, int(m), 1, 1001 - 2 * int(m), 1.0) for m in sizes]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize('samples', [5000, 300_000])
def test_curve_equals_allantools_where_overlap_is_full_and_within_a_percent_beyond(samples):
    record = simulate({N: 1e-3, B: 5e-4, K: 1e-4}, samples, 100, seed=4)
    curve = characterize(record, 100).curve
    tau, expected, _, _ = allantools.oadev(record, rate=100, data_type='freq',
                                           taus=np.array(curve.tau_s))
    np.testing.assert_allclose(tau, curve.tau_s[:len(tau)])
    found = np.array(curve.adev[:len(tau)])
    full = 4 if samples == 300_000 else len(tau)
    np.testing.assert_allclose(found[:full], expected[:full], rtol=1e-9)
    np.testing.assert_allclose(found, expected, rtol=1e-2)


def edf_of_spectrum(keys, size, stride, count):
    """Degrees of freedom from the covariance that the spectrum gives the second differences."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    edges = np.linspace(0, .5, 401)
    half = np.diff(edges)[:, None] / 2
    nu = (edges[:-1, None] + half + half * nodes).ravel()
    weight = (half * weights).ravel()
    density = sum(value**2 * shape(nu, DT) for value, shape in map(SHAPES.get, keys))
    power = density * (4 * np.sin(np.pi * size * nu) ** 2 / (2 * np.sin(np.pi * nu))) ** 2
    lags = np.arange(count) * stride
    r = np.array([np.sum(2 * weight * power * np.cos(2 * np.pi * lag * nu)) for lag in lags])
    pairs = np.where(lags > 0, 2.0, 1.0) * (count - np.arange(count))
    return count**2 * r[0]**2 / np.sum(pairs * r**2)


@pytest.mark.parametrize('keys', [*((key,) for key in SHAPES), tuple(SHAPES)])
@pytest.mark.parametrize(('size', 'stride', 'count'), [
    (1, 1, 30), (8, 1, 60), (16, 2, 41), (4, 3, 50)])
def test_degrees_of_freedom_of_a_sum_of_terms_follow_from_its_spectrum(keys, size, stride, count):
    coefficients = {key: SHAPES[key][0] for key in keys}
    assert edf(coefficients, size, stride, count, DT) == pytest.approx(
        edf_of_spectrum(keys, size, stride, count), rel=1e-6)


@pytest.mark.parametrize('lengths', [(400,), (300, 9000), (9000, 300), (5000, 40, 5000),
                                     (10, 9000, 10), (40_000,)])
def test_a_point_is_of_all_second_differences_at_its_stride_of_every_run_that_holds_them(lengths):
    rng = np.random.default_rng(7)
    estimator, phases = Estimator(), []
    for length in lengths:
        samples = rng.standard_normal(length)
        estimator.start_run()
        for part in np.split(samples, [1, 4, 19, 36, 253]):
            estimator.update(part)
        phases.append(np.concatenate(([0.0], np.cumsum(samples))))
    points = octaves(estimator.finished())
    assert points.size.tolist() == [2**octave for octave in range(15)
                                    if 2 * 2**octave <= max(lengths)]
    assert (points.stride <= np.maximum(points.size // 8, 1)).all()
    for size, stride, count, avar in zip(points.size, points.stride, points.count,
                                         points.avar[:, 0], strict=True):
        differences = np.concatenate([
            (phase[2 * size:] - 2 * phase[size:-size] + phase[:-2 * size])[::stride]
            for phase in phases if len(phase) > 2 * size])
        assert count == len(differences)
        assert avar == pytest.approx(np.mean(differences**2) / (2 * size**2), rel=1e-9)


@pytest.mark.parametrize('dof', [0.7, 1.0, 3.0, 250.0, 1e6])
def test_chi_square_is_that_of_scipy_and_an_interval_holds_the_share_of_it_that_it_says(dof):
    for p in (1e-8, 0.025, 0.5, 0.975):
        np.testing.assert_allclose(chi_square.upper(p, dof), chi2.isf(p, dof), rtol=1e-9)
        np.testing.assert_allclose(chi_square.lower(p, dof), chi2.ppf(p, dof), rtol=1e-9)
    np.testing.assert_allclose(chi_square.survival(1.3 * dof, dof), chi2.sf(1.3 * dof, dof),
                               rtol=1e-9)
    powers, dofs = np.array([4.0, 9.0, 16.0]), dof * np.array([1.0, 1.5, 0.5])
    for level in (.68, .95):
        low, high = interval(powers, dofs, level)
        np.testing.assert_allclose(chi2.sf(dofs * powers / low**2, dofs), (1 - level) / 2)
        np.testing.assert_allclose(chi2.cdf(dofs * powers / high**2, dofs), (1 - level) / 2)
