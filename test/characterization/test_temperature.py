# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A thermometer beside the samples: how its readings find them, whatever the clock does."""

from dataclasses import replace

from characterized import in_blocks, START_NS
from imu_allan.characterization import Characterization
from imu_allan.characterization.thermometer import Thermometer
from imu_allan.noise.simulate import simulate
from imu_allan.state import state_of
import numpy as np
import pytest

RATE = 10.0
SECONDS = np.arange(36_000) / RATE
PER_KELVIN = 2e-3


def celsius_at(seconds):
    """Temperature of an hour: settling by 12 K, with a dip that no ramp or warm-up has."""
    return 25 + 12 * (1 - np.exp(-seconds / 700)) - 3 * np.exp(-((seconds - 2000) / 300)**2)


@pytest.fixture(scope='module')
def rows():
    """Draw six axes at rest of which gyro_x follows the temperature."""
    terms = {'noise_density': 1e-3, 'bias_instability': 1e-4}
    rows = np.stack([simulate(terms, len(SECONDS), RATE, seed) for seed in range(6)], axis=1)
    rows[:, 0] += PER_KELVIN * celsius_at(SECONDS)
    rows[:, 5] += 9.81
    return rows


def stamps_of(seconds):
    return START_NS + np.rint(seconds * 1e9).astype(np.int64)


def result_of(rows, readings, celsius, *, gyro_alone=True):
    """Return the result of samples and of the readings of a thermometer."""
    stream = Characterization(kind='topic')
    stream.take(in_blocks(rows, RATE, gyro_alone=gyro_alone))
    stream.take_temperature(stamps_of(readings), celsius)
    return stream.result()


def axis_of(result):
    return result.axes['gyro_x'].trend.temperature


def remarks(result):
    return [remark for remark in result.warnings
            if remark.code in ('temperature', 'thermometer')]


def test_the_mean_follows_the_temperature_of_the_readings(rows):
    celsius = celsius_at(SECONDS[::20])
    result = result_of(rows, SECONDS[::20], celsius, gyro_alone=False)
    found = {name: axis.trend.temperature for name, axis in result.axes.items()}
    # Of five axes that do not follow it one may seem to, by chance.
    assert sum(one is not None for one in found.values()) <= 2
    one = found['gyro_x']
    assert one.per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)
    assert (one.lowest_c, one.highest_c) == pytest.approx((celsius.min(), celsius.max()), abs=0.1)
    assert not result.axes['gyro_x'].coefficients['rate_random_walk'].observable
    said = remarks(result)[0]
    assert (said.code, said.axes) == ('temperature', ('gyro_x',))
    assert said.values == {
        'per_kelvin': one.per_kelvin, 'per_kelvin_low': one.ci95[0],
        'per_kelvin_high': one.ci95[1], 'unit': 'rad/s', 'lowest_c': one.lowest_c,
        'highest_c': one.highest_c, 'curved': False, 'lag_s': None}
    shown = result.temperature
    middle = (np.arange(len(shown.mean)) + 0.5) * shown.step_s
    assert len(middle) <= 128
    assert shown.mean == pytest.approx(celsius_at(np.minimum(middle, 3599)), abs=0.3)
    assert all(low <= mean <= high for low, mean, high in zip(
        shown.low, shown.mean, shown.high, strict=True))


def test_readings_may_come_in_any_order_and_through_a_state(rows):
    readings = SECONDS[::20]
    first, second = Characterization(kind='topic'), Characterization(kind='topic')
    first.take_temperature(stamps_of(readings), celsius_at(readings))
    first.take(in_blocks(rows, RATE, gyro_alone=True))
    shuffled = np.random.default_rng(0).permutation(readings)
    for number, part in enumerate(np.array_split(np.arange(len(rows)), 7)):
        second.take(in_blocks(rows[part], RATE, part, 501, gyro_alone=True))
        some = shuffled[number::7]
        second.take_temperature(stamps_of(some), celsius_at(some))
        second = Characterization.from_state(second.to_state())
    result = first.result()
    assert axis_of(result) is not None
    assert second.result().to_dict() == result.to_dict()


def test_memory_does_not_grow_with_the_readings():
    thermometer = Thermometer()
    seconds = np.arange(2_000_000) / 10
    for part in np.array_split(seconds, 50):
        thermometer.take(stamps_of(part), 20 + part / 1e5)
    assert sum(array.nbytes for array in state_of(thermometer).values()) < 200_000
    at = np.array([500.0, 123_456.0])
    assert thermometer.celsius(stamps_of(at).astype(float)) == pytest.approx(20 + at / 1e5,
                                                                             abs=1e-5)
    assert len(thermometer) == 2_000_000


def test_gaps_in_the_samples_and_a_jump_of_the_clock_are_followed(rows):
    kept = np.flatnonzero((SECONDS < 500) | (SECONDS > 900))

    def set_by_a_day(stamps):
        return stamps + np.where(stamps > stamps_of(2500.0), 86_400_000_000_000, 0)

    stream = Characterization(kind='topic')
    # The driver's clock is set by a day; the receive clock goes on.
    stream.take(replace(block, header_ns=set_by_a_day(block.header_ns)) for block in in_blocks(
        rows[kept], RATE, kept, gyro_alone=True))
    stream.take_temperature(set_by_a_day(stamps_of(SECONDS[::20])), celsius_at(SECONDS[::20]))
    assert axis_of(stream.result()).per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)


def with_a_gap(seconds):
    return seconds[(seconds < 1000) | (seconds > 1320)]


@pytest.mark.parametrize(('at', 'celsius', 'expected'), [
    (lambda s: s[s < 2000], celsius_at,
     [{'fault': 'short', 'covered_share': pytest.approx(0.635, abs=5e-3)}]),
    (lambda s: s, lambda s: np.full(len(s), 25.0), [{'fault': 'constant'}]),
    (lambda s: s + 1e6, celsius_at, [{'fault': 'short', 'covered_share': 0.0}]),
    (with_a_gap, lambda s: np.round(celsius_at(s) / 2) * 2, [
        {'fault': 'coarse', 'step_k': pytest.approx(2), 'range_k': pytest.approx(12, abs=1)},
        {'fault': 'gaps', 'gaps': 1}])], ids=['short', 'constant', 'elsewhere', 'coarse, a gap'])
def test_readings_that_are_little_or_no_use_are_reported(rows, at, celsius, expected):
    readings = at(SECONDS[::20])
    result = result_of(rows, readings, celsius(readings))
    found = [one.values for one in remarks(result) if one.code == 'thermometer']
    assert [{key: values[key] for key in wanted} for values, wanted in zip(
        found, expected, strict=True)] == expected
    assert at is with_a_gap or axis_of(result) is None
