# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise import chi_square
import numpy as np
import pytest
from scipy.stats import bartlett, chi2


@pytest.mark.parametrize('dof', [0.7, 1.0, 3.0, 250.0, 1e6])
def test_agrees_with_scipy_stats(dof):
    for p in (1e-8, 0.025, 0.5, 0.975):
        np.testing.assert_allclose(chi_square.upper(p, dof), chi2.isf(p, dof), rtol=1e-9)
        np.testing.assert_allclose(chi_square.lower(p, dof), chi2.ppf(p, dof), rtol=1e-9)
    np.testing.assert_allclose(chi_square.survival(1.3 * dof, dof), chi2.sf(1.3 * dof, dof),
                               rtol=1e-9)


def test_equal_variances_are_asked_for_as_bartlett_does():
    rng = np.random.default_rng(3)
    groups = [rng.normal(scale=scale, size=size) for scale, size in ((1, 20), (1.2, 35), (0.7, 9))]
    dof = np.array([len(group) - 1.0 for group in groups])
    variances = np.array([group.var(ddof=1) for group in groups])
    found = chi_square.equal_variances(variances[:, None], dof[:, None])
    assert found == pytest.approx(bartlett(*groups).pvalue)


def test_bands_without_any_power_look_the_same_everywhere():
    dof = np.full((2, 2), 20.0)
    one = chi_square.equal_variances(np.array([[1.0], [3.0]]), dof[:, :1])
    assert chi_square.equal_variances(np.array([[1.0, 0.0], [3.0, 0.0]]), dof) == one
    assert chi_square.equal_variances(np.zeros((2, 2)), dof) == 1.0
