# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from characterized import shown
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.groups import grouped
from imu_allan.noise.terms import line_avar, line_power
from imu_allan.noise.tones import find_lines, higher_side, is_alias, rises, split_lines
from imu_allan.result import Tone
import numpy as np
import pytest
from scipy.signal import firwin, lfilter

DT = 0.01


def parts_of(samples):
    return shown(samples).periodogram.sections()


def lines_of(samples, sections=None):
    sections = parts_of(samples) if sections is None else sections
    bins = bins_of(sections, DT)
    return find_lines(sections, bins, 0, DT, grouped(bins, 0))


@pytest.mark.parametrize(('frequency', 'size', 'samples', 'error'), [
    (3.21, 0.5, 8192, 0.2), (17.0, 0.5, 8192, 0.2), (44.4, 0.5, 8192, 0.2),
    # Ten times the noise in the bin of the tone; five bins are added up.
    (17.003, 0.1, 100_000, 0.1)])
@pytest.mark.parametrize('unit', [1e-12, 1.0, 1e12])
def test_a_sharp_line_is_found_with_its_amplitude_in_any_unit_and_its_bins_are_left_out(
        frequency, size, samples, error, unit):
    noise = np.random.default_rng(1 if samples == 8192 else 6).normal(size=samples)
    tone = size * np.sin(2 * np.pi * frequency * np.arange(samples) * DT + 0.3)
    [line], keep = lines_of(unit * (noise + tone))
    assert line.frequency_hz == pytest.approx(frequency, abs=max(1 / (samples * DT), 0.01))
    assert line.amplitude == pytest.approx(unit * size, rel=error)
    assert 0 < (~keep).mean() < 0.02


@pytest.mark.parametrize('frequency', [8.3, 17.0, 44.4])
def test_bins_of_a_line_are_left_out_of_long_and_short_blocks_and_no_others(frequency):
    # 7 blocks of 4096 and one each of 2048, 1024 and 512 at the end.
    time = np.arange(7 * 4096 + 3584) * DT
    noise = np.random.default_rng(1).normal(size=len(time))
    samples = noise + 2 * np.sin(2 * np.pi * frequency * time)
    sections = parts_of(samples)
    bins, (lines, keep) = bins_of(sections, DT), lines_of(samples, sections)
    assert lines[0].frequency_hz == pytest.approx(frequency, abs=0.01)
    fine = [number for number, section in enumerate(sections) if section.step == 1]
    assert {sections[number].length for number in fine} >= {4096, 2048, 1024, 512}
    for number in fine:
        here = bins.section == number
        width = 1 / (2 * sections[number].length * DT)
        near = here & (np.abs(bins.frequency - frequency) < 3 * width)
        assert near.any()
        assert not keep[near].any()
        assert keep[here & (np.abs(bins.frequency - frequency) > 2.5)].all()


@pytest.mark.parametrize('amplitude', [0.1, 0.3])
def test_the_power_of_eighty_lines_is_in_those_named_and_the_sums_of_the_others(amplitude):
    rng = np.random.default_rng(1)
    time = np.arange(360_000) * DT
    sizes = amplitude * np.exp(rng.normal(0, 0.4, 80))
    samples = rng.normal(size=len(time))
    for frequency, size in zip(rng.uniform(0.6, 45.0, 80), sizes, strict=True):
        samples += size * np.sin(2 * np.pi * frequency * time + rng.uniform(0, 6))
    lines, keep = lines_of(samples)
    assert keep.mean() > 0.5
    named, weaker = split_lines(lines)
    assert len(named) == 32
    # Neighbours closer than the resolution of a block are one.
    assert len(lines) == 32 + sum(tone.lines for tone in weaker) == pytest.approx(80, abs=6)
    power = sum(tone.amplitude**2 for tone in named + weaker)
    assert power == pytest.approx(sum(sizes**2), rel=0.1)


