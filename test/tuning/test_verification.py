# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers of one recording in another that is noisier, or drifts more."""

from drifting_axes import axis_of
from imu_allan.tuning.tune import tune
from imu_allan.tuning.verification import verify
import numpy as np
import pytest

HERE = axis_of(1e-3, 5e-5)


@pytest.mark.parametrize(('noise', 'drift'), [(1, 1), (3, 1), (1, 4)],
                         ids=['the same', 'more noise in motion', 'more drift in motion'])
def test_more_noise_or_drift_is_a_factor_of_its_number_alone(noise, drift):
    found = verify(HERE, axis_of(noise * 1e-3, drift * 5e-5), tune(HERE, 1.0))
    assert found.noise_factor == pytest.approx(noise, rel=0.05 if drift > 1 else 0.02)
    assert found.random_walk_factor == pytest.approx(drift, rel=0.15)
    assert found.excess[0].ratio == pytest.approx(noise, rel=0.01)
    if noise == drift:
        assert found.noise_factor == found.random_walk_factor == 1
        assert found.met.nis == pytest.approx(1, abs=0.02)
        assert [excess.ratio for excess in found.excess] == pytest.approx([1, 1, 1, 1])
    elif noise > 1:
        assert found.met.nis > 5
        assert found.excess[-1].ratio < 1.5
    else:
        assert found.met.coast_ratio > 5
        assert found.excess[-1].ratio > 3


def test_the_factor_of_a_drift_that_is_badly_known_is_open_wider():
    short = axis_of(1e-3, 5e-5, known=(0.01, 400.0))
    there = axis_of(1e-3, 2e-4)
    # 1.5 * 1200/60 degrees of freedom, and of the variance over 60 s three quarters are drift.
    half = 1.96 * (2 * 1.5 * 1200 / 60)**-0.5 * (1 + (1e-3 / 5e-5)**2 * 3 / 60**2)
    found = verify(short, there, tune(short, 1.0))
    low, high = found.random_walk_ci95
    # The other's curve is stated without an interval.
    factor = found.random_walk_factor
    assert np.log([factor / low, high / factor]) == pytest.approx([half, half], rel=0.05)
    assert found.noise_ci95 == (found.noise_factor, found.noise_factor)


def test_a_filter_with_a_process_is_held_against_a_recording_as_one():
    drifting = {'processes': ((1e-3, 100.0),)}
    here, there = axis_of(1e-3, **drifting), axis_of(1e-3, processes=((3e-3, 100.0),))
    tuning = tune(here, 1.0, bias='gauss_markov')
    same, more = verify(here, here, tuning), verify(here, there, tuning)
    assert (same.noise_factor, same.random_walk_factor) == pytest.approx((1, 1))
    assert same.met.coast_ratio == pytest.approx(tuning.coast_ratio)
    assert more.random_walk_factor == pytest.approx(3, rel=0.15)
    assert more.met.coast_ratio > 5
