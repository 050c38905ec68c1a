# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Noise that changes is seen, its size reported, and intervals are wider there and only there."""

from itertools import pairwise

from characterized import B, characterized, K, N, several, simulated
from imu_allan.characterization.axis import characterize
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.noise.stationarity import segment_powers, short_powers, steadiness
import numpy as np
import pytest
from repeated import slow

RATE = 100.0
SENSOR = {N: 1e-3, B: 1e-3}
SAMPLES = 360_000
SHORT = {'white': {}, 'flicker': {B: 5e-3}, 'walk': {K: 5e-3},
         'quantization': {'quantization_noise': 1e-4}, 'warm-up': {}, 'coarse': {}, 'low-pass': {}}


def test_noise_that_stays_the_same_is_steady():
    found = [axis.stationarity for axis in simulated(SENSOR, 65_536, RATE, range(20))]
    assert all(one.steady for one in found)
    assert sum(one.p_value < 0.01 for one in found) <= 2


def test_strong_quantization_noise_is_steady():
    # Three hours of a ring-laser gyroscope: one arc second, and far less white noise.
    terms = {'quantization_noise': 4.8e-6, N: 2e-7}
    estimator = Estimator(12)
    estimator.update(np.transpose([simulate(terms, 2_160_000, 200.0, seed) for seed in range(12)]))
    powers = segment_powers(estimator.finished().periodogram)
    assert all(steadiness(powers, axis, 1 / 200).steady for axis in range(12))


@pytest.mark.parametrize(('samples', 'louder', 'until', 'between'), [
    # Two halves a tenth apart have half of it as their standard deviation.
    (65_536, 1.1, 1 / 2, 0.05e-3), (SAMPLES, 1.1, 1 / 2, 0.05e-3), (SAMPLES, 1.5, 5 / 9, 0.25e-3)])
def test_noise_that_is_higher_at_first_is_reported_with_its_size(samples, louder, until, between):
    record = simulate(SENSOR, samples, RATE, 2)
    steady = characterize(record, RATE)
    segments = steady.stationarity.segments
    for before, after in pairwise(segments):
        assert after.start_s == pytest.approx(before.start_s + before.duration_s)
    for segment in segments:
        begin = round(segment.start_s * RATE)
        part = record[begin:begin + round(segment.duration_s * RATE)]
        assert segment.mean == pytest.approx(part.mean(), abs=1e-9)
        assert segment.ci95[0] < segment.noise_density < segment.ci95[1]
    record[:round(until * samples)] *= louder
    axis, remarks = characterized(record, RATE)
    assert remarks['not_steady']['spread_share'] == pytest.approx((louder - 1) / 2, rel=0.3)
    first, last = axis.stationarity.segments[0], axis.stationarity.segments[-1]
    assert first.noise_density / last.noise_density == pytest.approx(louder, abs=0.02)
    density = axis.coefficients[N]
    assert density.between == pytest.approx(between, rel=0.24)
    low, high = density.ci95
    assert low < (1 + 0.2 * (louder - 1)) * 1e-3 < (1 + 0.8 * (louder - 1)) * 1e-3 < high
    assert (axis.stationarity.steady, steady.stationarity.steady) == (False, True)
    assert steady.coefficients[N].between is None


def test_white_noise_that_changes_hides_no_random_walk():
    walking = {N: 1e-3, B: 3e-4, K: 1.2e-4}
    records = [simulate(walking, SAMPLES, RATE, seed) for seed in range(6)]
    added = np.random.default_rng(6).normal(0, 0.003, (6, SAMPLES // 2))
    louder = [np.append(record[:SAMPLES // 2], record[SAMPLES // 2:] + own)
              for record, own in zip(records, added, strict=True)]
    shown = [[axis.coefficients[K].observable for axis in several(some, RATE)]
             for some in (records, louder)]
    assert shown == [[True] * 6] * 2


@pytest.mark.parametrize(('samples', 'from_', 'ratio'), [
    (320, 0.3, 0.5), (1000, 0.5, 2.0), (2000, 0.9, 2.0), (6000, 0.7, 0.5), (12_000, 0.3, 1.3),
    (30_000, 0.5, 1.3)])
def test_a_short_record_says_that_its_noise_changes(samples, from_, ratio):
    record = simulate(SENSOR, samples, RATE, 1)
    even = characterize(record, RATE)
    at = round(from_ * samples)
    record[at:] *= ratio
    axis, remarks = characterized(record, RATE)
    assert 'not_steady' in remarks
    assert not axis.stationarity.steady
    first, last = axis.stationarity.segments[0], axis.stationarity.segments[-1]
    assert last.noise_density / first.noise_density == pytest.approx(ratio, rel=0.3)
    assert last.start_s + last.duration_s == pytest.approx(samples / RATE)
    low, high = axis.coefficients[N].ci95
    narrow = even.coefficients[N].ci95
    assert high / low > narrow[1] / narrow[0]


def alarms(kind, samples, seeds, period=10**6, lost=0):
    """Count the records whose noise seems to change, with so many samples lost of each period."""
    said = 0
    for seed in seeds:
        record = simulate({N: 1e-3, **SHORT[kind]}, samples + 31, RATE, seed)
        if kind == 'warm-up':
            record += 0.5 * np.exp(-5 * np.arange(len(record)) / samples)
        if kind == 'coarse':
            record = np.rint(record / 0.02) * 0.02
        if kind == 'low-pass':
            record = np.convolve(record, np.ones(32) / 32, 'valid')
        estimator = Estimator()
        for first in range(0, samples, period):
            estimator.update(record[first:min(first + period - lost, samples)])
            estimator.skip(lost)
        powers = short_powers(estimator.finished().periodogram)
        said += not steadiness(powers, 0, 1 / RATE, white_alone=True).steady
    return said


@pytest.mark.parametrize(('draws', 'most'), [
    ([(1000, range(15)), (9000, range(15)), (9000, range(5), 25, 6), (9000, range(5), 60, 8)], 0),
    slow([(samples, range(100, 400)) for samples in (300, 1000, 9000, 30_000)], 11)])
@pytest.mark.parametrize('kind', SHORT)
def test_short_records_whose_noise_stays_the_same_hardly_ever_say_otherwise(kind, draws, most):
    assert sum(alarms(kind, *of) for of in draws) <= most
