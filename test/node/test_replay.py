# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings that are played in a loop, message by message."""

from imu_allan.block import ImuBlock
from imu_allan.node.replay import LoopWatch
import numpy as np
import pytest

STAMPS = 10**18 + 10_000_000 * np.arange(1000)


def played(samples: np.ndarray) -> ImuBlock:
    return ImuBlock(STAMPS, STAMPS, samples, np.zeros((len(samples), 2), np.bool_), 'imu')


@pytest.mark.parametrize('absent', [[], [3, 4, 5], [2]])
def test_a_second_time_is_recognised_whatever_axes_are_absent(absent: list[int]) -> None:
    samples = np.random.default_rng(1).normal(size=(1000, 6))
    samples[:, absent] = np.nan
    watch = LoopWatch()
    assert [len(block) for block in watch.unseen([played(samples)])] == [1000]
    assert watch.unseen([played(samples), played(samples)]) == []
    assert watch.looping


def test_other_samples_under_old_stamps_are_no_loop() -> None:
    rng = np.random.default_rng(2)
    watch = LoopWatch()
    watch.unseen([played(rng.normal(size=(1000, 6)))])
    assert [len(block) for block in watch.unseen([played(rng.normal(size=(1000, 6)))])] == [1000]
    assert not watch.looping