def test_a_sum_of_lines_leaves_in_averages_what_they_leave():
    lines = [Tone(frequency, 0.1) for frequency in np.linspace(1.0, 30.0, 300)]
    _, weaker = split_lines(lines)
    tau = np.geomspace(0.05, 3000.0, 200)
    each = sum(line_avar(line.frequency_hz, 0.1, tau) for line in lines[32:])
    summed = sum(line_avar(tone.frequency_hz, tone.amplitude, tau, tone.lines) for tone in weaker)
    exact = line_power(tuple(lines[32:]), tau)
    for here in (tau < 0.2, (tau > 0.2) & (tau < 3), tau > 3):
        assert np.mean(summed[here]) == pytest.approx(np.mean(each[here]), rel=0.1)
        assert np.mean(line_power(weaker, tau)[here]) == pytest.approx(
            np.mean(exact[here]), rel=0.1)


@pytest.mark.parametrize(('blocks', 'scale', 'height', 'expected'), [
    # Of so many blocks that chance allows a thousandth.
    (10**7, 1, 1.25, False), (10**7, 1, 1.35, True), (10**7, 8, 1.45, False),
    (10**7, 8, 1.55, True), (10**7, 32, 1.45, False), (10**7, 32, 1.55, True),
    # What chance allows depends on all that is averaged.
    (16, 8, 2.1, True), (2, 8, 2.1, False), (128, 1, 2.1, True), (16, 1, 2.1, False)])
def test_what_rises_by_less_than_chance_allows_or_anyone_cares_about_is_no_line(
        blocks, scale, height, expected):
    ratio = np.ones(200 * scale)
    ratio[100 * scale:103 * scale] = height
    found = rises(ratio, blocks, scale)
    assert [place[:2] for place in found] == [(100 * scale, 103 * scale)][:expected]
    assert all(floor == pytest.approx(1, rel=0.1) for *_, floor in found)


@pytest.mark.parametrize(('frequency', 'image', 'step'), [
    (1.3, 0.3, 100), (1.3, 1.3 - 1 / 1.1, 110), (4.9, 0.1, 100)])
def test_a_line_folded_by_a_lower_rate_is_known_again(frequency, image, step):
    left = abs(np.sinc(frequency * step * DT))
    lines = [Tone(17.4, 1.0), Tone(frequency, 1.0)]
    assert is_alias(Tone(image, left), lines, step, DT, 0.01)
    assert not is_alias(Tone(image + 0.02, left), lines[1:], step, DT, 0.01)
    # Means leave little of it: what is larger is a line of its own.
    assert not is_alias(Tone(image, 3 * left), lines[1:], step, DT, 0.01)


def test_no_line_is_sought_among_too_few_neighbours_or_twice():
    ratio = np.ones(200)
    ratio[100] = 1e6
    assert rises(ratio, 1, 1) == []
    assert len(rises(np.concatenate((ratio, np.ones(200))), 1, 1)) == 1
    ratio = np.ones(8 * 200)
    ratio[8 * 100:8 * 103] = 5.0
    ratio[8 * 50:8 * 53] = np.nan
    assert [(begin, end) for begin, end, _ in rises(ratio, 10**7, 8)] == [(800, 824)]
    ratio[8 * 100:8 * 103] = np.nan
    assert rises(ratio, 10**7, 8) == []
    # In a part of a few bins.
    samples = np.random.default_rng(1).normal(size=8192) + np.sin(
        2 * np.pi * 17.0 * np.arange(8192) * DT)
    [section] = parts_of(samples)
    lines, keep = lines_of(samples, [replace(section, first=2 * 1383, last=2 * 1403)])
    assert lines == []
    assert keep.all()


def test_what_is_broad_is_held_against_the_higher_of_both_sides():
    # Behind the knee the left side is the higher one, as far as the left side reaches.
    level = np.where(np.arange(400) < 200, 2.0, 1.0)
    higher = higher_side(level, 65)
    assert (higher[:200] == 2).all()
    [edge] = np.flatnonzero(np.diff(higher)) + 1
    # Half of the 33 neighbours on the left are in front of the knee.
    assert edge == 200 + 33 // 2
    np.testing.assert_array_equal(higher_side(level[::-1], 65), higher[::-1])


@pytest.mark.parametrize('response', [
    [1.0], np.full(8, 1 / 8), firwin(31, 0.3), firwin(63, 0.15)])
def test_white_noise_and_side_lobes_of_a_filter_are_no_lines(response):
    noise = np.random.default_rng(4).normal(size=300_000)
    lines, keep = lines_of(lfilter(response, 1, noise)[100:])
    assert lines == []
    assert keep.all()
