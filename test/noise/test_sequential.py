# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A unit on the bench is decided on as soon as that is certain, and seldom wrongly."""

from characterized import messages
from imu_allan.characterization import Characterization
from imu_allan.noise.sequential import SMALLEST_RECORD
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet.live import check_state, next_look
import numpy as np
import pytest

RATE_HZ = 100.0
DENSITY = 1e-3


def look(stream, limit, margin=0.1):
    """Say how a gyroscope stands against a limit of its density: a word, and whether done."""
    model = parse_model(f'gyro: {{x: {{noise_density: {limit} rad/s/sqrt(Hz)}}}}')
    found = check_state(stream, model, margin=margin)
    [verdict] = found.verdicts
    return verdict.verdict, found.decided


def taken_in(stream, samples, first=0):
    """Take samples of one axis into a stream, the first so many being there already."""
    rows = np.full((len(samples), 6), np.nan)
    rows[:, 0] = samples
    stream.update(messages(rows, RATE_HZ, first, gyro_alone=True))
    return stream


def decided(seed, limit, most=20_000, margin=0.1):
    """Watch white noise until it is decided; return the verdict and after how many samples."""
    samples = np.random.default_rng(seed).normal(0, DENSITY * RATE_HZ**0.5, most)
    stream, done, word, over = Characterization(kind='topic', topic='/imu'), 0, '', False
    while not over and done < most:
        until = min(most, next_look(done))
        taken_in(stream, samples[done:until], done)
        done = until
        word, over = look(stream, limit, margin)
    return word, done


@pytest.mark.parametrize(('share', 'verdict'), [
    (0.01, 'pass'), (0.7, 'pass'), (1.4, 'fail'), (5.0, 'fail'), (1000.0, 'fail')])
def test_what_is_clear_is_decided_at_the_first_look(share, verdict):
    assert decided(1, DENSITY / share) == (verdict, SMALLEST_RECORD)


def test_at_the_limit_neither_word_is_said_but_the_test_ends():
    found = [decided(seed, DENSITY) for seed in range(10)]
    # Of ten at 5 % each way more than three would come once in eighty; the slow tests draw more.
    assert sum(word != 'cannot tell' for word, _ in found) <= 3
    assert max(samples for _, samples in found) < 20_000


@pytest.mark.slow
def test_either_wrong_word_is_said_in_at_most_one_case_of_twenty():
    found = [decided(seed, DENSITY)[0] for seed in range(400)]
    # Two standard deviations of 400 draws above 5 %.
    assert found.count('pass') <= 0.072 * 400
    assert found.count('fail') <= 0.072 * 400
