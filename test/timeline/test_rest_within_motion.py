# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that drives and stops, a drone before take-off: the rest is found and used."""

from io import StringIO

from imu_allan.writers.table import print_result
from imu_messages import said
import numpy as np
import pytest
from repeated import slow
from scenarios import at_rest, characterized, Messages, MOVES, SIGMA, Truth
from whole_lines import refused

RATE_HZ = 100.0


def driven(moving: str, times: float, duration_s: float = 400.0) -> tuple[Messages, Truth]:
    """Give messages that shake by `times` the noise, and sway, while a condition on t holds."""
    rng = np.random.default_rng(1)
    messages, truth = at_rest(round(duration_s * RATE_HZ), RATE_HZ, rng)
    time = messages.header
    drives = {'take-off after 10 s': time > 10, 'stops every 40 s': np.floor(time / 20) % 2 == 1,
              'drives first': (time < 120) | (np.floor(time / 20) % 4 != 1),
              'stops at the end': time < 290, 'throughout': time >= 0}[moving]
    messages.samples[drives] += rng.normal(size=(np.count_nonzero(drives), 6)) * times * SIGMA
    messages.samples[drives] += 0.3 * np.sin(2 * np.pi * 0.3 * time[drives])[:, None]
    return messages, truth


@pytest.mark.parametrize('times', [slow(5), 20])
@pytest.mark.parametrize(('moving', 'rest_s'), [
    ('take-off after 10 s', 8.5), ('stops every 40 s', 158), ('drives first', 46.5),
    ('stops at the end', 107)])
def test_what_is_at_rest_is_used_and_listed(moving, times, rest_s):
    messages, truth = driven(moving, times)
    result = characterized(messages)
    for axis in result.axes.values():
        density = axis.coefficients['noise_density']
        low, high = density.ci95
        assert low - (density.value - low) < truth.density < high + (high - density.value)
    found = said(result, 'rest_within_motion').values
    assert found['rest_s'] == pytest.approx(rest_s, rel=1e-3)
    if moving == 'drives first':
        assert found['starts_s'] == pytest.approx([183, 263, 343], abs=0.5)
        assert found['durations_s'] == pytest.approx([15.5] * 3, abs=0.05)
    assert sum(span.duration_s for span in result.timeline.motion) == pytest.approx(
        400 - rest_s, abs=0.6)


def test_rest_is_the_same_whatever_the_blocks_and_saves():
    messages, _ = driven('drives first', 20)
    whole = characterized(messages).to_dict()
    for seed in range(3):
        assert characterized(messages, np.random.default_rng(seed)).to_dict() == whole


def test_what_moves_throughout_is_refused():
    with refused(MOVES):
        characterized(driven('throughout', 20)[0])


def test_less_than_a_minute_of_rest_is_never_called_good():
    out = StringIO()
    print_result(characterized(driven('take-off after 10 s', 20)[0]), to=out)
    lines = out.getvalue().splitlines()
    assert ('40,000 samples at 100 Hz, 6 min 40 s, 8.5 s at rest; '
            '1 segment of motion (6 min 32 s)') in lines
    assert lines[:2] == [
        'Gyroscope: not usable: 8.5 s at rest.', 'Accelerometer: not usable: 8.5 s at rest.']
