# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.groups import WHITE
from imu_allan.noise.sequential import decide, SMALLEST_RECORD
from imu_allan.noise.simulate import flicker
import numpy as np
import pytest

RATE_HZ = 100.0
DENSITY = 1e-3


def decided(seed, limit, most=20_000, margin=0.1):
    """Watch white noise until it is decided; return the decision and after how many samples."""
    samples = np.random.default_rng(seed).normal(0, DENSITY * RATE_HZ**0.5, most)
    estimator, done, look, decision = Estimator(), 0, SMALLEST_RECORD, 'open'
    while decision == 'open' and done < most:
        estimator.update(samples[done:look])
        done = look
        (found,) = fit_axes(estimator.finished(), 1 / RATE_HZ)
        decision = decide(found.fit.trial, WHITE, limit, margin=margin, pass_error=0.05,
                          fail_error=0.05)
        look = min(most, round(1.15 * done))
    return decision, done


@pytest.mark.parametrize(('share', 'decision'), [
    (0.01, 'below'), (0.7, 'below'), (1.4, 'above'), (5.0, 'above'), (1000.0, 'above')])
def test_what_is_clear_is_decided_at_the_first_look(share, decision):
    assert decided(1, DENSITY / share) == (decision, SMALLEST_RECORD)


def test_at_the_limit_neither_word_is_said_but_the_test_ends():
    found = [decided(seed, DENSITY) for seed in range(20)]
    # Of twenty at 5 % each way more than four would come once in a hundred.
    assert sum(decision != 'near' for decision, _ in found) <= 4
    assert max(samples for _, samples in found) < 20_000


def beside_slow_noise(seed, count, density=DENSITY):
    """Fit white noise that f^-0.7 crosses at 5 Hz."""
    rng = np.random.default_rng(seed)
    size = DENSITY * RATE_HZ**0.5 * (2 * np.pi * 5 / RATE_HZ)**0.35
    estimator = Estimator()
    estimator.update(rng.normal(0, density * RATE_HZ**0.5, count)
                     + size * flicker(count, rng, 0.7))
    (found,) = fit_axes(estimator.finished(), 1 / RATE_HZ)
    return found.fit.trial


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_what_slow_noise_of_another_exponent_adds_to_white_noise_fails_no_unit(seed):
    trial = beside_slow_noise(seed, 3_000)
    by_flicker, by_any = (decide(trial, WHITE, DENSITY, margin=0.1, pass_error=0.05,
                                 fail_error=0.05, dt=dt) for dt in (None, 1 / RATE_HZ))
    assert (by_flicker, by_any) == ('above', 'open')


def test_what_no_exponent_explains_fails_beside_slow_noise_too():
    trial = beside_slow_noise(1, 3_000, 1.5 * DENSITY)
    assert decide(trial, WHITE, DENSITY, margin=0.1, pass_error=0.05, fail_error=0.05,
                  dt=1 / RATE_HZ) == 'above'


def test_a_finer_margin_takes_longer():
    assert decided(3, DENSITY, margin=0.03)[1] > 3 * decided(3, DENSITY)[1]


@pytest.mark.slow
def test_either_wrong_word_is_said_in_at_most_one_case_of_twenty():
    found = [decided(seed, DENSITY)[0] for seed in range(400)]
    # Two standard deviations of 400 draws above 5 %.
    assert found.count('below') <= 0.072 * 400
    assert found.count('above') <= 0.072 * 400
