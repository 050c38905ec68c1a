# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""An axis that gives small values as zero, or whose output is cut off, and noise that does not."""

from characterized import joint_fits, one_axis, shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.faults import clipping, deadband
from imu_allan.noise.record.census import BINS_PER_OCTAVE, end_of_hole
import numpy as np
import pytest
from repeated import slow

WHITE = np.random.default_rng(7).normal(size=30_000)


def interpolated(samples, share, rng=None):
    """Fill in missing samples as the timeline does: by the mean of others on both sides."""
    missing = (rng or np.random.default_rng(8)).random(samples.shape) < share
    around = np.convolve(samples, np.full(16, 1 / 16), 'same')
    return np.where(missing, around, samples), np.flatnonzero(missing)


def without_small(samples, width):
    return np.where(np.abs(samples) < width, 0.0, samples)


@pytest.mark.parametrize('width', [0.25, 0.5, 1.0, 2.0, 2.5])
@pytest.mark.parametrize('step', [1e-4, 0.02, 0.1])
@pytest.mark.parametrize('mean', [0.0, 0.4])
def test_a_deadband_is_reported(width, step, mean):
    for unit in (1e-5, 1.0):
        stepped = step * np.round((WHITE + mean) / step)
        found = deadband(shown(unit * without_small(stepped, width)), 0)
        assert found.width == pytest.approx(unit * width, rel=0.1, abs=unit * step)
        assert found.share == np.mean(np.abs(stepped) < width)
        assert deadband(shown(unit * stepped), 0) is None


def rounded_noise():
    rng = np.random.default_rng(3)
    for rounded in (np.round, np.trunc, np.floor):
        for sigma in np.geomspace(0.1, 30, 40):
            rows = sigma * rng.normal(size=(4000, 20)) + rng.uniform(-2, 2, 20)
            rows[2000:2040] *= rng.choice([1, 30], 20)
            for unit in (1.0, np.deg2rad(0.061)):
                yield (rounded(rows) * unit).astype(np.float32)


def values_off_the_steps_of_the_others():
    rng = np.random.default_rng(6)
    for unit in (1.0, 2**0.125, 0.069282):
        samples = np.round(0.8 * WHITE[:6000]) * unit
        samples[:12] = unit * rng.uniform(0.5, 0.99, 12)
        # Steps that differ in their last digits, about the border of a bin.
        yield samples * (1 + 1e-13 * rng.normal(size=6000))


def whole_values_about_a_mean_off_zero():
    rng = np.random.default_rng(8)
    for sigma, mean in ((3, 6.5), (4, 8), (6, 11), (8, 14), (12, 18)):
        for offset in (-0.4, 0.0, 0.3):
            samples = 0.00106 * np.rint(mean + offset + sigma * WHITE[:9000])
            for share in (0.0, 0.02, 0.05, 0.1):
                yield interpolated(samples, share, rng)


def mixed_by_a_matrix():
    rng = np.random.default_rng(10)
    for sigma in (0.8, 1.5, 3):
        for _ in range(10):
            yield np.rint(sigma * WHITE.reshape(-1, 3)) @ (np.eye(3) + 0.01 * rng.normal(
                size=(3, 3)))


