# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise import fit, intervals
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.intervals import estimate
from imu_allan.noise.joint import joint_fits
from imu_allan.noise.simulate import simulate
from imu_allan.noise.temperature_course import TemperatureCourse
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


def test_a_record_in_which_the_axis_stood_still_is_left_out(records):
    died = records[0].copy()
    died[len(died) // 3:] = 0.5
    assert estimates([died, *records[1:]]) == estimates(records[1:])


def test_a_line_of_one_record_is_left_out_there_and_named(records):
    time = np.arange(60_000) / RATE_HZ
    humming = records[0] + 0.01 * np.sin(2 * np.pi * 17.3 * time)
    (found,) = joint_fits([finished(samples) for samples in (humming, *records[1:])],
                          1 / RATE_HZ)
    assert [round(line.frequency_hz, 1) for line in found.lines] == [17.3]
    assert found.fit.estimates['noise_density'].value == pytest.approx(1e-3, rel=0.01)


def test_interval_of_the_density_is_that_with_a_bend_alone(records, monkeypatch):
    found = estimates(records)['noise_density']
    asked = []

    def spy(trial, column, widening=1.0):
        asked.append(estimate(trial, column, widening))
        return asked[-1]

    # Doubt about the exponent of flicker only widens it.
    monkeypatch.setattr(fit, 'with_doubt_of_flicker', lambda *given: given[2])
    without = estimates(records)['noise_density']
    assert found.low <= without.low < without.high <= found.high
    found = without
    monkeypatch.setattr(intervals, 'estimate', spy)
    assert estimates(records)['noise_density'] == found
    # The last that is asked for is the density beside a bend.
    assert (found.low, found.high) == (asked[-1].low, asked[-1].high)
    assert found.low < found.value < found.high


def test_one_record_alone_gives_what_it_gives_by_itself(records):
    whole = finished(records[0])
    (joint,) = joint_fits([whole], 1 / RATE_HZ)
    (alone,) = fit_axes(whole, 1 / RATE_HZ)
    for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
        one, other = joint.fit.estimates[key], alone.fit.estimates[key]
        assert one.observable == other.observable
        assert one.value == pytest.approx(other.value, rel=1e-4)
        assert one.low == pytest.approx(other.low, rel=1e-2)


FLICKER = {'noise_density': 1e-3, 'bias_instability': 3e-4}
HOUR = np.arange(72_000) / 20


def hours(course_of):
    """Fit four hours of flicker at 20 Hz, each with a course of its own."""
    samples = [simulate(FLICKER, len(HOUR), 20.0, 40 + part) + course_of(part)
               for part in range(4)]
    (found,) = joint_fits([finished(rows) for rows in samples], 1 / 20)
    return found.fit


def test_a_warm_up_in_every_record_is_no_random_walk():
    found = hours(lambda part: (-1)**part * 3e-3 * np.exp(-HOUR / 400))
    assert not found.estimates['rate_random_walk'].observable
    [warm] = found.warmings
    assert warm.shortest_s < 400 < warm.longest_s
    assert warm.time_constant_s == pytest.approx(400, rel=0.4)
    assert abs(warm.low) < 3e-3 < abs(warm.high) or abs(warm.high) < 3e-3 < abs(warm.low)


def test_a_slow_cycle_in_every_record_is_no_random_walk():
    found = hours(lambda part: 6e-4 * np.sin(2 * np.pi * HOUR / 1200 + part))
    assert not found.estimates['rate_random_walk'].observable
    assert found.walk_unclear or found.cycle_s == pytest.approx(1200, rel=0.1)


def test_the_temperature_of_every_record_explains_its_mean():
    heat = [TemperatureCourse(HOUR[::20], 25 + 5 * np.sin(HOUR[::20] / 400 + part))
            for part in range(4)]
    samples = [simulate(FLICKER, len(HOUR), 20.0, 40 + part)
               + 2e-4 * np.interp(HOUR, HOUR[::20], heat[part].celsius) for part in range(4)]
    (found,) = joint_fits([finished(rows) for rows in samples], 1 / 20, heat)
    assert not found.fit.estimates['rate_random_walk'].observable
    assert found.fit.temperature.low < 2e-4 < found.fit.temperature.high
    assert found.fit.temperature.per_kelvin == pytest.approx(2e-4, rel=0.05)


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


@pytest.mark.parametrize('size', [7, 15])
def test_a_step_in_every_record_is_no_random_walk(size):
    found = hours(lambda part: size * 3e-4 * (900 + 500 * part < HOUR))
    assert not found.estimates['rate_random_walk'].observable
    assert found.walk_unclear
