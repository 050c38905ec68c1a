# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The run goes on whatever piles up while the node is held up."""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, Run, Setup
from imu_allan.node.runs import Runs
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from rclpy.logging import get_logger

RATE_HZ = 100.0
PROVEN_S = 300.0


def block(pace: Sequence[tuple[float, float]], start_s: float, seed: int = 1) -> ImuBlock:
    """Give messages of one IMU that come for so many seconds at each rate."""
    steps = np.concatenate([np.full(round(seconds * rate), 1 / rate) for seconds, rate in pace])
    stamps = 1_700_000_000 * 10**9 + np.rint(
        (start_s + np.cumsum(steps)) * 1e9).astype(np.int64)
    samples = np.random.default_rng(seed).normal(0, 0.01, (len(stamps), 6))
    return ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu')


@pytest.fixture
def facts() -> Facts:
    return Facts('/imu', 10_000, 0.0, '')


@pytest.fixture
def replaced() -> list[Run]:
    return []


@pytest.fixture
def runs(facts: Facts, replaced: list[Run]) -> Runs:
    """Give a run that knows its IMU."""
    setup = Setup('/imu', TimelineOptions())

    def note(run: Run, _: UnusableState) -> None:
        replaced.append(run)

    runs = Runs(setup, new_run(setup), [facts], lambda: 0.5, note, Log(get_logger('test_runs')))
    runs.take(0, 1, [block([(PROVEN_S, RATE_HZ)], 0.0)])
    runs.run.learn([runs.run.lanes[0].characterization.result()], None)
    return runs


@pytest.mark.parametrize('together', [500, 6000])
def test_other_rates_for_some_seconds_end_no_run_however_many_messages_come_together(
        runs: Runs, replaced: list[Run], together: int) -> None:
    # At other rates for less time than it takes to prove another IMU.
    later = block([(8.0, 109.4), (20.0, RATE_HZ), (8.0, 107.8), (50.0, RATE_HZ)], PROVEN_S, 2)
    for first in range(0, len(later), together):
        runs.take(0, 1, [later.part(slice(first, first + together))])
    assert not replaced
    samples = runs.run.lanes[0].characterization.summary().timeline.samples
    # Some seconds pass until it is known whose they are.
    assert samples > RATE_HZ * (PROVEN_S + 70 - 20)


def test_a_reset_ends_the_look_at_whose_messages_come(runs: Runs, facts: Facts) -> None:
    runs.take(0, 2, [block([(0.3, RATE_HZ)], PROVEN_S + 5, 2)])
    assert facts.on_probation
    runs.begin_anew()
    assert not facts.on_probation


def test_stamps_that_the_user_insists_on_are_refused_with_a_remedy_that_a_node_has() -> None:
    setup = Setup('/imu', TimelineOptions(clock='header'))
    [lane] = new_run(setup).lanes
    sound = block([(60.0, RATE_HZ)], 0.0)
    lane.update([replace(sound, header_ns=np.zeros_like(sound.header_ns))])
    assert lane.error == 'header stamps are zero: choose the other clock (parameter clock)'
