# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A night with all that happens in one: each cause is found by its own code."""

from characterized import messages
from imu_allan.characterization import Characterization
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from scipy.signal import lfilter

N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
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
PER_KELVIN = 10.0
"""In bias instabilities."""


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
            rows += PER_KELVIN * model[B] * weather
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
            block = messages(self.rows[part], self.rate, begin)
            stream.update(block)
            stream.take_temperature(block.header_ns, self.celsius[part])
            if rng.random() < 0.2:
                stream = Characterization.from_state(stream.to_state())
            begin = part.stop
        return stream.result()


def is_right(night, result, name):
    """Tell whether words and numbers of an axis are those of its causes."""
    axis, why = result.axes[name], night.causes[name]
    said = {remark.code for remark in result.warnings if name in remark.axes} & WORDS
    unclear = 'walk' in why and 'trend_or_walk' in said
    if said - {'trend_or_walk'} != {word for cause, word in FOUND.items() if cause in why}:
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
        right += [abs(heat.per_kelvin / (PER_KELVIN * truth[B]) - 1) < 0.2,
                  heat.lag_s is not None and abs(heat.lag_s - LAG) < 100]
    return all(right)


def slammed(night, result):
    """Tell whether the door, and nothing else, was cut out."""
    [cut] = result.timeline.motion
    return cut.start_s < night.slam < cut.start_s + cut.duration_s and cut.duration_s < 60


@pytest.mark.parametrize('why', [*FOUND, '', 'walk', EVERYTHING])
def test_each_cause_alone_and_all_together_are_reported_by_their_own_words(why):
    night = Night(3, 8, {'gyro_x': why}, 1)
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
    print(f'right: {sum(right)} of {len(right)} axes')
    assert np.mean(right) >= 0.9
