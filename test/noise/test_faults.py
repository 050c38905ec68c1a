# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Axes that give small values as zero or are cut off, and noise that is not."""

import math

from characterized import shown
from imu_allan.characterization.axis import axis_results
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.faults import clipping, deadband
from imu_allan.noise.terms import Quantity
import numpy as np
import pytest

WHITE = np.random.default_rng(7).normal(size=30_000)


def without_small(samples, width):
    return np.where(np.abs(samples) < width, 0.0, samples)


@pytest.mark.parametrize('width', [0.25, 1.0, 2.5])
@pytest.mark.parametrize('step', [1e-4, 0.1])
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


def whole_values_about_a_mean_off_zero():
    rng = np.random.default_rng(8)
    for sigma, mean in ((3, 6.5), (4, 8), (6, 11), (8, 14), (12, 18)):
        for offset in (-0.4, 0.0, 0.3):
            samples = 0.00106 * np.rint(mean + offset + sigma * WHITE[:9000])
            for share in (0.0, 0.02, 0.05, 0.1):
                # Missing samples are filled in as the timeline does: by the mean of others.
                missing = rng.random(samples.shape) < share
                around = np.convolve(samples, np.full(16, 1 / 16), 'same')
                yield np.where(missing, around, samples), np.flatnonzero(missing)


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


FIRST, SECOND = WHITE.reshape(2, -1)
NO_FAULT = {
    'noise in steps': (deadband, rounded_noise),
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
    'steps of records of any length': (clipping, lambda: noise_of_many_lengths(100, 320, 10_000)),
    'vibrations': (clipping, vibrations)}


@pytest.mark.parametrize('name', [
    pytest.param('noise in steps', marks=pytest.mark.thorough), *[*NO_FAULT][1:]])
def test_what_is_no_fault_is_not_reported_as_one(name):
    fault, records = NO_FAULT[name]
    for record in records():
        finished = shown(*record) if isinstance(record, tuple) else shown(record)
        assert [axis for axis in range(finished.axes) if fault(finished, axis)] == []


@pytest.mark.parametrize('level', [0.0, 2.2])
@pytest.mark.parametrize('step', [1e-3, 0.25])
def test_a_clipped_axis_is_reported_at_either_end(level, step):
    stepped = step * np.round(WHITE / step)
    top = step * round(level / step)
    for sign, end in ((1, 'highest'), (-1, 'lowest')):
        finished = shown(sign * np.minimum(stepped, top))
        found = clipping(finished, 0)
        assert found.value == pytest.approx(sign * top)
        assert found.share == pytest.approx(np.mean(stepped >= top), rel=1e-9)
        [(_, [remark])] = axis_results(finished, 100.0, [Quantity.ANGULAR_VELOCITY])
        assert remark.values['end'] == end
    assert clipping(shown(stepped), 0) is None


def test_noise_clipped_at_two_and_a_half_sigma_is_reported():
    rows = np.random.default_rng(4).normal(size=(20_000, 48))
    finished = shown(np.clip(rows, -2.5, 2.5))
    assert all(clipping(finished, axis) is not None for axis in range(48))


def test_an_axis_at_fault_has_no_fit():
    three = np.stack((WHITE, without_small(WHITE, 1.0), np.minimum(WHITE, 1.0)), axis=1)
    assert [fit is None for fit in fit_axes(shown(three), 0.01)] == [False, True, True]


@pytest.mark.parametrize('sigma', [1e-62, 1e-100, 1e-160, 1e-300, 5e-324])
def test_integers_read_as_doubles_are_a_constant_axis_and_cost_the_others_nothing(sigma):
    rows = np.stack([sigma * WHITE, 0.01 * WHITE[::-1]], axis=1)[:3000]
    dead, alive = axis_results(shown(rows), 100.0, [Quantity.ANGULAR_VELOCITY] * 2)
    assert [found.code for found in dead[1]] == ['constant_axis']
    low, high = alive[0].coefficients['noise_density'].ci95
    assert low < 0.001 < high
    assert all(math.isfinite(value) for value in dead[0].signal.mean)
