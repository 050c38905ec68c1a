# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the spectrum: each what it says, together the whole band and nothing twice."""

from imu_allan.noise.record.estimator import CHUNK
from imu_allan.noise.record.periodogram import Periodogram, SERIES, SHORTEST, Stage
from imu_allan.noise.record.segments import BLOCK
import numpy as np
import pytest
from scipy.fft import dct


def periodogram_of(*segments):
    """Absorb segments, pairs of run and samples, in the chunks in which an estimator does."""
    spectrum = Periodogram(segments[0][1].shape[0])
    for run, rows in segments:
        for first in range(0, rows.shape[1], CHUNK):
            spectrum.absorb(rows[:, first:first + CHUNK], run, first)
    spectrum.finish()
    return spectrum


def power_of_blocks(rows, length):
    count = rows.shape[1] // length
    blocks = rows[:, :count * length].reshape(len(rows), count, length)
    return (dct(blocks, norm='ortho')**2).mean(axis=1)


@pytest.mark.parametrize('samples', [16, 64, 1000, SERIES, SERIES + 1, 9000, 33_000, 300_001,
                                     524_289, 2_500_000])
def test_all_degrees_of_freedom_are_used_once_and_the_band_has_no_hole(samples):
    sections = periodogram_of((0, np.random.default_rng(0).normal(size=(1, samples)))).sections()
    used = sum(section.blocks * (section.last - section.first) for section in sections)
    # What the rest of less than a shortest block leaves out, and every block's own mean.
    assert samples - SHORTEST - samples / 500 < used < samples
    fastest = 1 / (2 * samples)
    for step in sorted({section.step for section in sections}, reverse=True):
        section = max((p for p in sections if p.step == step), key=lambda p: p.length)
        assert section.first / (2 * section.length * step) == pytest.approx(
            fastest, abs=0.51 / (section.length * step))
        fastest = section.last / (2 * section.length * step)
    assert fastest == pytest.approx(0.5, abs=1 / BLOCK if samples > SERIES else 1 / samples)


@pytest.mark.parametrize(('samples', 'expected'), [
    (1000, {(1, 1000)}), (SERIES, {(1, SERIES)}),
    (600_000, {(128, 4688), (64, BLOCK), (1, BLOCK), (1, BLOCK // 8)})])
def test_every_stage_holds_the_transforms_of_its_means(samples, expected):
    rows = np.random.default_rng(2).normal(size=(2, samples)) + np.array([[0.0], [3.0]])
    sections = periodogram_of((0, rows)).sections()
    assert {(section.step, section.length) for section in sections} >= expected
    assert len(sections) == 1 or samples > SERIES
    for section in sections:
        means = rows[:, :samples // section.step * section.step].reshape(
            2, -1, section.step).mean(axis=2)
        part = slice(section.first, section.last)
        if section.coefficients is not None:
            # The last mean is of the half of a cell that there is.
            rest = rows[:, means.shape[1] * section.step:]
            if rest.size:
                means = np.column_stack((means, rest.mean(axis=1)))
            exact = dct(means, norm='ortho')[:, part]
            np.testing.assert_allclose(section.coefficients[:, part], exact, atol=1e-10)
            np.testing.assert_allclose(section.power[:, part], exact**2, atol=1e-8)
        elif section.length == BLOCK:
            exact = power_of_blocks(means, BLOCK)
            np.testing.assert_allclose(section.power[:, part], exact[:, part], rtol=1e-9)
            assert section.blocks == means.shape[1] // BLOCK


def test_the_rest_of_a_segment_is_cut_into_ever_shorter_blocks():
    rows = np.random.default_rng(3).normal(size=(1, 2 * BLOCK + 1024 + 64 + 32 + 7))
    stage = Stage(1)
    stage.add(rows)
    assert {length: own.blocks for length, own in stage.sums.items()} == {
        BLOCK: 2, 1024: 1, 64: 1, 32: 1}
    start = 0
    for length, own in stage.sums.items():
        part = rows[:, start:start + own.blocks * length]
        np.testing.assert_allclose(own.power, own.blocks * power_of_blocks(part, length))
        start += own.blocks * length


def test_runs_are_neither_mixed_nor_lost():
    first, second = np.random.default_rng(4).normal(size=(2, 1, 40_000))
    both = periodogram_of((0, first), (1, second)).sections()
    alone = [periodogram_of((0, rows)).sections() for rows in (first, second)]
    fine = [next(p for p in sections if p.step == 1 and p.length == BLOCK)
            for sections in (both, *alone)]
    assert fine[0].blocks == 2 * fine[1].blocks == 18
    part = slice(max(p.first for p in fine), None)
    np.testing.assert_allclose(fine[0].power[:, part],
                               (fine[1].power + fine[2].power)[:, part] / 2)
    # The slowest part of each run is one of its own.
    assert sum(section.coefficients is not None for section in both) == 2
