# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A thermometer beside the samples, and a night with all that happens: each cause has its code."""

from dataclasses import replace

from characterized import AXES, B, celsius_at, in_blocks, K, messages, N, said, START_NS, streamed
from imu_allan.characterization import Characterization
from imu_allan.characterization.thermometer import Thermometer
from imu_allan.noise.simulate import simulate
from imu_allan.state import state_of
import numpy as np
import pytest
from scipy.signal import lfilter

RATE = 10.0
SECONDS = np.arange(36_000) / RATE
PER_KELVIN = 2e-3


@pytest.fixture(scope='module')
def rows():
    """Draw six axes at rest of which gyro_x follows the temperature."""
    terms = {N: 1e-3, B: 1e-4}
    rows = np.stack([simulate(terms, len(SECONDS), RATE, seed) for seed in range(6)], axis=1)
    rows[:, 0] += PER_KELVIN * celsius_at(SECONDS)
    rows[:, 5] += 9.81
    return rows


def stamps_of(seconds):
    return START_NS + np.rint(seconds * 1e9).astype(np.int64)


def result_of(rows, readings, celsius, *, gyro_alone=True):
    stream = streamed(in_blocks(rows, RATE, gyro_alone=gyro_alone))
    stream.take_temperature(stamps_of(readings), celsius)
    return stream.result()


def axis_of(result):
    return result.axes['gyro_x'].trend.temperature


def test_the_mean_follows_the_temperature_of_the_readings(rows):
    celsius = celsius_at(SECONDS[::20])
    result = result_of(rows, SECONDS[::20], celsius, gyro_alone=False)
    found = {name: axis.trend.temperature for name, axis in result.axes.items()}
    # Of five axes that do not follow it one may seem to, by chance.
    assert sum(one is not None for one in found.values()) <= 2
    one = found['gyro_x']
    assert one.per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)
    assert (one.lowest_c, one.highest_c) == pytest.approx((celsius.min(), celsius.max()), abs=0.1)
    assert not result.axes['gyro_x'].coefficients[K].observable
    [remark, *_] = said(result, 'temperature')
    assert remark.axes == ('gyro_x',)
    assert remark.values == {
        'per_kelvin': one.per_kelvin, 'per_kelvin_low': one.ci95[0],
        'per_kelvin_high': one.ci95[1], 'unit': 'rad/s', 'lowest_c': one.lowest_c,
        'highest_c': one.highest_c, 'lag_s': None}
    shown = result.temperature
    middle = (np.arange(len(shown.mean)) + 0.5) * shown.step_s
    assert len(middle) <= 128
    assert shown.mean == pytest.approx(celsius_at(np.minimum(middle, 3599)), abs=0.3)
    assert all(low <= mean <= high for low, mean, high in zip(
        shown.low, shown.mean, shown.high, strict=True))


def in_steps(seconds):
    return np.round(8 * celsius_at(seconds)) / 8


def test_readings_may_come_in_any_order_and_through_a_state(rows):
    readings = SECONDS[::20]
    first, second = Characterization(kind='topic'), Characterization(kind='topic')
    first.take_temperature(stamps_of(readings), in_steps(readings))
    first.take(in_blocks(rows, RATE, gyro_alone=True))
    shuffled = np.random.default_rng(0).permutation(readings)
    for number, part in enumerate(np.array_split(np.arange(len(rows)), 7)):
        second.take(in_blocks(rows[part], RATE, part, 501, gyro_alone=True))
        some = shuffled[number::7]
        second.take_temperature(stamps_of(some), in_steps(some))
        second = Characterization.from_state(second.to_state())
    result = first.result()
    assert axis_of(result) is not None
    assert second.result().to_dict() == result.to_dict()


