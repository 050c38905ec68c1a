# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The run goes on whatever piles up while the node is held up."""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Run, Setup, unpack
from imu_allan.node.runs import Runs
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from rclpy.logging import get_logger
from ros_harness import at_rest, START_NS

RATE_HZ = 100.0
PROVEN_S = 300.0


def at_rates(pace: Sequence[tuple[float, float]], start_s: float) -> ImuBlock:
    """Give messages of one IMU that come for so many seconds at each rate."""
    steps = np.concatenate([np.full(round(seconds * rate), 1 / rate) for seconds, rate in pace])
    stamps = START_NS + np.rint((start_s + np.cumsum(steps)) * 1e9).astype(np.int64)
    return replace(at_rest(len(stamps), seed=2), header_ns=stamps, receive_ns=stamps)


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
    runs.take(0, 1, [at_rest(round(PROVEN_S * RATE_HZ))])
    runs.run.learn([runs.run.lanes[0].characterization.result()], None)
    return runs


@pytest.mark.parametrize(('there', 'power_ons'), [
    ({'before'}, 0), ({'another'}, 1), ({'another', 'before'}, 0), (set(), 0)])
def test_a_driver_that_was_started_while_the_node_was_down_is_a_power_on(
        facts: Facts, there: set[str], power_ons: int) -> None:
    setup, publishers = Setup('/imu', TimelineOptions()), {'before'}

    def begun(run: Run) -> Runs:
        return Runs(setup, run, [facts], lambda: 0.5, lambda *_: None,
                    Log(get_logger('test_runs')), lambda _: publishers)

    before = begun(new_run(setup))
    before.take(0, 1, [at_rest(6000)])
    resumed = unpack(pack(before.run, setup), setup)
    publishers = there
    begun(resumed).take(0, 1, [at_rest(6000, start_s=90.0, seed=2, mean=(0.1, 0, 0, 0, 0, 9.8))])
    result = resumed.snapshot().result()
    assert result.timeline.samples == 12_000
    assert bool(result.turn_on_bias) == bool(power_ons)


@pytest.mark.parametrize('together', [500, 6000])
def test_other_rates_for_some_seconds_end_no_run_however_many_messages_come_together(
        runs: Runs, replaced: list[Run], together: int) -> None:
    # At other rates for less time than it takes to prove another IMU.
    later = at_rates([(8.0, 109.4), (20.0, RATE_HZ), (8.0, 107.8), (50.0, RATE_HZ)], PROVEN_S)
    for first in range(0, len(later), together):
        runs.take(0, 1, [later.part(slice(first, first + together))])
    assert not replaced
    samples = runs.run.lanes[0].characterization.summary().timeline.samples
    # Some seconds pass until it is known whose they are.
    assert samples > RATE_HZ * (PROVEN_S + 70 - 20)


def test_a_run_that_its_imu_has_just_returned_to_is_one_to_save_at_the_end(
        runs: Runs, replaced: list[Run]) -> None:
    before = runs.run
    # For so long that the first has to last again before it takes its place.
    runs.take(0, 2, [replace(at_rest(350_000, start_s=PROVEN_S + 5, seed=2), frame_id='other')])
    assert replaced == [before]
    assert runs.unproven is None
    runs.take(0, 3, [at_rest(1000, start_s=PROVEN_S + 3600, seed=3)])
    assert runs.unproven is before


def test_a_reset_ends_the_look_at_whose_messages_come(runs: Runs, facts: Facts) -> None:
    runs.take(0, 2, [at_rest(30, start_s=PROVEN_S + 5, seed=2)])
    assert facts.on_probation
    runs.begin_anew()
    assert not facts.on_probation


def test_stamps_that_the_user_insists_on_are_refused_with_a_remedy_that_a_node_has() -> None:
    setup = Setup('/imu', TimelineOptions(clock='header'))
    [lane] = new_run(setup).lanes
    sound = at_rest(6000)
    lane.update([replace(sound, header_ns=np.zeros_like(sound.header_ns))])
    assert lane.error == 'header stamps are zero: choose the other clock (parameter clock)'


def test_a_backtest_is_made_again_when_the_record_is_longer_by_a_part() -> None:
    run, whole = new_run(Setup('/imu', TimelineOptions())), at_rest(8100, 10.0)

    def trained_s(first: int, last: int) -> set[int]:
        """Go on, and fit as the node does; give what the backtests were trained on."""
        run.lanes[0].update([whole.part(slice(first, last))])
        tested = run.backtests
        results, _ = run.snapshot().fitted(tested)
        run.learn(results, run.fed if tested is None else None)
        return {round(axis.backtest.trained_s) for axis in
                run.snapshot().as_one(results).axes.values() if axis.backtest is not None}

    assert [trained_s(0, 7000), trained_s(7000, 8000), trained_s(8000, 8100)] == [
        {350}, {350}, {405}]
