# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A thermometer beside the samples: how its readings find them, whatever the clock does."""


from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.characterization.thermometer import Thermometer
from imu_allan.noise.simulate import simulate
from imu_allan.state import state_of
import numpy as np
import pytest

RATE = 10.0
SAMPLES = 36_000
START = 1_700_000_000_000_000_000
PER_KELVIN = 2e-3
LONG = {'noise_density': 1e-3, 'bias_instability': 1e-4}


def celsius_at(seconds):
    """Temperature of an hour: settling by 12 K, with a dip that no ramp or warm-up has."""
    return 25 + 12 * (1 - np.exp(-seconds / 700)) - 3 * np.exp(-((seconds - 2000) / 300)**2)


def still(seconds):
    """Draw six axes at rest of which gyro_x follows the temperature."""
    rows = np.stack([simulate(LONG, len(seconds), RATE, seed) for seed in range(6)], axis=1)
    rows[:, 0] += PER_KELVIN * celsius_at(seconds)
    rows[:, 5] += 9.81
    return rows


def take(stream, stamps, rows, size=3001, *, received=None, gyro_alone=True):
    received = stamps if received is None else received
    for begin in range(0, len(rows), size):
        part = slice(begin, begin + size)
        absent = np.tile([False, gyro_alone], (len(rows[part]), 1))
        stream.update(ImuBlock(stamps[part], received[part], rows[part], absent, 'imu_link'))


def stamps_of(seconds, offset=START):
    return offset + np.rint(seconds * 1e9).astype(np.int64)


@pytest.fixture(scope='module')
def hour():
    seconds = np.arange(SAMPLES) / RATE
    return seconds, still(seconds)


def taken(seconds, rows, readings=None, celsius=None, *, path=None, **more):
    """Return a stream that has taken in samples, and readings of a thermometer."""
    stream = Characterization(kind='topic', path=path)
    take(stream, stamps_of(seconds), rows, **more)
    if readings is not None:
        stream.take_temperature(stamps_of(readings),
                                celsius_at(readings) if celsius is None else celsius)
    return stream


def axis_of(result):
    return result.axes['gyro_x'].trend.temperature


def remarks(result):
    return [remark for remark in result.warnings
            if remark.code in ('temperature', 'thermometer')]


def test_the_mean_follows_the_temperature_of_the_readings(hour):
    seconds, rows = hour
    reading = seconds[::20]
    result = taken(seconds, rows, reading, gyro_alone=False).result()
    found = {name: axis.trend.temperature for name, axis in result.axes.items()}
    # Of five axes that do not follow it one may seem to, by chance.
    assert sum(one is not None for one in found.values()) <= 2
    one = found['gyro_x']
    assert one.per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)
    assert (one.lowest_c, one.highest_c) == pytest.approx(
        (celsius_at(reading).min(), celsius_at(reading).max()), abs=0.1)
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


def test_readings_may_come_in_any_order_and_through_a_state(hour):
    seconds, rows = hour
    reading = seconds[::20]
    first, second = Characterization(kind='topic'), Characterization(kind='topic')
    first.take_temperature(stamps_of(reading), celsius_at(reading))
    take(first, stamps_of(seconds), rows)
    shuffled = np.random.default_rng(0).permutation(reading)
    for number, part in enumerate(np.array_split(np.arange(len(rows)), 7)):
        take(second, stamps_of(seconds[part]), rows[part], 501)
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


def test_gaps_in_the_samples_and_a_jump_of_the_clock_are_followed(hour):
    seconds, rows = hour
    keep = (seconds < 500) | (seconds > 900)
    late = seconds > 2500
    stamps = stamps_of(seconds)
    # The driver's clock is set by a day; the receive clock goes on.
    stamps[late] += 86_400_000_000_000
    stream = Characterization(kind='topic')
    take(stream, stamps[keep], rows[keep], received=stamps_of(seconds)[keep])
    stream.take_temperature(stamps[::20], celsius_at(seconds[::20]))
    one = axis_of(stream.result())
    assert one.per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)


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
def test_readings_that_are_little_or_no_use_are_reported(hour, at, celsius, expected):
    seconds, rows = hour
    readings = at(seconds[::20])
    result = taken(seconds, rows, readings, celsius(readings)).result()
    found = [one.values for one in remarks(result) if one.code == 'thermometer']
    assert [{key: values[key] for key in wanted} for values, wanted in zip(
        found, expected, strict=True)] == expected
    assert at is with_a_gap or axis_of(result) is None
