# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Published values: NBS14, Stable32 and the exact degrees of freedom of Greenhall and Riley."""

import allantools
from characterized import shown
from imu_allan.characterization.axis import characterize
from imu_allan.noise.curve import edf, octaves
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

NBS14 = [892, 809, 823, 798, 671, 644, 883, 903, 677]


def nbs14_1000():
    """Return the 1000 points of NIST SP 1065, a multiplicative congruential generator."""
    n, points = 1234567890, []
    for _ in range(1000):
        points.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return np.array(points)


def overlapping(samples):
    """Overlapping Allan deviation by cluster size."""
    points = octaves(shown(samples))
    return dict(zip(points.size.tolist(), np.sqrt(points.avar[:, 0]), strict=True))


def test_nbs14_and_stable32_to_the_printed_digits():
    deviation = overlapping(NBS14)
    assert (f'{deviation[1]:.5f}', f'{deviation[2]:.5f}') == ('91.22945', '85.95287')
    deviation = overlapping(nbs14_1000())
    assert f'{deviation[1]:.7f}' == '0.2922319'
    for size, expected in ((1, '0.29223'), (2, '0.20102'), (4, '0.14479'), (8, '0.10570'),
                           (16, '0.061915'), (32, '0.048082'), (64, '0.036237'),
                           (128, '0.027674')):
        assert f'{deviation[size]:.{len(expected) - 2}f}' == expected


@pytest.mark.parametrize(('key', 'expected'), [
    ('noise_density', [666.22, 570.20, 346.06, 181.88, 91.15, 44.63, 21.23, 9.55]),
    ('bias_instability', [880.06, 566.01, 289.64, 144.34, 71.30, 34.75, 16.49, 7.38]),
    ('rate_random_walk', [888.10, 461.82, 230.46, 114.47, 56.47, 27.47, 12.97, 5.73])])
def test_degrees_of_freedom_are_exact_to_a_thousandth(key, expected):
    sizes = 2 ** np.arange(8)
    found = [edf({key: 1.0}, int(m), 1, 1001 - 2 * int(m), 1.0) for m in sizes]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize('samples', [5000, 300_000])
def test_curve_equals_allantools_where_overlap_is_full_and_within_a_percent_beyond(samples):
    record = simulate({'noise_density': 1e-3, 'bias_instability': 5e-4,
                       'rate_random_walk': 1e-4}, samples, 100, seed=4)
    curve = characterize(record, 100).curve
    tau, expected, _, _ = allantools.oadev(record, rate=100, data_type='freq',
                                           taus=np.array(curve.tau_s))
    np.testing.assert_allclose(tau, curve.tau_s[:len(tau)])
    found = np.array(curve.adev[:len(tau)])
    full = 4 if samples == 300_000 else len(tau)
    np.testing.assert_allclose(found[:full], expected[:full], rtol=1e-9)
    np.testing.assert_allclose(found, expected, rtol=1e-2)
