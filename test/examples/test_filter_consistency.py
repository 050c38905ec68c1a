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


def test_the_covariance_stays_one_where_the_heading_is_lost(consistency):
    # Nobody sees the heading of an IMU at rest: with so much walk its variance drowns the rest.
    n, k = np.array([8e-5] * 3 + [1e-3] * 3), np.array([1.4e-2] * 3 + [0.16] * 3)
    rates = np.random.default_rng(1).standard_normal((3600, 6)) * n
    nees, nis = consistency.run(rates, (n, k), 7)
    assert nees.min() > 0
    assert nis.min() > 0


def test_the_dynamics_are_those_of_an_imu_at_rest(consistency):
    f = consistency.transition(2.0)
    assert f[0, 3] == 2.0
    assert f[0, 12] == 2.0                                      # t^2/2
    assert f[3, 10] == pytest.approx(consistency.GRAVITY * 2)   # g t^2/2
    assert f[0, 10] == pytest.approx(consistency.GRAVITY * 8 / 6)


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


def test_without_gtsam_the_example_says_what_to_install(consistency, monkeypatch):
    monkeypatch.setitem(sys.modules, 'consistency', consistency)
    monkeypatch.setitem(sys.modules, 'gtsam', None)
    with pytest.raises(SystemExit) as stop:
        loaded('with_gtsam')
    assert stop.value.code == 'this example needs GTSAM: pip install gtsam'
