# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come, however they pile up, without the middleware between."""

from collections.abc import Sequence
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.node import run as run_module
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Run, Setup, unpack
from imu_allan.node.runs import Runs
from imu_allan.node.same_imu import Known, LOOK_S
from imu_allan.result import Result, Source, Timeline
from imu_allan.timeline import TimelineOptions, TimelineSummary
import numpy as np
import pytest
from repeated import slow
from ros_harness import assert_density, at_rest, Heard, NOISE, SECOND, START_NS

RATE_HZ = 100.0
PROVEN_S = 300.0
SETUP = Setup('/imu', TimelineOptions())
HALVES = Setup('/gyro', TimelineOptions(), accel_topic='/accel')


def resumed(run: Run, setup: Setup = SETUP) -> Run:
    """Give the run that a node goes on with, which was killed."""
    return unpack(pack(run, setup), setup)


class World:
    """What comes to a node, which looks at the run now and then."""

    def __init__(self, run: Run | None = None, setup: Setup = SETUP) -> None:
        heard: Any = Heard()
        self.lines: list[str] = heard.lines
        self.facts = [Facts(topic, 10_000, 0.0, '') for topic, _ in setup.streams]
        # Who is there, and the runs that others have taken the place of.
        self.there: set[str] = set()
        self.replaced: list[tuple[Run, UnusableState]] = []
        self.runs = Runs(setup, run or new_run(setup), self.facts, lambda: 0.5,
                         lambda run, why: self.replaced.append((run, why)), Log(heard),
                         lambda _: self.there)

    def comes(self, *blocks: ImuBlock, publisher: int = 1, number: int = 0, together: int = 100
              ) -> None:
        """Take messages in bundles of so many; then the node knows by which stamps they come."""
        for block in blocks:
            for first in range(0, len(block), together):
                self.runs.take(number, publisher, [block.part(slice(first, first + together))])
        for lane, seen in zip(self.runs.run.lanes, self.summaries(), strict=True):
            lane.known.learn(Source('topic', None, '/imu', None, None, seen.clock))

    @property
    def result(self) -> Result:
        return self.runs.run.snapshot().result()

    def summaries(self) -> list[TimelineSummary]:
        streams = [lane.snapshot().characterization for lane in self.runs.run.lanes]
        for stream in streams:
            stream.finish()
        return [stream.summary() for stream in streams]

    @property
    def timeline(self) -> Timeline:
        return self.summaries()[0].timeline

    @property
    def samples(self) -> int:
        return self.timeline.samples


@pytest.fixture
def world() -> World:
    """Give a run that knows its IMU."""
    found = World()
    found.comes(at_rest(round(PROVEN_S * RATE_HZ)), together=100_000)
    return found


@pytest.mark.parametrize(('there', 'power_ons'), [
    ({'before'}, 0), ({'another'}, 1), ({'another', 'before'}, 0), (set(), 0)])
