# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Axes that are cut off, and noise that is not."""

from characterized import joint_fits, one_axis, shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.faults import clipping
import numpy as np
import pytest

WHITE = np.random.default_rng(7).normal(size=30_000)


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


NO_FAULT = {
    'steps of records of any length': lambda: noise_of_many_lengths(100, 320, 10_000),
    'vibrations': vibrations}


@pytest.mark.parametrize('name', NO_FAULT)
def test_what_is_no_fault_is_not_reported_as_one(name):
    for record in NO_FAULT[name]():
        finished = shown(record)
        assert [axis for axis in range(finished.axes) if clipping(finished, axis)] == []


@pytest.mark.parametrize('level', [0.0, 2.2])
@pytest.mark.parametrize('step', [1e-3, 0.25])
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


def test_an_axis_at_fault_has_no_fit_and_is_left_out_of_a_joint_one():
    two = np.stack((WHITE, np.minimum(WHITE, 1.0)), axis=1)
    assert [fit is None for fit in fit_axes(shown(two), 0.01)] == [False, True]
    good, bad = shown(WHITE[:9000]), shown(np.minimum(WHITE[9000:18_000], 1.0))
    alone, beside = (one_axis(good, 100, joint_fits(records, 0.01))[0]
                     for records in ([good], [good, bad]))
    assert alone.coefficients == beside.coefficients
