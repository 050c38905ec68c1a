# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings that are played in a loop, message by message."""

from dataclasses import replace

from imu_allan.node.checkpoint import decode_state, encode_state
from imu_allan.node.run import new_run, pack, Setup, unpack
from imu_allan.node.same_imu import Seen
from imu_allan.state import restored, state_of
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from ros_harness import at_rest
from whole_lines import refused

SETUP = Setup('/imu', TimelineOptions())


@pytest.mark.parametrize('absent', [[], [3, 4, 5], [2]])
def test_a_second_time_is_recognised_whatever_axes_are_absent(absent: list[int]) -> None:
    first, other = at_rest(1000, seed=1), at_rest(1000, seed=2)
    first.samples[:, absent] = np.nan
    watch = Seen()
    assert [len(block) for block in watch.unseen([first])] == [1000]
    # Other samples under old stamps are no loop.
    assert [len(block) for block in watch.unseen([other])] == [1000]
    assert not watch.looping
    assert watch.unseen([first, first]) == []
    assert watch.looping
    # Played so fast that it begins twice among the messages that are taken together.
    both = replace(first, header_ns=np.tile(first.header_ns, 2),
                   receive_ns=np.tile(first.receive_ns, 2), samples=np.tile(first.samples, (2, 1)),
                   absent=np.tile(first.absent, (2, 1)))
    assert [len(block) for block in Seen().unseen([both])] == [1000]
    # Stamps of two clocks in turn are not looked at one by one.
    other.header_ns[::2] -= 10**11
    assert [len(block) for block in Seen().unseen([other])] == [1000]


def test_a_second_time_whose_start_got_lost_is_recognised_within_a_moment() -> None:
    whole, watch = at_rest(100_000), Seen()
    for first in range(0, len(whole), 100):
        watch.unseen([whole.part(slice(first, first + 100))])
    assert sum(array.nbytes for array in state_of(watch).values()) < 200_000
    for again in (watch, restored(Seen, state_of(watch))):
        passed = sum(len(block) for first in range(50, len(whole), 10)
                     for block in again.unseen([whole.part(slice(first, first + 10))]))
        assert passed < 500
        assert again.looping


@pytest.mark.parametrize('together', [50, 2500])
@pytest.mark.parametrize('joined', [1000, 2000, 3700])
def test_a_recording_that_was_joined_in_the_middle_counts_once_from_its_beginning_on(
        joined: int, together: int) -> None:
    whole, [lane] = at_rest(4000), new_run(SETUP).lanes
    played = np.concatenate([np.arange(joined, 4000), np.tile(np.arange(4000), 2)])
    for first in range(0, len(played), together):
        lane.update([whole.part(played[first:first + together])])
    assert lane.seen.looping
    lane.characterization.finish()
    assert lane.characterization.summary().timeline.samples == 4000


@pytest.mark.parametrize('gravity', [9.81, 0.0], ids=['usual', 'unit still open'])
def test_a_second_time_after_a_restart_counts_once(gravity: float) -> None:
    run, block = new_run(SETUP), at_rest(1000, noise=1.0, mean=(0, 0, 0, 0, 0, gravity))
    run.lanes[0].update([block])
    resumed = unpack(decode_state(encode_state(pack(run, SETUP))), SETUP)
    resumed.lanes[0].update([block])
    assert resumed.snapshot().result().timeline.samples == 1000
    assert resumed.lanes[0].seen.looping == (gravity > 0)


def test_an_older_recording_after_one_in_a_loop_is_no_repetition() -> None:
    [lane] = new_run(SETUP).lanes
    first, other = at_rest(1000, seed=6), at_rest(1000, seed=7)
    for _ in range(3):
        lane.update([first])
    assert (lane.fed, lane.seen.looping) == (1000, True)
    # As when another driver is heard.
    lane.power_on()
    lane.update([replace(other, header_ns=other.header_ns - 10**12,
                         receive_ns=other.receive_ns + 10**11)])
    assert (lane.fed, lane.seen.looping) == (2000, False)
    lane.power_on()
    lane.update([first])
    assert (lane.fed, lane.seen.looping) == (2000, True)


def test_a_damaged_memory_of_earlier_samples_is_refused() -> None:
    watch = Seen()
    watch.unseen([at_rest(1000)])
    whole = state_of(watch)
    for name in ('stamps', 'samples'):
        with pytest.raises((TypeError, ValueError)):
            restored(Seen, {**whole, name: np.zeros((3, 3))})
    for damaged in ({'stamps': whole['stamps'][:9]}, {'bits': np.array('64')}):
        with refused('what is remembered of earlier samples is damaged', ValueError):
            restored(Seen, {**whole, **damaged})