def noise_of_many_lengths(*lengths):
    # About 320 samples in steps of 1 sigma end in a cell of 6 % of them in one record of ten.
    for samples in lengths:
        rng = np.random.default_rng(samples)
        for step in (0.3, 1.0):
            rows = rng.normal(size=(samples, min(2_000_000 // samples, 300)))
            rows += rng.choice([0.0, 1.0, 30.0], rows.shape[1]) * np.exp(
                -8 * np.linspace(0, 1, samples))[:, None]
            yield step * np.round(rows / step + rng.uniform(size=rows.shape[1]))


def vibrations():
    # Most samples of a sine stand at its ends; a sixth of a period makes neighbours differ much.
    time = np.arange(len(WHITE))
    yield np.transpose([np.round(30 * np.sin(2 * np.pi * time / cycle) + 0.3 * WHITE)
                        for cycle in (6.3, 41.7, 900.0)])
    # Above noise below a step: in a short record its means over no time are free of it.
    choice = np.random.default_rng(3)
    for _ in range(100):
        cycle, sigma = 1 / choice.uniform(0.005, 0.45), choice.uniform(0.15, 0.6)
        yield np.round(choice.uniform(20, 60) * np.sin(2 * np.pi * np.arange(6000) / cycle)
                       + choice.normal(0.0, sigma, 6000))


def few_samples_off_the_steps():
    samples = np.diff(5.0 * np.round((np.cumsum(WHITE + 1.0)) / 5.0), prepend=0.0)
    samples[0] = 0.37
    samples[5000::100] = samples[4996:-4:100] / 3
    yield from (samples[:5000], samples)


FIRST, SECOND = WHITE.reshape(2, -1)
NO_FAULT = {
    'noise in steps': (deadband, rounded_noise),
    'interpolated samples': (deadband, lambda: [interpolated(
        np.round(WHITE), 0.02, np.random.default_rng(5))]),
    'values off the steps of the others': (deadband, values_off_the_steps_of_the_others),
    'zeros in place of readings': (deadband, lambda: [np.transpose([np.where(
        np.random.default_rng(5).random(len(WHITE)) < 0.05, 0.0, WHITE + mean)
        for mean in (0.0, 2.0, 300.0)])]),
    'whole values about a mean off zero': (deadband, whole_values_about_a_mean_off_zero),
    'whole values printed with two decimals': (deadband, lambda: [np.transpose([
        unit * np.round(np.rint(mean + sigma * WHITE) / 65.5, 2) for unit in (1.0, np.pi / 180)
        for sigma in (0.5, 1, 2, 3.3, 8, 20) for mean in (0.4, 1, 3, 5)])]),
    'a rotated coarse output': (deadband, lambda: [np.transpose([
        np.cos(angle) * np.rint(sigma * FIRST) - np.sin(angle) * np.rint(sigma * SECOND)
        for angle in np.deg2rad([5, 10, 20, 30, 40, 45]) for sigma in (0.5, 0.8, 1.5, 3)])]),
    'a coarse output that a matrix mixes': (deadband, mixed_by_a_matrix),
    'steps of records of any length': (clipping, lambda: noise_of_many_lengths(100, 320, 10_000)),
    'steps of records of more lengths': (clipping, lambda: noise_of_many_lengths(64, 1000)),
    'vibrations': (clipping, vibrations),
    'few samples off the steps': (clipping, few_samples_off_the_steps)}


@pytest.mark.parametrize('name', [
    pytest.param('noise in steps', marks=pytest.mark.thorough),
    *(slow(name) if 'more' in name else name for name in NO_FAULT if name != 'noise in steps')])
def test_what_is_no_fault_is_not_reported_as_one(name):
    fault, records = NO_FAULT[name]
    for record in records():
        finished = shown(*record) if isinstance(record, tuple) else shown(record)
        assert [axis for axis in range(finished.axes) if fault(finished, axis)] == []


def test_an_output_that_steps_is_looked_at_no_longer_than_it_takes():
    noise = 3 * np.random.default_rng(8).normal(size=400_000)
    stepped = shown(np.round(noise))
    assert deadband(stepped, 0) is None
    assert stepped.census.zeros[0] == np.count_nonzero(np.round(noise) == 0)
    ones = np.count_nonzero(np.abs(np.round(noise)) == 1)
    assert 10_000 < stepped.census.sizes[0].max() < 0.5 * ones
    # A deadband of two steps has values between one and two of its widths.
    narrow = shown(without_small(np.round(2 * noise) / 2, 1.0))
    assert deadband(narrow, 0).width == pytest.approx(1.0)
    assert narrow.census.sizes[0].max() > 0.5 * np.count_nonzero(np.abs(np.round(2 * noise)) == 2)


@pytest.mark.parametrize('mean', [0.0, 0.004])
def test_a_deadband_is_reported_despite_losses(mean):
    samples = without_small(1e-4 * np.rint(30 * WHITE[:9000] + 1e4 * mean), 0.0015)
    for share in (0.0, 0.02, 0.05) if mean else (0.0, 0.02, 0.05, 0.1):
        found = deadband(shown(*interpolated(samples, share, np.random.default_rng(9))), 0)
        assert found.width == pytest.approx(0.0015, rel=0.2)


@pytest.mark.parametrize('level', [0.0, 0.5, 1.5, 2.2])
@pytest.mark.parametrize('step', [1e-3, 0.1, 0.25])
def test_a_clipped_axis_is_reported_at_either_end(level, step):
    stepped = step * np.round(WHITE / step)
    top = step * round(level / step)
    for sign in (1, -1):
        found = clipping(shown(sign * np.minimum(stepped, top)), 0)
        assert found.value == pytest.approx(sign * top)
        assert found.share == pytest.approx(np.mean(stepped >= top), rel=1e-9)
        assert found.is_highest == (sign == 1)
    assert clipping(shown(stepped), 0) is None


def test_noise_clipped_at_two_and_a_half_sigma_is_reported():
    rows = np.random.default_rng(4).normal(size=(20_000, 48))
    finished = shown(np.clip(rows, -2.5, 2.5))
    assert all(clipping(finished, axis) is not None for axis in range(48))


@pytest.mark.parametrize('share', [0.02, 0.1, 0.4])
@pytest.mark.parametrize('step', [1.5, 2.0, 3.0])
def test_steps_above_the_noise_are_not_cut_off_where_samples_are_missing(share, step):
    for offset in (0.0, 0.2, 0.4):
        samples, missing = interpolated(step * np.round(WHITE[:6000] / step + offset), share)
        finished = shown(samples, missing)
        assert clipping(finished, 0) is None
        assert finished.census.step[0] == step


@pytest.mark.parametrize('share', [0.02, 0.1, 0.4])
def test_a_clipped_axis_is_reported_where_samples_are_missing_with_its_share_of_those_there(share):
    clipped = np.minimum(0.1 * np.round(WHITE / 0.1), 1.0)
    samples, missing = interpolated(clipped, share)
    found = clipping(shown(samples, missing), 0)
    assert found.value == pytest.approx(1.0)
    assert found.share == np.mean(np.delete(clipped, missing) == clipped.max())


def test_an_axis_at_fault_has_no_fit_and_is_left_out_of_a_joint_one():
    three = np.stack((WHITE, without_small(WHITE, 1.0), np.minimum(WHITE, 1.0)), axis=1)
    assert [fit is None for fit in fit_axes(shown(three), 0.01)] == [False, True, True]
    good, bad = shown(WHITE[:9000]), shown(np.minimum(WHITE[9000:18_000], 1.0))
    alone, beside = (one_axis(good, 100, joint_fits(records, 0.01))[0]
                     for records in ([good], [good, bad]))
    assert alone.coefficients == beside.coefficients


def test_zeros_and_ends_add_up_over_records():
    rows = np.minimum(without_small(WHITE, 0.4) + 0.0, 0.5)
    whole, merged = shown(rows), shown(rows[:9001])
    merged.merge(shown(rows[9001:]))
    for census in (whole.census, merged.census):
        assert census.at_ends[:, 0].tolist() == [1, np.count_nonzero(WHITE >= 0.5)]
        assert census.zeros.tolist() == [np.count_nonzero(rows == 0)]
    upto = end_of_hole(whole.census.sizes[0]) + BINS_PER_OCTAVE + 1
    assert merged.census.sizes[:, :upto].sum() == whole.census.sizes[:, :upto].sum() > 0
    assert deadband(merged, 0).width == pytest.approx(0.4, rel=0.1)
    # A new extreme begins the count anew.
    merged.merge(shown(np.array([11.0, 11.0, -11.0])))
    assert merged.census.at_ends[:, 0].tolist() == [1, 2]
    merged.update([12.0])
    assert merged.finished().census.at_ends[:, 0].tolist() == [1, 1]
