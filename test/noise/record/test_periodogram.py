# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the spectrum: each what it says, together the whole band and nothing twice."""

from characterized import shown
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.record.estimator import CHUNK
from imu_allan.noise.record.part_of_record import Part
from imu_allan.noise.record.periodogram import Periodogram, SERIES, SHORTEST
from imu_allan.noise.record.segments import BLOCK
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.fft import dct


def periodogram_of(rows):
    """Absorb samples in the chunks in which an estimator does."""
    spectrum = Periodogram(len(rows))
    for first in range(0, rows.shape[1], CHUNK):
        spectrum.absorb(rows[:, first:first + CHUNK], 0, first)
    spectrum.finish()
    return spectrum


def power_of_blocks(rows, length):
    count = rows.shape[1] // length
    blocks = rows[:, :count * length].reshape(len(rows), count, length)
    return (dct(blocks, norm='ortho')**2).mean(axis=1)


@pytest.mark.parametrize('samples', [16, 1000, SERIES, SERIES + 1, 300_001, 2_500_000])
def test_all_degrees_of_freedom_are_used_once_and_the_band_has_no_hole(samples):
    sections = periodogram_of(np.random.default_rng(0).normal(size=(1, samples))).sections()
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
    sections = periodogram_of(rows).sections()
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


SENSOR = {'noise_density': 1e-3, 'bias_instability': 1e-3, 'rate_random_walk': 1e-4}
DT = 0.01


@pytest.fixture(scope='module')
def finished():
    return shown(simulate(SENSOR, 600_000, 100, 4)).periodogram


def test_any_part_of_a_record_gives_the_coefficients_of_the_whole(finished):
    used = finished.segments.used
    assert used <= 16
    for first, last in ((0, used), (0, used // 2), (used // 2, used), (3, 5)):
        groups = Part(finished, DT, first, last).groups(0)
        assert (np.diff(groups.frequency) > 0).all()
        _, density, flicker, _ = np.sqrt(maximise(groups, moving_mean=True).theta)
        assert density == pytest.approx(SENSOR['noise_density'], rel=0.03)
        assert flicker == pytest.approx(SENSOR['bias_instability'], rel=0.35)
        # In bands of an eighth of an octave.
        fast = groups.frequency[groups.frequency > 1]
        np.testing.assert_allclose(np.diff(np.log2(fast)), 1 / 8, atol=0.01)
    # Bands of lines are left out.
    groups = Part(finished, DT, 0, 4).groups(0, lines_hz=[17.0])
    assert not ((groups.frequency > 15.5) & (groups.frequency < 18.5)).any()
    assert ((groups.frequency > 13) & (groups.frequency < 15)).any()
