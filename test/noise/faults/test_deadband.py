# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.faults.deadband import deadband
from imu_allan.noise.record.census import BINS_PER_OCTAVE, end_of_hole
from imu_allan.noise.record.estimator import Estimator
import numpy as np
import pytest

WHITE = np.random.default_rng(7).normal(size=30_000)


def without_small(samples, width):
    return np.where(np.abs(samples) < width, 0.0, samples)


@pytest.mark.parametrize('width', [0.25, 0.5, 1.0, 2.0, 2.5])
@pytest.mark.parametrize('step', [1e-4, 0.02, 0.1])
@pytest.mark.parametrize('mean', [0.0, 0.4])
def test_a_deadband_is_told(width, step, mean):
    for unit in (1e-5, 1.0):
        stepped = step * np.round((WHITE + mean) / step)
        found = deadband(shown(unit * without_small(stepped, width)), 0)
        assert found.width == pytest.approx(unit * width, rel=0.1, abs=unit * step)
        assert found.share == np.mean(np.abs(stepped) < width)
        assert deadband(shown(unit * stepped), 0) is None


@pytest.mark.thorough
@pytest.mark.parametrize('rounded', [np.round, np.trunc, np.floor])
def test_noise_in_steps_has_no_deadband(rounded):
    rng = np.random.default_rng(3)
    for sigma in np.geomspace(0.1, 30, 40):
        rows = sigma * rng.normal(size=(4000, 20)) + rng.uniform(-2, 2, 20)
        rows[2000:2040] *= rng.choice([1, 30], 20)
        for unit in (1.0, np.deg2rad(0.061)):
            finished = shown((rounded(rows) * unit).astype(np.float32))
            assert [axis for axis in range(20) if deadband(finished, axis)] == []


def test_samples_that_stand_in_for_missing_ones_make_and_hide_no_deadband():
    rng = np.random.default_rng(5)
    missing = rng.random(len(WHITE)) < 0.02
    for samples, there in ((without_small(WHITE, 1.0), True), (np.round(WHITE), False)):
        filled = np.where(missing, np.convolve(samples, np.full(16, 1 / 16), 'same'), samples)
        assert (deadband(shown(filled, np.flatnonzero(missing)), 0) is not None) == there


def test_values_off_the_steps_of_the_others_make_no_deadband():
    rng = np.random.default_rng(6)
    for unit in (1.0, 2**0.125, 0.069282):
        samples = np.round(0.8 * WHITE[:6000]) * unit
        samples[:12] = unit * rng.uniform(0.5, 0.99, 12)
        # Steps that differ in their last digits, about the border of a bin.
        samples *= 1 + 1e-13 * rng.normal(size=6000)
        assert deadband(shown(samples), 0) is None


def test_zeros_in_place_of_readings_are_no_deadband():
    lost = np.random.default_rng(5).random(len(WHITE)) < 0.05
    for mean in (0.0, 2.0, 300.0):
        assert deadband(shown(np.where(lost, 0.0, WHITE + mean)), 0) is None


def test_zeros_are_counted_however_samples_arrive():
    rows = without_small(WHITE, 1.0) + 0.0
    whole = shown(rows)
    bits = Estimator()
    for part in np.array_split(rows, 77):
        bits.update(part)
        bits = Estimator.from_state(bits.to_state()).copy().taken([0])
    merged = shown(rows[:9001])
    merged.merge(shown(rows[9001:]))
    bits = bits.finished()
    for other in (bits, merged):
        assert other.census.zeros.tolist() == whole.census.zeros.tolist()
    assert bits.census.sizes.tolist() == whole.census.sizes.tolist()
    upto = end_of_hole(whole.census.sizes[0]) + BINS_PER_OCTAVE + 1
    assert merged.census.sizes[:, :upto].sum() == whole.census.sizes[:, :upto].sum() > 0
    assert deadband(merged, 0).width == pytest.approx(1.0, rel=0.1)


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


def test_an_axis_with_a_deadband_has_no_fit():
    fits = fit_axes(shown(np.stack((WHITE, without_small(WHITE, 1.0)), axis=1)), 0.01)
    assert fits[0] is not None
    assert fits[1] is None


def with_losses(samples, share, rng):
    """Fill in missing samples as a bridge does: by the mean of others on both sides."""
    missing = rng.random(len(samples)) < share
    around = np.convolve(samples, np.full(16, 1 / 16), 'same')
    return shown(np.where(missing, around, samples), np.flatnonzero(missing))


@pytest.mark.parametrize('share', [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize(('sigma', 'mean'), [(3, 6.5), (4, 8), (6, 11), (8, 14), (12, 18)])
def test_whole_values_about_a_mean_off_zero_have_no_deadband(sigma, mean, share):
    rng = np.random.default_rng(8)
    for offset in (-0.4, 0.0, 0.3):
        samples = np.rint(mean + offset + sigma * WHITE[:9000])
        assert deadband(with_losses(0.00106 * samples, share, rng), 0) is None


@pytest.mark.parametrize(('mean', 'share'), [
    (0.0, 0.0), (0.0, 0.02), (0.0, 0.05), (0.0, 0.1), (0.004, 0.0), (0.004, 0.02), (0.004, 0.05)])
def test_a_deadband_is_told_despite_losses(mean, share):
    samples = without_small(1e-4 * np.rint(30 * WHITE[:9000] + 1e4 * mean), 0.0015)
    found = deadband(with_losses(samples, share, np.random.default_rng(9)), 0)
    assert found.width == pytest.approx(0.0015, rel=0.2)


@pytest.mark.parametrize('sigma', [0.5, 1, 2, 3.3, 8, 20])
@pytest.mark.parametrize('mean', [0.4, 1, 3, 5])
def test_whole_values_printed_with_two_decimals_have_no_deadband(sigma, mean):
    for unit in (1.0, np.pi / 180):
        samples = unit * np.round(np.rint(mean + sigma * WHITE) / 65.5, 2)
        assert deadband(shown(samples), 0) is None


@pytest.mark.parametrize('sigma', [0.5, 0.8, 1.5, 3])
@pytest.mark.parametrize('degrees', [5, 10, 20, 30, 40, 45])
def test_a_rotated_coarse_output_has_no_deadband(sigma, degrees):
    first, second = np.rint(sigma * WHITE.reshape(2, -1))
    angle = np.deg2rad(degrees)
    assert deadband(shown(np.cos(angle) * first - np.sin(angle) * second), 0) is None


@pytest.mark.parametrize('sigma', [0.8, 1.5, 3])
def test_a_coarse_output_that_a_matrix_mixes_has_no_deadband(sigma):
    rng = np.random.default_rng(10)
    for _ in range(10):
        matrix = np.eye(3) + 0.01 * rng.normal(size=(3, 3))
        finished = shown(np.rint(sigma * WHITE.reshape(-1, 3)) @ matrix)
        assert [axis for axis in range(3) if deadband(finished, axis)] == []
