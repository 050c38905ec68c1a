# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Segments of a record: their spectra, in constant memory, and what they add up to."""

from characterized import shown, taken_in
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.record.part_of_record import Part, part_cells
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

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


def test_parts_share_out_the_samples_of_one_and_of_merged_records(finished):
    one, other = (taken_in(simulate(SENSOR, samples, 100, 4)) for samples in (300_000, 100_000))
    one.merge(other)
    for whole, samples in ((one.periodogram, 400_000), (finished, 600_000)):
        segments = whole.segments
        cells = [part_cells(whole, number, number + 1) for number in range(segments.used)]
        assert segments.samples == samples == sum(part.counts.sum() for part in cells)
        assert sum(map(len, cells)) == len(whole.series)
        assert segments.dof.sum() == pytest.approx(samples, rel=0.01)
    assert all(part.counts.sum() == segments.width for part in cells[:-1])


def test_the_part_whose_noise_is_higher_has_the_higher_spectrum():
    record = simulate({'noise_density': 1e-3}, 400_000, 100, 4)
    record[:200_000] *= 2
    periodogram = shown(record).periodogram
    ratios = [np.average(groups.power / (groups.design[:, 1] * 1e-6), weights=groups.dof)
              for groups in (Part(periodogram, DT, number, number + 1).groups(0)
                             for number in range(periodogram.segments.used))]
    np.testing.assert_allclose(ratios[:6], 4, rtol=0.05)
    np.testing.assert_allclose(ratios[7:], 1, rtol=0.05)


def test_a_record_too_short_for_blocks_is_one_part():
    groups = Part(shown(simulate(SENSOR, 5000, 100, 4)).periodogram, DT, 0, 1).groups(0)
    assert groups.dof.sum() == 4999