@pytest.mark.parametrize('booted', [False, True])
def test_a_driver_that_was_started_while_the_node_was_down_is_a_power_on(
        there: set[str], power_ons: int, booted: bool, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    boot = tmp_path / 'boot_id'
    boot.write_text('first')
    monkeypatch.setattr(run_module, 'BOOT_ID', boot)
    before = World()
    before.there = {'before'}
    before.comes(at_rest(6000))
    state = pack(before.runs.run, SETUP)
    boot.write_text('second' if booted else 'first')
    world = World(unpack(state, SETUP))
    world.there = there
    for start_s in 90.0, 150.0:
        world.comes(at_rest(6000, start_s=start_s, seed=2, mean=(0.1, 0, 0, 0, 0, 9.8)))
    assert world.samples == 18_000
    # Whoever switches the computer on starts the driver anew: that is one power-on.
    kept = world.runs.run.lanes[0].characterization.to_state()['memory/power_ons']
    assert len(json.loads(str(kept))) == max(power_ons, booted)


def at_rates(pace: Sequence[tuple[float, float]], start_s: float) -> ImuBlock:
    """Give messages of one IMU that come for so many seconds at each rate."""
    steps = np.concatenate([np.full(round(seconds * rate), 1 / rate) for seconds, rate in pace])
    stamps = START_NS + np.rint((start_s + np.cumsum(steps)) * 1e9).astype(np.int64)
    return replace(at_rest(len(stamps), seed=2), header_ns=stamps, receive_ns=stamps)


@pytest.mark.parametrize('together', [500, 6000])
def test_other_rates_for_some_seconds_end_no_run_however_many_messages_come_together(
        world: World, together: int) -> None:
    # At other rates for less time than it takes to prove another IMU.
    later = at_rates([(8.0, 109.4), (20.0, RATE_HZ), (8.0, 107.8), (50.0, RATE_HZ)], PROVEN_S)
    world.comes(later, together=together)
    assert not world.replaced
    # Some seconds pass until it is known whose they are.
    assert world.samples > RATE_HZ * (PROVEN_S + 70 - 20)


@pytest.mark.parametrize(('within', 'beyond'), [
    (-0.015, 0.025), *(slow(0.01, beyond) for beyond in (0.04, -0.03, 0.1))])
def test_a_rate_within_the_tolerance_of_the_timeline_goes_on_and_no_other(
        within: float, beyond: float) -> None:
    world, rate_hz = World(), 200 * (1 + within)
    world.comes(at_rest(6000, 200.0))
    for part in range(5):
        world.comes(at_rest(1200, rate_hz, start_s=30 + 1200 / rate_hz * part, seed=part))
    assert not world.replaced
    assert world.samples == pytest.approx(12_000, rel=0.02)
    assert world.timeline.rejected == 0
    rate_hz = 200 * (1 + beyond)
    for part in range(30):
        world.comes(at_rest(400, rate_hz, start_s=100 + 400 / rate_hz * part, seed=100 + part))
    [(_, why)] = world.replaced
    assert why.reason == 'rate'
    assert world.timeline.sample_rate_hz == pytest.approx(rate_hz, rel=1e-3)
    assert world.timeline.rejected == 0
    assert_density(world.result.to_dict(), rate_hz)


@pytest.mark.parametrize('step_s', [-3600, 3600])
def test_a_clock_that_steps_is_the_same_imu_and_no_recording_in_a_loop(step_s: float) -> None:
    world = World()
    world.comes(at_rest(6000))
    later = at_rest(6000, start_s=60.0, seed=2)
    world.comes(replace(later, header_ns=later.header_ns + step_s * SECOND))
    assert (world.samples, world.timeline.gaps, world.replaced) == (12_000, (), [])
    assert world.timeline.duration_s == pytest.approx(120.0, rel=.01)
    assert [remark.code for remark in world.summaries()[0].remarks] == ['clock_jumps']


def polled_block(polled: int, count: int, rate_hz: float, start_s: float, seed: int, *,
                 together: bool = False) -> ImuBlock:
    """Return messages of an IMU whose samples come so many times, if wanted at once."""
    block = at_rest(count, rate_hz, start_s=start_s, seed=seed)
    index = np.arange(count * polled)
    index -= index % polled if together else 0
    stamps = START_NS + np.rint((start_s + index / rate_hz / polled) * SECOND).astype(np.int64)
    return ImuBlock(stamps, stamps, np.repeat(block.samples, polled, axis=0),
                    np.zeros((len(stamps), 2), bool), 'imu')


@pytest.mark.parametrize(('polled', 'together'), [
    *(slow(polled, False) for polled in (2, 3)), (2, True)])
def test_a_sensor_whose_samples_come_more_than_once_is_one_run(
        polled: int, together: bool) -> None:
    world = World()
    for part in range(6):
        world.comes(polled_block(polled, 2000, RATE_HZ, 20.0 * part, part, together=together))
    assert not world.replaced
    assert world.samples == pytest.approx(12_000, abs=10)
    assert_density(world.result.to_dict(), RATE_HZ)


def test_a_message_that_comes_twice_is_one() -> None:
    twice = at_rest(1000).part(np.sort(np.append(np.arange(1000), np.arange(0, 1000, 5))))
    assert Known('imu', 'header', RATE_HZ).mismatch([twice], by_level=False) is None


def test_a_stranger_for_some_seconds_does_not_end_a_long_run() -> None:
    world, now_s, publisher = World(), 1200.0, 1
    world.comes(at_rest(24_000, 20.0), together=1000)
    for rate_hz, frame_id in (20.0, 'other'), (40.0, 'imu'):
        stranger = at_rest(round(30 * rate_hz), rate_hz, start_s=now_s + 3, seed=publisher)
        world.comes(replace(stranger, frame_id=frame_id), publisher=publisher + 1)
        now_s += 68.0
        world.comes(at_rest(600, 20.0, start_s=now_s, seed=publisher + 50),
                    publisher=publisher + 2)
        now_s, publisher = now_s + 30, publisher + 2
    assert not world.replaced
    assert sum('are of another IMU' in line for line in world.lines) == 2
    assert world.samples == pytest.approx(25_200, abs=80)
    assert_density(world.result.to_dict(), 20.0)


@pytest.mark.parametrize('count', [10, 3000])
def test_another_imu_behind_a_restart_begins_a_new_run_with_its_first_sample_and_few_do_no_harm(
        world: World, count: int) -> None:
    world = World(resumed(world.runs.run))
    world.comes(replace(at_rest(count, start_s=PROVEN_S + 10, seed=2), frame_id='other'),
                publisher=2)
    world.runs.finish()
    if count == 10:
        # So few show nothing.
        assert (world.replaced, world.runs.run.fed, world.runs.unproven) == ([], 0, None)
        return
    [(_, why)] = world.replaced
    assert str(why) == "it is of frame_id 'imu', the messages now have 'other'"
    assert world.samples == count


@pytest.mark.parametrize(('rate_hz', 'needed_s', 'reason'), [
    (200.0, 2.0, None), (202.0, 10.0, None), (400.0, 2.0, 'rate'),
    (50.0, 2.0, 'rate'), (220.0, 10.0, 'rate'), (206.0, 10.0, 'rate'), (4.0, 4.0, 'rate')])
def test_a_look_takes_longer_where_jitter_could_be_the_reason(
        rate_hz: float, needed_s: float, reason: str | None) -> None:
    known, held = Known('imu', 'header', 200.0), [at_rest(round(rate_hz / 2), rate_hz)]
    while not known.suffices(held, LOOK_S, by_level=False):
        assert len(held) < 40
        held.append(at_rest(round(rate_hz / 2), rate_hz, start_s=0.5 * len(held)))
    assert 0.5 * len(held) == pytest.approx(needed_s, abs=0.5)
    why = known.mismatch(held, by_level=False)
    assert (why and why.reason) == reason
    if why is not None:
        assert str(why) == f'it is of 200 Hz, the messages now come at {rate_hz:g} Hz'


def test_a_run_that_its_imu_has_just_returned_to_is_one_to_save_at_the_end(world: World) -> None:
    before = world.runs.run
    # For so long that the first has to last again before it takes its place.
    world.comes(replace(at_rest(350_000, start_s=PROVEN_S + 5, seed=2), frame_id='other'),
                publisher=2, together=350_000)
    assert [run for run, _ in world.replaced] == [before]
    assert world.runs.unproven is None
    world.comes(at_rest(1000, start_s=PROVEN_S + 3600, seed=3), publisher=3)
    assert world.runs.unproven is before


def test_a_reset_ends_the_look_at_whose_messages_come(world: World) -> None:
    world.comes(at_rest(30, start_s=PROVEN_S + 5, seed=2), publisher=2)
    assert world.facts[0].on_probation
    world.runs.begin_anew()
    assert not world.facts[0].on_probation


def half(number: int, seconds: float, start_s: float = 0.0, rate_hz: float = 0.0) -> ImuBlock:
    """Give messages of the gyroscope or of the accelerometer, the other half of each zero."""
    rate_hz = rate_hz or (200.0, 125.0)[number]
    block = at_rest(round(seconds * rate_hz), rate_hz, start_s=start_s, seed=round(start_s))
    block.samples[:, (slice(3, 6), slice(3))[number]] = 0
    return replace(block, frame_id=('gyro_frame', 'accel_frame')[number])


def test_a_half_that_changes_rate_or_frame_for_good_begins_a_new_run_of_both() -> None:
    world = World(setup=HALVES)
    world.comes(half(0, 12.0))
    world.comes(half(1, 12.0), number=1)
    # A run of two topics goes on behind a restart.
    world = World(resumed(world.runs.run, HALVES), HALVES)
    for number in 0, 1:
        world.comes(half(number, 4.0, start_s=100.0), number=number)
    assert (world.samples, world.replaced) == (3200, [])
    world.comes(half(1, 8.0, 120.0, 250.0), number=1)
    world.comes(half(0, 8.0, 120.0))
    world.comes(half(1, 12.0, 128.0, 250.0), number=1)
    # If one sensor of an IMU begins anew, so does the other.
    assert world.samples == 1600
    assert str(world.replaced[0][1]) == 'it is of 125 Hz, the messages now come at 250 Hz'
    world.comes(half(1, 20.0, 140.0, 250.0), number=1)
    world.comes(half(0, 20.0, 140.0))
    assert [seen.timeline.sample_rate_hz for seen in world.summaries()] == pytest.approx(
        [200.0, 250.0], rel=1e-3)
    world.comes(replace(half(0, 15.0, 160.0), frame_id='other'))
    assert str(world.replaced[1][1]) == (
        "it is of frame_id 'gyro_frame', the messages now have 'other'")
    # What came of the accelerometer before belongs to the run before.
    world.comes(half(1, 10.0, 180.0, 250.0), number=1)
    assert len(world.replaced) == 2
    assert [seen.timeline.samples for seen in world.summaries()] == [3000, 2500]
    assert [seen.frame_id for seen in world.summaries()] == ['other', 'accel_frame']


def test_the_driver_of_a_half_that_is_killed_leaves_a_gap_in_its_own_half() -> None:
    world = World(setup=HALVES)
    for start_s, publisher in (0.0, 1), (20.0, 2):
        world.comes(half(0, 12.0, start_s), publisher=publisher)
    world.comes(half(1, 32.0), number=1)
    assert not world.replaced
    assert [[round(gap.duration_s) for gap in seen.timeline.gaps]
            for seen in world.summaries()] == [[8], []]


def test_stamps_that_the_user_insists_on_are_refused_with_a_remedy_that_a_node_has() -> None:
    [lane] = new_run(Setup('/imu', TimelineOptions(clock='header'))).lanes
    sound = at_rest(6000)
    lane.update([replace(sound, header_ns=np.zeros_like(sound.header_ns))])
    assert lane.error == 'header stamps are zero: choose the other clock (parameter clock)'


def test_a_backtest_is_made_again_when_the_record_is_longer_by_a_part() -> None:
    run, whole = new_run(SETUP), at_rest(8100, 10.0)

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


@pytest.mark.parametrize('noise', [1.2, slow(0.85)])
def test_another_sensor_stays_another_however_long_it_takes_until_its_run_begins(
        noise: float) -> None:
    world = World()
    # It has to last for a minute, within which it is looked at several times; all of it comes as
    # to a node in real time.
    world.comes(at_rest(60_000), together=50)
    world.comes(at_rest(10_000, start_s=605.0, seed=2, noise=noise * NOISE), publisher=2,
                together=50)
    assert [why.reason for _, why in world.replaced] == ['noise']
    assert world.samples == 10_000
    assert_density(world.result.to_dict(), RATE_HZ, noise * NOISE)


def test_a_sensor_that_is_shaken_while_its_driver_starts_is_the_same_one() -> None:
    world = World()
    world.comes(at_rest(60_000), together=100_000)
    for start_s, noise in (605.0, 3 * NOISE), (625.0, NOISE), (645.0, NOISE):
        world.comes(at_rest(2000, start_s=start_s, seed=round(start_s), noise=noise), publisher=2)
    assert not world.replaced
    assert sum('it goes on' in line for line in world.lines) == 1
    assert world.samples == pytest.approx(64_000, abs=1500)


def test_a_rate_that_differs_by_hardly_more_than_the_timeline_allows_begins_a_new_run() -> None:
    world = World()
    world.comes(at_rest(12_000), together=100_000)
    world.comes(at_rest(12_264, 102.2, start_s=120.0, seed=2))
    assert [why.reason for _, why in world.replaced] == ['rate']
    assert world.timeline.rejected == 0
    assert world.timeline.sample_rate_hz == pytest.approx(102.2, rel=1e-3)
    assert world.samples > 5000


def test_a_rate_that_changes_before_any_fit_begins_a_new_run() -> None:
    runs = World().runs
    for start_s, rate_hz in (0.0, 200.0), (60.0, 208.0):
        block = at_rest(round(60 * rate_hz), rate_hz, start_s=start_s, seed=round(rate_hz))
        for first in range(0, len(block), 100):
            runs.take(0, 1, [block.part(slice(first, first + 100))])
    [lane] = runs.run.lanes
    assert lane.known.rate_hz == pytest.approx(208.0, rel=1e-3)
    assert lane.fed > 5000


def test_a_rate_that_changes_for_some_seconds_leaves_its_rate_to_a_polled_sensor() -> None:
    world, now_s = World(), 0.0
    # The other rate is the last that the timeline sees before it waits for its next window.
    for part, (seconds, rate_hz) in enumerate([(53.0, RATE_HZ), (8.0, 103.0), (100.0, RATE_HZ)]):
        world.comes(polled_block(2, round(seconds * rate_hz), rate_hz, now_s, part))
        now_s += seconds
    assert not [line for line in world.lines if 'another IMU' in line]
    assert world.samples > RATE_HZ * 140


@pytest.mark.parametrize('rate_hz', [20.0, 50.0])
def test_a_slow_sensor_is_distinguished_by_all_of_its_axes_together(rate_hz: float) -> None:
    world = World()
    world.comes(at_rest(round(90 * rate_hz), rate_hz), together=round(rate_hz / 2))
    world.comes(at_rest(round(60 * rate_hz), rate_hz, start_s=95.0, seed=2, noise=1.2 * NOISE),
                publisher=2, together=round(rate_hz / 2))
    assert [why.reason for _, why in world.replaced] == ['noise']
    assert_density(world.result.to_dict(), rate_hz, 1.2 * NOISE)


def test_a_run_whose_place_two_others_have_taken_goes_on_where_its_imu_returns(
        world: World) -> None:
    first, now_s = world.runs.run, PROVEN_S
    for publisher, frame_id in enumerate(('second', 'third', 'imu'), 2):
        world.comes(replace(at_rest(6000, start_s=now_s + 5, seed=publisher), frame_id=frame_id),
                    publisher=publisher)
        now_s += 65
    assert len(world.replaced) == 3
    assert world.runs.run is first
    assert world.samples == RATE_HZ * (PROVEN_S + 60)
    # What it had before is apart from what comes after it.
    kept = first.lanes[0].characterization.to_state()['memory/power_ons']
    assert len(json.loads(str(kept))) == 1


def test_a_polled_sensor_that_is_started_anew_is_no_other() -> None:
    world = World()
    for publisher in range(16):
        world.comes(polled_block(2, 3000, RATE_HZ, 35.0 * publisher, publisher),
                    publisher=publisher, together=50)
    assert not [line for line in world.lines if 'another IMU' in line]
    assert world.samples == pytest.approx(16 * 3000, abs=16)
