# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Segments of a record: their spectra, in constant memory, and what they add up to."""

from characterized import taken_in
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.record.estimator import CHUNK
from imu_allan.noise.record.part_of_record import Part, part_cells
from imu_allan.noise.record.segments import SEGMENTS, Segments, SHORTEST_SEGMENT
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

SENSOR = {'noise_density': 1e-3, 'bias_instability': 1e-3, 'rate_random_walk': 1e-4}
DT = 0.01


@pytest.fixture(scope='module')
def finished():
    return taken_in(simulate(SENSOR, 600_000, 100, 4)).finished().periodogram


def test_a_segment_begins_where_the_estimator_takes_samples_in():
    assert SHORTEST_SEGMENT == CHUNK


@pytest.mark.parametrize('samples', [100, 20_000, 16 * CHUNK, 16 * CHUNK + 1, 3_000_000])
def test_there_are_never_more_than_sixteen_segments_and_all_samples_are_in_them(samples):
    segments = Segments(2)
    for begin in range(0, samples, CHUNK):
        rows = np.zeros((2, min(CHUNK, samples - begin)))
        segments.absorb(rows, [(256, 1, np.ones((2, 256)))])
    assert segments.samples == samples
    assert (segments.used - 1) * segments.width < samples <= segments.used * segments.width
    assert segments.used <= SEGMENTS
    # The slower transform of a constant is zero: what stands here came in as blocks.
    assert segments.power.sum() / 2 == segments.dof.sum() - segments.dof[:, :32].sum()


def test_any_part_of_a_record_gives_the_coefficients_of_the_whole(finished):
    used = finished.segments.used
    for first, last in ((0, used), (0, used // 2), (used // 2, used), (3, 5)):
        groups = Part(finished, DT, first, last).groups(0)
        assert (np.diff(groups.frequency) > 0).all()
        _, density, flicker, _ = np.sqrt(maximise(groups, moving_mean=True).theta)
        assert density == pytest.approx(SENSOR['noise_density'], rel=0.03)
        assert flicker == pytest.approx(SENSOR['bias_instability'], rel=0.35)


def test_parts_share_out_samples_and_cells(finished):
    used = finished.segments.used
    cells = [part_cells(finished, number, number + 1) for number in range(used)]
    assert sum(len(part) for part in cells) == len(finished.series)
    for part in cells[:-1]:
        assert part.counts.sum() == finished.segments.width


def test_the_part_whose_noise_is_higher_has_the_higher_spectrum():
    record = simulate({'noise_density': 1e-3}, 400_000, 100, 4)
    record[:200_000] *= 2
    periodogram = taken_in(record).finished().periodogram
    used, white = periodogram.segments.used, 1e-6
    ratios = [np.average(groups.power / (groups.design[:, 1] * white), weights=groups.dof)
              for groups in (Part(periodogram, DT, number, number + 1).groups(0)
                             for number in range(used))]
    np.testing.assert_allclose(ratios[:6], 4, rtol=0.05)
    np.testing.assert_allclose(ratios[7:], 1, rtol=0.05)


def test_bands_of_lines_are_left_out(finished):
    groups = Part(finished, DT, 0, 4).groups(0, lines_hz=[17.0])
    assert not ((groups.frequency > 15.5) & (groups.frequency < 18.5)).any()
    assert ((groups.frequency > 13) & (groups.frequency < 15)).any()


def test_a_record_too_short_for_blocks_is_one_part():
    periodogram = taken_in(simulate(SENSOR, 5000, 100, 4)).finished().periodogram
    groups = Part(periodogram, DT, 0, 1).groups(0)
    assert groups.dof.sum() == 4999


def test_merged_segments_stay_those_of_the_cells():
    one, other = (taken_in(simulate(SENSOR, samples, 100, 4)) for samples in (300_000, 100_000))
    one.merge(other)
    segments = one.periodogram.segments
    assert segments.samples == 400_000
    assert segments.dof.sum() == pytest.approx(400_000, rel=0.01)
    assert sum(part_cells(one.periodogram, number, number + 1).counts.sum()
               for number in range(segments.used)) == 400_000
