# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings that are played in a loop, message by message."""

from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import decode_state, encode_state
from imu_allan.node.run import new_run, pack, Setup, unpack
from imu_allan.node.same_imu import Seen
from imu_allan.state import restored, state_of
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from whole_lines import refused

STAMPS = 10**18 + 10_000_000 * np.arange(1000)


def played(samples: np.ndarray) -> ImuBlock:
    return ImuBlock(STAMPS, STAMPS, samples, np.zeros((len(samples), 2), np.bool_), 'imu')


@pytest.mark.parametrize('absent', [[], [3, 4, 5], [2]])
def test_a_second_time_is_recognised_whatever_axes_are_absent(absent: list[int]) -> None:
    samples = np.random.default_rng(1).normal(size=(1000, 6))
    samples[:, absent] = np.nan
    watch = Seen()
    assert [len(block) for block in watch.unseen([played(samples)])] == [1000]
    assert watch.unseen([played(samples), played(samples)]) == []
    assert watch.looping


def test_other_samples_under_old_stamps_are_no_loop() -> None:
    rng = np.random.default_rng(2)
    watch = Seen()
    watch.unseen([played(rng.normal(size=(1000, 6)))])
    assert [len(block) for block in watch.unseen([played(rng.normal(size=(1000, 6)))])] == [1000]
    assert not watch.looping


def test_a_second_time_whose_start_got_lost_is_recognised_within_a_moment() -> None:
    count = 100_000
    stamps = 10**18 + 10_000_000 * np.arange(count)
    samples = np.random.default_rng(3).normal(size=(count, 6))
    whole = ImuBlock(stamps, stamps, samples, np.zeros((count, 2), np.bool_), 'imu')
    watch = Seen()
    for first in range(0, count, 100):
        watch.unseen([whole.part(slice(first, first + 100))])
    assert sum(array.nbytes for array in state_of(watch).values()) < 200_000
    for again in (watch, restored(Seen, state_of(watch))):
        passed = sum(len(block) for first in range(50, count, 10)
                     for block in again.unseen([whole.part(slice(first, first + 10))]))
        assert passed < 500
        assert again.looping


@pytest.mark.parametrize('gravity', [9.81, 0.0], ids=['usual', 'unit still open'])
def test_a_second_time_after_a_restart_counts_once(gravity: float) -> None:
    setup = Setup('/imu', TimelineOptions())
    samples = np.random.default_rng(4).normal([0, 0, 0, 0, 0, gravity], 1, (1000, 6))
    run = new_run(setup)
    run.lanes[0].update([played(samples)])
    state = pack(run, setup)
    resumed = unpack(decode_state(encode_state(state)), setup)
    resumed.lanes[0].update([played(samples)])
    assert resumed.snapshot().result().timeline.samples == 1000
    assert resumed.lanes[0].seen.looping == (gravity > 0)


def test_an_older_recording_after_one_in_a_loop_is_no_repetition() -> None:
    [lane] = new_run(Setup('/imu', TimelineOptions())).lanes
    first, other = (played(np.random.default_rng(seed).normal([0, 0, 0, 0, 0, 9.81], 1, (1000, 6)))
                    for seed in (6, 7))
    for _ in range(3):
        lane.update([first])
    assert (lane.fed, lane.seen.looping) == (1000, True)
    # As when another driver is heard.
    lane.power_on()
    lane.update([replace(other, header_ns=STAMPS - 10**12, receive_ns=STAMPS + 10**11)])
    assert (lane.fed, lane.seen.looping) == (2000, False)
    lane.power_on()
    lane.update([first])
    assert (lane.fed, lane.seen.looping) == (2000, True)


def test_a_damaged_memory_of_earlier_samples_is_refused() -> None:
    watch = Seen()
    watch.unseen([played(np.random.default_rng(5).normal(size=(1000, 6)))])
    whole = state_of(watch)
    for name in ('stamps', 'samples'):
        with pytest.raises((TypeError, ValueError)):
            restored(Seen, {**whole, name: np.zeros((3, 3))})
    for damaged in ({'stamps': whole['stamps'][:9]}, {'bits': np.array('64')}):
        with refused('what is remembered of earlier samples is damaged', ValueError):
            restored(Seen, {**whole, **damaged})
