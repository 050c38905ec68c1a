# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.joint import joint_fits
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

RATE_HZ = 100.0
MODEL = {'noise_density': 1e-3, 'bias_instability': 8e-4, 'rate_random_walk': 2e-4}


def finished(samples):
    estimator = Estimator()
    estimator.update(samples)
    return estimator.finished()


def estimates(records):
    (found,) = joint_fits([finished(samples) for samples in records], 1 / RATE_HZ)
    return found.fit.estimates


@pytest.fixture(scope='module')
def records():
    return [simulate(MODEL, 60_000, RATE_HZ, seed) for seed in range(3)]


def test_the_coefficients_of_three_records_lie_in_their_intervals(records):
    found = estimates(records)
    for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
        assert found[key].observable
        assert 0.7 * found[key].low < MODEL[key] < 1.3 * found[key].high


def test_every_record_has_its_own_mean_and_its_own_ramp(records):
    time = np.arange(60_000) / RATE_HZ
    moved = [samples + offset + slope * time for samples, (offset, slope) in zip(
        records, ((3.0, 1e-5), (-7.0, -4e-5), (0.0, 2e-5)), strict=True)]
    still, sloping = estimates(records), estimates(moved)
    for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
        assert sloping[key].value == pytest.approx(still[key].value, rel=0.02)


def test_a_record_too_short_for_itself_does_no_harm(records):
    short = estimates([*records, records[0][:50]])
    assert short['noise_density'].value == pytest.approx(
        estimates(records)['noise_density'].value, rel=1e-9)


def test_an_axis_that_is_constant_in_every_record_has_no_fit():
    assert joint_fits([finished(np.ones(500)), finished(np.full(500, 2.0))], 0.01) == [None]


def test_a_line_of_one_record_is_left_out_there_and_named(records):
    time = np.arange(60_000) / RATE_HZ
    humming = records[0] + 0.01 * np.sin(2 * np.pi * 17.3 * time)
    (found,) = joint_fits([finished(samples) for samples in (humming, *records[1:])],
                          1 / RATE_HZ)
    assert [round(line.frequency_hz, 1) for line in found.lines] == [17.3]
    assert found.fit.estimates['noise_density'].value == pytest.approx(1e-3, rel=0.01)


@pytest.mark.slow
def test_the_joint_coefficients_reach_their_bound_and_their_intervals_hold():
    """Four records of 10 min, 150 times: errors against those of 40 min at once."""
    values = {key: [] for key in MODEL}
    covered = dict.fromkeys(MODEL, 0)
    whole = {key: [] for key in MODEL}
    for run in range(150):
        found = estimates([simulate(MODEL, 60_000, RATE_HZ, 1000 + 5 * run + part)
                           for part in range(4)])
        once = estimates([simulate(MODEL, 240_000, RATE_HZ, 1004 + 5 * run)])
        for key, truth in MODEL.items():
            values[key].append(found[key].value / truth - 1)
            whole[key].append(once[key].value / truth - 1)
            covered[key] += found[key].low < truth < found[key].high
    for key in ('noise_density', 'bias_instability'):
        ratio = np.std(values[key]) / np.std(whole[key])
        # Two spreads of 150 each are known to 8 %.
        assert ratio < 1.25
        assert covered[key] > 0.88 * 150