def test_memory_does_not_grow_with_the_readings():
    noise = np.random.default_rng(1).normal(size=(400_000, 6))
    stream, sizes = streamed(in_blocks(noise, 2.0, size=100_000, gyro_alone=True)), []
    for part in np.array_split(np.arange(2_000_000) / 10, 50):
        sizes.append(sum(array.nbytes for array in stream.to_state().values()))
        stream.take_temperature(stamps_of(part), 20 + part / 1e5)
    assert max(sizes) < sizes[0] + 200_000
    shown = stream.result().temperature
    middle = (np.arange(len(shown.mean)) + 0.5) * shown.step_s
    assert shown.mean[:-1] == pytest.approx(20 + middle[:-1] / 1e5, abs=1e-3)
    thermometer = Thermometer()
    for part in np.array_split(np.arange(2_000_000) / 10, 50):
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

    # The driver's clock is set by a day; the receive clock goes on.
    stream = streamed(replace(block, header_ns=set_by_a_day(block.header_ns))
                      for block in in_blocks(rows[kept], RATE, kept, gyro_alone=True))
    stream.take_temperature(set_by_a_day(stamps_of(SECONDS[::20])), celsius_at(SECONDS[::20]))
    assert axis_of(stream.result()).per_kelvin == pytest.approx(PER_KELVIN, rel=0.02)


@pytest.mark.parametrize(('at', 'celsius', 'expected'), [
    (lambda s: s[s < 2000], celsius_at,
     [{'fault': 'short', 'covered_share': pytest.approx(0.635, abs=5e-3)}]),
    (lambda s: s[s > 500], celsius_at,
     [{'fault': 'short', 'covered_share': pytest.approx(0.867, abs=5e-3)}]),
    (lambda s: s, lambda s: np.full(len(s), 25.0), [{'fault': 'constant'}]),
    (lambda s: s + 1e6, celsius_at, [{'fault': 'short', 'covered_share': 0.0}])],
    ids=['short', 'late', 'constant', 'elsewhere'])
def test_readings_that_are_little_or_no_use_are_reported(rows, at, celsius, expected):
    readings = at(SECONDS[::20])
    result = result_of(rows, readings, celsius(readings))
    found = [one.values for one in said(result, 'thermometer')]
    assert [{key: values[key] for key in wanted} for values, wanted in zip(
        found, expected, strict=True)] == expected
    assert axis_of(result) is None


GYRO, ACCEL = {N: 7.9e-5, B: 2.4e-5}, {N: 1.2e-3, B: 3e-4}
LAG = 240.0
"""Seconds by which the thermometer follows the sensor."""
WORDS = {'warm_up', 'slow_cycle', 'not_steady', 'temperature', 'trend_or_walk', 'bias_step',
         'poor_fit', 'gauss_markov', 'band_limited'}
"""Of the remarks that say what an axis does; the length of the record is none."""
ALONE = dict(zip(AXES, ('warm-up', 'heater', 'louder', 'weather', '', 'walk'), strict=True))
FOUND = {'warm-up': 'warm_up', 'heater': 'slow_cycle', 'louder': 'not_steady',
         'weather': 'temperature'}
LOUD = {'gyro': 0.02, 'acce': 0.5}
"""Of a slammed door, in the unit of the axis."""
EVERYTHING = ' '.join(FOUND)
STRENGTH = 10.0
"""Of the temperature, in bias instabilities per kelvin."""


