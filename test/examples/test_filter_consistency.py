# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The navigation filter of examples/filter_consistency: right where its numbers are."""

import importlib.util
from pathlib import Path
import sys

import imu_allan
import numpy as np
import pytest


def loaded(name):
    path = Path(__file__).parents[2] / 'examples' / 'filter_consistency' / f'{name}.py'
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def consistency():
    return loaded('consistency')


def test_the_filter_is_consistent_on_noise_that_it_is_given(consistency):
    n, k = np.array([1e-4] * 3 + [1e-3] * 3), np.array([1e-6] * 3 + [1e-5] * 3)
    rates = np.stack([imu_allan.simulate({'noise_density': n[i], 'rate_random_walk': k[i]},
                                         12_000, 1.0, i) for i in range(6)], axis=1)
    nees, nis = consistency.run(rates, (n, k), 1)
    assert nis.mean() == pytest.approx(1, abs=0.1)
    assert nees[:, -1].mean() == pytest.approx(1, abs=0.4)
    overconfident, _ = consistency.run(rates, (n / 3, k / 3), 1)
    assert overconfident[:, -1].mean() > 4


def test_gtsam_predicts_what_happens_where_its_numbers_are_right(consistency, monkeypatch):
    pytest.importorskip('gtsam')
    monkeypatch.setitem(sys.modules, 'consistency', consistency)
    smoothing = loaded('with_gtsam')
    n, k = np.array([1e-4] * 3 + [1e-3] * 3), np.array([1e-6] * 3 + [1e-5] * 3)
    rates = np.stack([imu_allan.simulate({'noise_density': n[i], 'rate_random_walk': k[i]},
                                         15_000, 10.0, i) for i in range(6)], axis=1)
    nees, nis = smoothing.run(rates, (n, k), 1)
    assert nis.mean() == pytest.approx(1, abs=0.15)
    assert 0.4 < nees[:, -1].mean() < 2.5
    overconfident, _ = smoothing.run(rates, (n / 3, k / 3), 1)
    assert overconfident[:, -1].mean() > 4
