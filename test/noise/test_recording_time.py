# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How long to record: until a term shows, an interval halves, or a unit is decided on."""

from characterized import B, K, messages, N, simulated, state_of
from imu_allan.characterization import Characterization
from imu_allan.datasheet import next_look
from imu_allan.noise import spectrum
from imu_allan.noise.recording_time import further_times
from imu_allan.noise.sequential import SMALLEST_RECORD
from imu_allan.sensor.noise_model import parse_model
import numpy as np
import pytest
from repeated import slow
from scipy.optimize import brentq

KEYS = (N, B, K)
SHAPES = (spectrum.white, spectrum.flicker, spectrum.random_walk)
DT = 0.5
LENGTH = 1000.0
SENSOR = {N: 1.0, B: 0.05, K: 0.002}
RATE_HZ = 100.0
DENSITY = 1e-3


def standard_errors(coefficients, duration):
    """Cramer-Rao bound of the squared coefficients, summed over every mode."""
    n = int(duration / DT)
    nu = np.arange(1, n) / (2 * n)
    columns = np.array([shape(nu, DT) for shape in SHAPES])
    relative = columns / sum(coefficients.get(key, 0.0) ** 2 * column
                             for key, column in zip(KEYS, columns, strict=True))
    scale = np.sqrt(np.diag(relative @ relative.T / 2))
    inverse = np.linalg.inv(relative @ relative.T / 2 / np.outer(scale, scale))
    return dict(zip(KEYS, np.sqrt(np.diag(inverse)) / scale, strict=True))


def whole_time(coefficients, key, wanted):
    """Solve for the length of record at which the standard error is as wanted."""
    def excess(log_duration):
        return np.log(standard_errors(coefficients, np.exp(log_duration))[key] / wanted)
    return np.exp(brentq(excess, np.log(LENGTH), np.log(LENGTH * 128), xtol=1e-3))


@pytest.mark.parametrize('absent', [None, *KEYS[1:]])
def test_halving_takes_as_long_as_the_fisher_information_says(absent):
    coefficients = {key: 0.0 if key == absent else value for key, value in SENSOR.items()}
    found = further_times(coefficients, dict.fromkeys(KEYS, True), DT, LENGTH)
    for key in KEYS:
        expected = None
        if coefficients[key]:
            whole = whole_time(coefficients, key, standard_errors(coefficients, LENGTH)[key] / 2)
            # Between octaves of the length it is interpolated.
            expected = pytest.approx(whole - LENGTH, abs=.04 * whole)
        assert found[key] == expected, key


@pytest.mark.parametrize(('key', 'value'), [(B, 0.05), (K, 0.002)])
def test_a_term_is_expected_once_it_is_as_many_standard_errors_as_make_it_observable(key, value):
    coefficients = {N: 1.0, key: value}
    found = further_times(coefficients, {N: True}, DT, LENGTH)
    # Of a square that is zero 2 standard errors come once in 40 records, 3.5 once in 4000.
    first, last = (whole_time(coefficients, key, value**2 / errors) for errors in (2.0, 3.5))
    assert first > LENGTH
    assert first < LENGTH + found[key] < last


@pytest.mark.thorough
@pytest.mark.parametrize(('key', 'value'), [(B, 3e-4), slow(K, 1e-4)])
def test_a_term_shows_by_then_in_most_records(key, value):
    coefficients = {N: 1e-3, key: value}
    wait = further_times(coefficients, {N: True}, 0.05, 60.0)[key]
    samples = round((60 + wait) * 20)
    # Nor does it show in most records a sixth of that length.
    for count, lowest, highest in ((samples, 0.25, 1.01), (samples // 6, -0.01, 0.5)):
        seen = [axis.coefficients[key].observable
                for axis in simulated(coefficients, count, 20.0, range(10))]
        assert lowest < np.mean(seen) < highest


def decided(seed, limit, most=20_000):
    """Watch white noise until it is decided; return the verdict and after how many samples."""
    rows = np.full((most, 6), np.nan)
    rows[:, 0] = np.random.default_rng(seed).normal(0, DENSITY * RATE_HZ**0.5, most)
    model = parse_model(f'gyro: {{x: {{noise_density: {limit} rad/s/sqrt(Hz)}}}}')
    stream, found, done = Characterization(kind='topic', topic='/imu'), None, 0
    while done < most and not (found and found.decided):
        part = slice(done, min(most, next_look(done)))
        stream.update(messages(rows[part], RATE_HZ, done, gyro_alone=True))
        found, done = state_of(stream, model), part.stop
    [verdict] = found.verdicts
    return verdict.verdict, done


@pytest.mark.parametrize(('share', 'verdict'), [
    (0.01, 'pass'), (0.7, 'pass'), (1.4, 'fail'), (5.0, 'fail'), (1000.0, 'fail')])
def test_what_is_clear_is_decided_at_the_first_look(share, verdict):
    assert decided(1, DENSITY / share) == (verdict, SMALLEST_RECORD)


# Of ten at 5 % each way more than three come once in eighty; 28 is two standard deviations above.
@pytest.mark.parametrize(('records', 'either', 'both'), [(10, 3, 3), slow(400, 28, 56)])
def test_at_the_limit_either_word_is_said_in_one_case_of_twenty(records, either, both):
    words, samples = zip(*(decided(seed, DENSITY) for seed in range(records)), strict=True)
    assert max(words.count('pass'), words.count('fail')) <= either
    assert words.count('pass') + words.count('fail') <= both
    assert max(samples) < 20_000
