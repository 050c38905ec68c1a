# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from characterized import characterized, N
from imu_allan.noise.tones import rises
import numpy as np
import pytest
from scipy.signal import butter, firwin, lfilter

RATE = 100.0


@pytest.mark.parametrize(('frequency', 'size', 'samples', 'error'), [
    (3.21, 0.5, 8192, 0.2), (44.4, 0.5, 8192, 0.2),
    # Ten times the noise in the bin of the tone; five bins are added up.
    (17.003, 0.1, 100_000, 0.1)])
@pytest.mark.parametrize('unit', [1e-12, 1.0, 1e12])
def test_a_sharp_line_is_found_with_its_amplitude(frequency, size, samples, error, unit):
    noise = np.random.default_rng(1 if samples == 8192 else 6).normal(size=samples)
    tone = size * np.sin(2 * np.pi * frequency * np.arange(samples) / RATE + 0.3)
    axis, _ = characterized(unit * (noise + tone), RATE)
    [line] = axis.tones
    assert line.frequency_hz == pytest.approx(frequency, abs=max(RATE / samples, 0.01))
    assert line.amplitude == pytest.approx(unit * size, rel=error)
    assert axis.coefficients[N].value == pytest.approx(0.1 * unit, rel=0.03)


@pytest.mark.parametrize('seed', range(3))
def test_side_lobes_of_a_strong_line_are_no_white_noise(seed):
    # They raise the floor beside the line, and reach farther in the shorter blocks at the end.
    samples = np.random.default_rng(seed).normal(size=22_000)
    tone = 10 * np.sin(2 * np.pi * 13.2 * np.arange(len(samples)) / RATE + seed)
    axis, _ = characterized(samples + tone, RATE)
    low, high = axis.coefficients[N].ci95
    assert low < 0.1 < high
    assert axis.coefficients[N].value == pytest.approx(0.1, rel=0.025)


def test_the_power_of_eighty_lines_is_found():
    rng = np.random.default_rng(1)
    time = np.arange(360_000) / RATE
    sizes = 0.1 * np.exp(rng.normal(0, 0.4, 80))
    samples = rng.normal(size=len(time))
    for frequency, size in zip(rng.uniform(0.6, 45.0, 80), sizes, strict=True):
        samples += size * np.sin(2 * np.pi * frequency * time + rng.uniform(0, 6))
    axis, _ = characterized(samples, RATE)
    assert axis.coefficients[N].value == pytest.approx(0.1, rel=0.03)
    # Neighbours closer than the resolution of a block are one.
    assert len(axis.tones) == pytest.approx(80, abs=6)
    power = sum(tone.amplitude**2 for tone in axis.tones)
    assert power == pytest.approx(sum(sizes**2), rel=0.1)


@pytest.mark.parametrize(('blocks', 'scale', 'height', 'expected'), [
    # Of so many blocks that chance allows a thousandth.
    (10**7, 1, 1.25, False), (10**7, 1, 1.35, True), (10**7, 8, 1.45, False),
    (10**7, 8, 1.55, True), (10**7, 32, 1.45, False), (10**7, 32, 1.55, True),
    # What chance allows depends on all that is averaged.
    (16, 8, 2.1, True), (2, 8, 2.1, False), (128, 1, 2.1, True), (16, 1, 2.1, False)])
def test_what_rises_less_than_chance_allows_is_no_line(blocks, scale, height, expected):
    ratio = np.ones(200 * scale)
    ratio[100 * scale:103 * scale] = height
    found = rises(ratio, blocks, scale)
    assert [place[:2] for place in found] == [(100 * scale, 103 * scale)][:expected]
    assert all(floor == pytest.approx(1, rel=0.1) for *_, floor in found)


@pytest.mark.parametrize('response', [
    *((each, 1) for each in ([1.0], np.full(8, 1 / 8), firwin(31, 0.3), firwin(63, 0.15),
                             firwin(255, 0.1), firwin(511, 0.4, window='boxcar'),
                             firwin(151, 0.02))),
    butter(2, 0.004), butter(4, 0.01)])
def test_white_noise_and_side_lobes_of_a_filter_are_no_lines(response):
    noise = np.random.default_rng(4).normal(size=300_000)
    axis, _ = characterized(lfilter(*response, noise)[4000:], RATE)
    assert axis.tones == ()


def test_a_line_of_changing_frequency_is_one_line():
    rng = np.random.default_rng(5)
    time = np.arange(360_000) / RATE
    frequency = 17.0 + np.interp(time, np.linspace(0, 3600, 40), rng.normal(0, 0.15, 40))
    tone = np.sin(2 * np.pi * np.cumsum(frequency) / RATE)
    axis, _ = characterized(rng.normal(size=len(time)) + 0.2 * tone, RATE)
    [line] = axis.tones
    assert line.frequency_hz == pytest.approx(17.0, abs=0.2)
    assert line.amplitude == pytest.approx(0.2, rel=0.2)