class Night:
    """A sensor at rest, a door that slams, and by name of the axis what moves it; others stand."""

    def __init__(self, hours, rate, causes, seed):
        self.time = np.arange(round(hours * 3600 * rate)) / rate
        self.hours, self.rate, self.causes = hours, rate, causes
        rng = np.random.default_rng(seed)
        self.period = hours * 3600 / rng.uniform(8, 12)
        self.settling = rng.uniform(500, 1000)
        # A day's trend, and somebody who opens the window three times.
        end = self.time[-1]
        weather = 2 * np.sin(1.6 * np.pi * self.time / end + rng.uniform(0, 6))
        for at in rng.permutation((0.2, 0.5, 0.75)):
            since = np.maximum(self.time - (at + rng.uniform(0, 0.1)) * end, 0)
            weather -= 4 * since / 500 * np.exp(1 - since / 500)
        self.slam = 0.37 * hours * 3600
        after = np.maximum(self.time - self.slam, 0)
        ring = np.where(after > 0, np.exp(-after / 0.6) * np.sin(0.4 * np.pi * rate * after), 0)
        self.rows = np.zeros((len(self.time), 6))
        for number, (name, why) in enumerate(causes.items()):
            self.rows[:, [*AXES].index(name)] = self._axis(
                name, why, seed * 6 + number, weather, rng) + ring * LOUD[name[:4]]
        self.rows[:, 5] += 9.81
        share = 1 / (LAG * rate)
        shown = lfilter([share], [1, share - 1], weather, zi=[(1 - share) * weather[0]])[0]
        self.celsius = np.round(21 + shown + 0.01 * rng.standard_normal(len(shown)), 2)

    def _axis(self, name, causes, seed, weather, rng):
        model = dict(GYRO if name.startswith('gyro') else ACCEL)
        if 'walk' in causes:
            model[K] = 3 * model[B] / np.sqrt(self.hours * 360)
        rows = simulate(model, len(self.time), self.rate, seed)
        sign = rng.choice((-1, 1))
        if 'warm-up' in causes:
            rows += sign * rng.uniform(20, 60) * model[B] * np.exp(-self.time / self.settling)
        if 'heater' in causes:
            turn = (self.time / self.period + rng.uniform()) % 1
            rows += rng.uniform(4, 8) * model[B] * np.where(
                turn < 0.4, 1 - 2 * np.exp(-10 * turn), -1 + 2 * np.exp((0.4 - turn) / 0.15))
        if 'weather' in causes:
            rows += STRENGTH * model[B] * weather
        if 'louder' in causes:
            rows += simulate({N: 0.75 * model[N]}, len(self.time), self.rate, seed + 1000) * (
                self.time > 0.6 * self.time[-1])
        return rows

    def live(self, rng):
        """Give it to a stream as a topic does, which is saved and loaded in between."""
        stream = Characterization(kind='topic', topic='/imu')
        begin = 0
        while begin < len(self.time):
            part = slice(begin, begin + int(rng.integers(500, 20_000)))
            stream.update(messages(self.rows[part], self.rate, begin))
            stream.take_temperature(stamps_of(self.time[part]), self.celsius[part])
            if rng.random() < 0.2:
                stream = Characterization.from_state(stream.to_state())
            begin = part.stop
        return stream.result()


def is_right(night, result, name):
    """Tell whether words and numbers of an axis are those of its causes."""
    axis, why = result.axes[name], night.causes[name]
    codes = {remark.code for remark in result.warnings if name in remark.axes} & WORDS
    unclear = 'walk' in why and 'trend_or_walk' in codes
    if codes - {'trend_or_walk'} != {word for cause, word in FOUND.items() if cause in why}:
        return False
    truth = GYRO if name.startswith('gyro') else ACCEL
    flicker, trend = axis.coefficients[B], axis.trend
    right = [axis.coefficients[K].observable == ('walk' in why) or unclear,
             abs(flicker.value / truth[B] - 1) < 0.35 if flicker.observable
             else flicker.upper95 > truth[B]]
    if 'warm-up' in why:
        shortest, longest = trend.warm_up.time_constant_ci95
        right.append(0.8 * shortest < night.settling < 1.25 * longest)
    if 'heater' in why:
        right.append(abs(trend.cycle_s / night.period - 1) < 0.05)
    if 'weather' in why:
        heat = trend.temperature
        right += [abs(heat.per_kelvin / (STRENGTH * truth[B]) - 1) < 0.2,
                  heat.lag_s is not None and abs(heat.lag_s - LAG) < 100]
    return all(right)


def slammed(night, result):
    """Tell whether the door, and nothing else, was cut out."""
    [cut] = result.timeline.motion
    return cut.start_s < night.slam < cut.start_s + cut.duration_s and cut.duration_s < 60


@pytest.mark.parametrize(('hours', 'why'), [
    *((3, why) for why in (*FOUND, '', 'walk', EVERYTHING)), (8, EVERYTHING)])
def test_each_cause_alone_and_all_together_are_reported_by_their_own_words(hours, why):
    night = Night(hours, 8, {'gyro_x': why}, 1)
    live = night.live(np.random.default_rng(1))
    assert slammed(night, live)
    assert is_right(night, live, 'gyro_x')


@pytest.mark.slow
def test_whole_nights_with_everything_on_every_axis_and_with_one_cause_on_each():
    right = []
    for seed in range(6):
        for number, causes in enumerate((ALONE, dict.fromkeys(AXES, EVERYTHING))):
            # Of a noise of its own: what passes for a random walk by chance would count twice.
            night = Night(8, 8, causes, 100 + 2 * seed + number)
            live = night.live(np.random.default_rng(seed))
            assert slammed(night, live)
            right += [is_right(night, live, name) for name in causes]
    assert np.mean(right) >= 0.9
