# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from characterized import joint_fits, one_axis, shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.faults.saturation import cut_off
from imu_allan.noise.record.estimator import CHUNK, Estimator
import numpy as np
import pytest
from repeated import slow

WHITE = np.random.default_rng(7).normal(size=30_000)


@pytest.mark.parametrize('level', [0.0, 0.5, 1.5, 2.2])
@pytest.mark.parametrize('step', [1e-3, 0.1, 0.25])
def test_a_clipped_axis_is_told_at_either_end(level, step):
    stepped = step * np.round(WHITE / step)
    top = step * round(level / step)
    for sign in (1, -1):
        found = cut_off(shown(sign * np.minimum(stepped, top)), 0)
        assert found.value == pytest.approx(sign * top)
        assert found.share == pytest.approx(np.mean(stepped >= top), rel=1e-9)
        assert found.is_highest == (sign == 1)
    assert cut_off(shown(stepped), 0) is None


def test_noise_clipped_at_two_and_a_half_sigma_is_told():
    rows = np.random.default_rng(4).normal(size=(20_000, 48))
    finished = shown(np.clip(rows, -2.5, 2.5))
    assert all(cut_off(finished, axis) is not None for axis in range(48))


@pytest.mark.parametrize('samples', [slow(64), 100, 320, slow(1000), 10_000])
def test_noise_in_steps_is_not_cut_off(samples):
    # About 320 samples in steps of 1 sigma end in a cell of 6 % of them in one record of ten.
    rng = np.random.default_rng(samples)
    axes = 2_000_000 // samples
    for step in (0.3, 1.0):
        rows = rng.normal(size=(samples, min(axes, 300)))
        rows += rng.choice([0.0, 1.0, 30.0], rows.shape[1]) * np.exp(
            -8 * np.linspace(0, 1, samples))[:, None]
        finished = shown(step * np.round(rows / step + rng.uniform(size=rows.shape[1])))
        assert [axis for axis in range(finished.axes) if cut_off(finished, axis)] == []


def test_a_vibration_turns_at_its_ends_and_is_not_cut_off():
    # Most samples of a sine stand at its ends; a sixth of a period makes neighbours differ much.
    time = np.arange(len(WHITE))
    for cycle in (6.3, 41.7, 900.0):
        samples = np.round(30 * np.sin(2 * np.pi * time / cycle) + 0.3 * WHITE)
        assert cut_off(shown(samples), 0) is None, cycle


def test_a_vibration_above_noise_below_a_step_is_not_cut_off():
    # In a short record its means over no time are free of it.
    choice = np.random.default_rng(3)
    for _ in range(100):
        cycle, sigma = 1 / choice.uniform(0.005, 0.45), choice.uniform(0.15, 0.6)
        samples = np.round(choice.uniform(20, 60) * np.sin(2 * np.pi * np.arange(6000) / cycle)
                           + choice.normal(0.0, sigma, 6000))
        assert cut_off(shown(samples), 0) is None, (cycle, sigma)


def test_few_samples_off_the_steps_of_the_others_do_not_make_an_end_of_a_range():
    steps = 5.0 * np.round((np.cumsum(WHITE + 1.0)) / 5.0)
    samples = np.diff(steps, prepend=0.0)
    samples[0] = 0.37
    samples[5000::100] = samples[4996:-4:100] / 3
    assert cut_off(shown(samples[:5000]), 0) is None
    assert cut_off(shown(samples), 0) is None


def bridged(samples, share):
    """Fill in missing samples as the timeline does: by the mean of others on both sides."""
    missing = np.random.default_rng(8).random(samples.shape) < share
    around = np.convolve(samples, np.full(16, 1 / 16), 'same')
    return np.where(missing, around, samples), np.flatnonzero(missing)


@pytest.mark.parametrize('share', [0.02, 0.1, 0.4])
@pytest.mark.parametrize('step', [1.5, 2.0, 3.0])
def test_steps_above_the_noise_are_not_cut_off_where_samples_are_missing(share, step):
    for offset in (0.0, 0.2, 0.4):
        samples, missing = bridged(step * np.round(WHITE[:6000] / step + offset), share)
        finished = shown(samples, missing)
        assert cut_off(finished, 0) is None
        assert finished.census.step[0] == step


@pytest.mark.parametrize('share', [0.02, 0.1, 0.4])
def test_a_clipped_axis_is_told_where_samples_are_missing_with_its_share_of_those_there(share):
    clipped = np.minimum(0.1 * np.round(WHITE / 0.1), 1.0)
    samples, missing = bridged(clipped, share)
    found = cut_off(shown(samples, missing), 0)
    assert found.value == pytest.approx(1.0)
    assert found.share == np.mean(np.delete(clipped, missing) == clipped.max())


def test_ends_are_counted_however_samples_arrive():
    rows = np.minimum(WHITE, 0.5)
    whole = shown(rows)
    assert whole.census.at_ends[:, 0].tolist() == [1, np.count_nonzero(WHITE >= 0.5)]
    bits = Estimator()
    for part in np.array_split(rows, 77):
        bits.update(part)
        bits = Estimator.from_state(bits.to_state()).copy().taken([0])
    assert bits.finished().census.at_ends.tolist() == whole.census.at_ends.tolist()


def test_a_new_extreme_begins_the_count_anew():
    estimator = Estimator()
    for level in (1.0, 2.0, 1.0):
        estimator.update(np.full(CHUNK, level))
    assert estimator.finished().census.at_ends[:, 0].tolist() == [2 * CHUNK, CHUNK]


def test_merged_records_count_what_stands_at_the_common_ends():
    one = shown(np.minimum(WHITE[:9000], 0.3) + 9.8)
    one.merge(shown(np.minimum(WHITE[9000:], 0.3) + 9.8))
    together = shown(np.minimum(WHITE, 0.3) + 9.8)
    assert one.census.at_ends.tolist() == together.census.at_ends.tolist()
    one.merge(shown(np.array([11.0, 11.0, -11.0])))
    assert one.census.at_ends[:, 0].tolist() == [1, 2]


def test_a_cut_off_axis_has_no_fit_and_is_left_out_of_a_joint_one():
    both = np.stack((WHITE, np.minimum(WHITE, 1.0)), axis=1)
    fits = fit_axes(shown(both), 0.01)
    assert fits[0] is not None
    assert fits[1] is None
    good, bad = shown(WHITE[:9000]), shown(np.minimum(WHITE[9000:18_000], 1.0))
    alone, beside = (one_axis(good, 100, joint_fits(records, 0.01))[0]
                     for records in ([good], [good, bad]))
    assert alone.coefficients == beside.coefficients
