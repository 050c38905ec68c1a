# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import holds, joint_fits, shown, together
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

RATE_HZ = 100.0
MODEL = {'noise_density': 1e-3, 'bias_instability': 8e-4, 'rate_random_walk': 2e-4}


def estimates(records):
    return together(records, RATE_HZ)[0].coefficients


@pytest.fixture(scope='module')
def records():
    return [simulate(MODEL, 60_000, RATE_HZ, seed) for seed in range(3)]


def test_the_coefficients_of_three_records_lie_in_their_intervals(records):
    found = estimates(records)
    for key in MODEL:
        assert found[key].observable
        low, high = found[key].ci95
        assert 0.7 * low < MODEL[key] < 1.3 * high


def test_every_record_has_its_own_mean_and_its_own_ramp(records):
    time = np.arange(60_000) / RATE_HZ
    moved = [samples + offset + slope * time for samples, (offset, slope) in zip(
        records, ((3.0, 1e-5), (-7.0, -4e-5), (0.0, 2e-5)), strict=True)]
    still, sloping = estimates(records), estimates(moved)
    for key in MODEL:
        assert sloping[key].value == pytest.approx(still[key].value, rel=0.02)


def test_a_record_too_short_or_in_which_the_axis_stood_still_is_left_out(records):
    expected = estimates(records[1:])
    died = records[0].copy()
    died[len(died) // 3:] = 0.5
    assert estimates([died, *records[1:]]) == expected
    short = estimates([*records[1:], records[0][:50]])
    assert short['noise_density'].value == pytest.approx(expected['noise_density'].value, rel=1e-9)
    still = [shown(np.full(500, value)) for value in (1.0, 2.0)]
    assert joint_fits(still, 0.01) == [None]


FLICKER = {'noise_density': 1e-3, 'bias_instability': 3e-4}
HOUR = np.arange(72_000) / 20


def hours(trend_of):
    """Characterize four hours of flicker at 20 Hz together, each with a trend of its own."""
    return together([simulate(FLICKER, len(HOUR), 20.0, 40 + part) + trend_of(part)
                     for part in range(4)], 20.0)


def test_a_warm_up_in_every_record_is_no_random_walk():
    found, _ = hours(lambda part: (-1)**part * 3e-3 * np.exp(-HOUR / 400))
    assert not found.coefficients['rate_random_walk'].observable
    warm = found.trend.warm_up
    assert found.trend.second_warm_up is None
    assert warm.time_constant_ci95[0] < 400 < warm.time_constant_ci95[1]
    ends = sorted(map(abs, warm.ci95))
    assert ends[0] < 3e-3 < ends[1]


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
            covered[key] += holds(found[key], truth)
    for key in ('noise_density', 'bias_instability'):
        ratio = np.std(values[key]) / np.std(whole[key])
        # Two spreads of 150 each are known to 8 %.
        assert ratio < 1.25
        assert covered[key] > 0.88 * 150
