# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come, however they pile up, without the middleware between."""

from dataclasses import replace
from itertools import pairwise
from operator import itemgetter
import time
from unittest.mock import Mock

from imu_allan.characterization.join_results import fitted
from imu_allan.node import run as run_module
from imu_allan.node.change_of_run import Runs
from imu_allan.node.diagnostics import Facts
from imu_allan.node.fitting import Fitting
from imu_allan.node.log import Log
from imu_allan.node.reception import MIXED, Publishers
from imu_allan.node.run import new_run, pack, Setup, unpack
from imu_allan.node.storage import decode_state, encode_state
from imu_allan.noise.random_effects import random_effects
from imu_allan.recordings.repeated_messages import Seen
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from ros_harness import assert_density, at_rest, half, Heard, NOISE, SECOND, START_NS

RATE_HZ, PROVEN_S = 100.0, 300.0
SETUP = Setup(('/imu',))
HALVES = Setup(('/gyro', '/accel'))


def resumed(run, setup=SETUP):
    """Give the run that a node goes on with, which was killed."""
    return unpack(decode_state(encode_state(pack([run], setup))), setup)[0]


def rebooted(run, boot, name):
    """Give the run that a node goes on with after the boot of that name."""
    state = pack([run], SETUP)
    boot.write_text(name)
    return unpack(state, SETUP)[0]


class World:
    """What comes to a node, which looks at the run now and then."""

    def __init__(self, run=None, setup=SETUP):
        heard = Heard()
        self.lines = heard.lines
        self.facts = [Facts(topic, 10_000, 0.0) for topic in setup.topics]
        # Who is there, and the runs that others have taken the place of.
        self.there = set()
        self.replaced = []
        self.runs = Runs(setup, run or new_run(setup),
                         [(facts, lambda: self.there) for facts in self.facts], lambda: 0.5,
                         lambda run, why: self.replaced.append((run, why)), Log(lambda: heard))

    def comes(self, *blocks, publisher=1, number=0, together=100):
        """Take messages in bundles of so many; then the node knows by which stamps they come."""
        for block in blocks:
            for first in range(0, len(block), together):
                self.runs.take(number, publisher, [block.part(slice(first, first + together))])
        for lane, seen in zip(self.runs.run.lanes, self.summaries(), strict=True):
            lane.known.learn(seen.clock)

    def summaries(self):
        streams = [lane.snapshot().characterization for lane in self.runs.run.lanes]
        for stream in streams:
            stream.finish()
        return [stream.summary() for stream in streams]

    @property
    def timeline(self):
        return self.summaries()[0].timeline

    @property
    def samples(self):
        return self.timeline.samples


@pytest.fixture
def world():
    found = World()
    found.comes(at_rest(round(PROVEN_S * RATE_HZ)), together=100_000)
    return found


@pytest.fixture
def boot(monkeypatch, tmp_path):
    path = tmp_path / 'boot_id'
    path.write_text('first\n')
    monkeypatch.setattr(run_module, 'BOOT_ID', path)
    return path


def result_of(run):
    return fitted(run.snapshot())[0]


def ended(run):
    """Give what is noted of the power-ons that have ended."""
    return run.lanes[0].characterization.power_ons


@pytest.mark.parametrize(('there', 'power_ons'), [
    ({'before'}, 0), ({'another'}, 1), ({'another', 'before'}, 0), (set(), 0)])
@pytest.mark.parametrize('booted', [False, True, None], ids=['same', 'other', 'unknown'])
def test_a_driver_started_while_the_node_was_down_is_a_power_on(there, power_ons, booted, boot):
    before = World()
    before.there = {'before'}
    before.comes(at_rest(6000))
    if booted is None:
        # A computer that cannot tell its boots counts every start.
        boot.unlink()
        world = World(resumed(before.runs.run))
    else:
        world = World(rebooted(before.runs.run, boot, 'second\n' if booted else 'first\n'))
    world.there = there
    for start_s in 90.0, 150.0:
        world.comes(at_rest(6000, start_s=start_s, seed=2, mean=(0.1, 0, 0, 0, 0, 9.8)))
    assert world.samples == 18_000
    # Whoever switches the computer on starts the driver anew: that is one power-on.
    assert len(ended(world.runs.run)) == (power_ons if booted is False else 1)


def test_other_rates_for_some_seconds_end_no_run(world):
    # At other rates for less time than it takes to prove another IMU.
    steps = np.concatenate([np.full(round(seconds * rate), 1 / rate) for seconds, rate in (
        (8.0, 109.4), (20.0, RATE_HZ), (8.0, 107.8), (50.0, RATE_HZ))])
    stamps = START_NS + np.rint((PROVEN_S + np.cumsum(steps)) * 1e9).astype(np.int64)
    world.comes(replace(at_rest(len(stamps), seed=2), header_ns=stamps, receive_ns=stamps),
                together=6000)
    assert not world.replaced
    # Some seconds pass until it is known whose they are.
    assert world.samples > RATE_HZ * (PROVEN_S + 70 - 20)


def late_ticks(count, late_s, seed):
    """Give the times of a timer that comes late, and then leaves out the ticks it has missed."""
    generator, period_s, now = np.random.default_rng(seed), 1 / RATE_HZ, 0.0
    for _ in range(count):
        now = period_s * np.ceil(now / period_s + 1e-9) + generator.exponential(late_s)
        yield now


@pytest.mark.parametrize('seed', [0, 1])
def test_a_driver_whose_timer_comes_late_and_leaves_out_ticks_is_the_same_imu(world, seed):
    late = np.array([*late_ticks(40_000, 5e-3, seed)])
    stamps = START_NS + np.rint((PROVEN_S + late) * 1e9).astype(np.int64)
    world.comes(replace(at_rest(len(stamps), seed=2), header_ns=stamps, receive_ns=stamps))
    assert not world.replaced
    assert world.samples == pytest.approx(RATE_HZ * PROVEN_S + len(late), rel=0.005)
    assert world.timeline.sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-4)


@pytest.mark.parametrize(('rate_hz', 'together', 'comes', 'reasons', 'samples'), [
    # Of each that comes: seconds, start, publisher, and what is other than before.
    pytest.param(200.0, 100, [(30, 0, 1, {}), (30, 30, 1, {'rate_hz': 197.0})], [], 12_000,
                 id='a rate within the tolerance of the timeline'),
    pytest.param(200.0, 100, [(30, 0, 1, {}), (60, 30, 1, {'rate_hz': 205.0})], ['rate'], 10_400,
                 id='a rate beyond'),
    pytest.param(5.0, 5, [(600, 0, 1, {}), (600, 600, 1, {'rate_hz': 5.15})], ['rate'], 2786,
                 id='a rate of a slow sensor beyond'),
    pytest.param(100.0, 100, [(120, 0, 1, {'polled': 2, 'together': True})], [], 12_000,
                 id='every sample twice'),
    pytest.param(20.0, 1000, [
        (1200, 0, 1, {}), (30, 1203, 2, {'frame_id': 'other'}), (30, 1268, 3, {}),
        (30, 1301, 4, {'rate_hz': 40.0}), (30, 1366, 5, {})], [], 25_200,
        id='strangers for some seconds'),
])
def test_an_imu_is_known_by_its_rate_and_frame(rate_hz, together, comes, reasons, samples):
    world = World()
    for seed, (seconds, start_s, publisher, other) in enumerate(comes):
        last = {'rate_hz': rate_hz, **other}
        world.comes(at_rest(round(seconds * last['rate_hz']), start_s=start_s, seed=seed, **last),
                    publisher=publisher, together=together)
    assert [why.reason for _, why in world.replaced] == reasons
    assert world.samples == pytest.approx(samples, rel=0.025)
    assert world.timeline.rejected == 0
    last = last if reasons else {'rate_hz': rate_hz}
    assert_density(result_of(world.runs.run).to_dict(), last['rate_hz'],
                   last.get('noise', NOISE))


def test_another_imu_of_the_same_frame_and_rate_is_a_change_of_noise():
    world = World()
    world.comes(at_rest(60_000))
    world.comes(at_rest(30_000, start_s=605.0, seed=2, noise=1.2 * NOISE), publisher=2)
    assert (world.samples, world.replaced) == (90_000, [])
    assert 'not_steady' in {finding.code for finding in result_of(world.runs.run).warnings}


def test_a_clock_that_steps_is_the_same_imu_and_no_recording_in_a_loop():
    world = World()
    world.comes(at_rest(6000))
    later = at_rest(6000, start_s=60.0, seed=2)
    world.comes(replace(later, header_ns=later.header_ns - 3600 * SECOND))
    assert (world.samples, world.timeline.gaps, world.replaced) == (12_000, (), [])
    assert world.timeline.duration_s == pytest.approx(120.0, rel=.01)
    assert [remark.code for remark in world.summaries()[0].remarks] == ['clock_jumps']


def test_a_driver_that_restarts_after_the_system_clock_was_set_back_goes_on(world):
    later = at_rest(6000, start_s=PROVEN_S, seed=2)
    world.comes(replace(later, receive_ns=later.receive_ns - 3600 * SECOND), publisher=2)
    assert (world.samples, world.facts[0].mixed_samples) == (PROVEN_S * RATE_HZ + 6000, 0)
    assert not world.replaced


@pytest.mark.parametrize('count', [10, 3000])
def test_another_imu_behind_a_restart_begins_a_new_run_and_few_samples_do_no_harm(world, count):
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


def test_a_frame_that_changes_within_a_bundle_divides_it_between_two_runs(world):
    world.runs.take(0, 1, [at_rest(30, start_s=PROVEN_S), replace(
        at_rest(4000, start_s=PROVEN_S + 0.3), frame_id='other')])
    [(before, _)] = world.replaced
    for timeline, samples in (result_of(before).timeline, 30_030), (world.timeline, 4000):
        assert (timeline.samples, timeline.rejected) == (samples, 0)


def test_a_rate_that_changes_before_any_fit_begins_a_new_run_and_who_is_mixed_feeds_none():
    runs = World().runs
    runs.take(0, MIXED, [at_rest(1000)])
    assert runs.run.fed == 0
    for start_s, rate_hz in (0.0, 200.0), (60.0, 208.0):
        block = at_rest(round(60 * rate_hz), rate_hz, start_s=start_s, seed=round(rate_hz))
        for first in range(0, len(block), 100):
            runs.take(0, 1, [block.part(slice(first, first + 100))])
    [lane] = runs.run.lanes
    assert (lane.known.rate_hz, lane.fed > 5000) == (pytest.approx(208.0, rel=1e-3), True)


def test_a_half_that_changes_rate_or_frame_for_good_begins_a_new_run_of_both():
    world = World(setup=HALVES)

    def comes(name, *part, **other):
        world.comes(replace(half(name, *part).only(name), **other),
                    number=('gyro', 'accel').index(name))

    comes('gyro', 12.0)
    comes('accel', 12.0)
    # A run of two topics goes on behind a restart.
    world = World(resumed(world.runs.run, HALVES), HALVES)
    comes('gyro', 4.0, 100.0)
    comes('accel', 4.0, 100.0)
    assert (world.samples, world.replaced) == (3200, [])
    comes('accel', 8.0, 120.0, 250.0)
    comes('gyro', 8.0, 120.0)
    comes('accel', 12.0, 128.0, 250.0)
    # If one sensor of an IMU begins anew, so does the other.
    assert world.samples == 1600
    comes('accel', 20.0, 140.0, 250.0)
    comes('gyro', 20.0, 140.0)
    assert [seen.timeline.sample_rate_hz for seen in world.summaries()] == pytest.approx(
        [200.0, 250.0], rel=1e-3)
    comes('gyro', 15.0, 160.0, frame_id='other')
    # What came of the accelerometer before belongs to the run before.
    comes('accel', 10.0, 180.0, 250.0)
    assert [str(why) for _, why in world.replaced] == [
        'it is of 125 Hz, the messages now come at 250 Hz',
        "it is of frame_id 'gyro_frame', the messages now have 'other'"]
    assert [(seen.timeline.samples, seen.frame_id) for seen in world.summaries()] == [
        (3000, 'other'), (2500, 'accel_frame')]


def test_stamps_that_the_user_insists_on_are_refused_with_a_remedy_that_a_node_has():
    [lane] = new_run(Setup(('/imu',), TimelineOptions(clock='header'))).lanes
    sound = at_rest(6000)
    lane.update([replace(sound, header_ns=np.zeros_like(sound.header_ns))])
    assert lane.error == '/imu: header stamps are zero: choose the other clock (parameter clock)'


@pytest.mark.parametrize(('joined', 'together'), [(1000, 50), (3700, 2500)])
def test_a_recording_joined_in_the_middle_counts_once_from_its_beginning_on(joined, together):
    # One axis is absent, as of an IMU of five.
    whole, world = at_rest(4000, mean=(0, 0, np.nan, 0, 0, 9.8)), World()
    played = np.concatenate([np.arange(joined, 4000), np.tile(np.arange(4000), 2)])
    # Then the player is started anew, later also at another place, and the node.
    for begin in range(3):
        world.comes(whole.part(played), together=together)
        assert world.facts[0].looping
        world.runs.run.lanes[0].power_on()
        world = World(resumed(world.runs.run)) if begin else world
        played = np.arange(500 * begin, 4000)
    assert world.samples == 4000


def test_a_second_time_counts_once_though_the_node_ended_before_the_unit_was_known():
    run, block = new_run(SETUP), at_rest(1000, noise=1.0, mean=0)
    run.lanes[0].update([block])
    run = resumed(run)
    run.lanes[0].update([block])
    assert result_of(run).timeline.samples == 1000
    assert not run.lanes[0].seen.looping


@pytest.mark.parametrize('value', [1e300, -1e308, np.inf, np.nan])
def test_a_run_with_a_sample_beyond_all_numbers_goes_on_after_a_crash(value):
    run, block = new_run(SETUP), at_rest(6000)
    # Among the first, which are remembered, and the last, which wait for their neighbours.
    block.samples[[3, 3000, 5990], 1] = value
    # For some seconds, in which messages without that axis are rejected.
    block.samples[4000:4400, 4] = value
    for first, last in pairwise([0, 100, *range(4000, 4400, 50), 5995, 6000]):
        run.lanes[0].update([block.part(slice(first, last))])
        run = resumed(run)
    timeline = result_of(run).timeline
    assert (timeline.samples, timeline.rejected) == (5597, 403)


def test_messages_too_few_to_be_used_do_not_name_the_frame_after_a_crash():
    run = new_run(SETUP)
    run.lanes[0].update([at_rest(5)])
    world = World(resumed(run))
    world.comes(at_rest(5, start_s=5.0, seed=2, frame_id='of the start'),
                at_rest(12_000, start_s=5.05, seed=3))
    assert world.samples > 11_000
    assert world.runs.run.lanes[0].known.frame_id == 'imu'


def test_means_of_every_boot_make_the_turn_on_bias(boot):
    biases, run, means = np.random.default_rng(1).normal(0, 0.1, 6), new_run(SETUP), []
    for number, bias in enumerate(biases):
        run = rebooted(run, boot, f'boot {number}') if number else run
        block = at_rest(4000, 200.0, start_s=number * 1e5, seed=number, mean=(bias, 0, 0, 0, 0, 0))
        run.lanes[0].update([block])
        means.append(float(block.samples[:, 0].mean()))
    spread, error = result_of(run).turn_on_bias, NOISE / 4000**0.5
    expected = random_effects(means, [error] * len(means))
    assert spread['gyro_x'].sigma == pytest.approx(expected.between, rel=1e-3)
    assert spread['gyro_x'].ci95 == pytest.approx(expected.between_ci95, rel=1e-2)
    assert spread['accel_x'].sigma < 3 * error


def test_power_ons_one_soon_after_the_other_are_no_slow_turn():
    run = new_run(SETUP)
    for number, bias in enumerate([0.0, 0.1, 0.0, 0.1, 0.0]):
        run.lanes[0].update([at_rest(4000, start_s=60.0 * number, seed=number,
                                     mean=(bias, 0, 0, 0, 0, 9.8))])
        run.lanes[0].power_on()
    assert 'slow_motion' not in {finding.code for finding in result_of(run).warnings}


def stream(first, count, start_s):
    """Give numbers of messages of one publisher, and when they are received, at 200 Hz."""
    return [(first + i, start_s + i * 0.005) for i in range(count)]


@pytest.mark.parametrize('steps', [
    # Of each step: what comes, whose it is, how many are lost, and who delivers a moment later.
    pytest.param([([*stream(1, 100, 0.0), *stream(111, 100, 0.55)], [1], 10, 1)], id='losses'),
    pytest.param([(stream(1, 1000, 0.0), [1], 0, 1), (stream(2001, 1000, 10.0), [1], 1000, 1)],
                 id='a pause of the node'),
    pytest.param([(stream(1, 4000, 0.0), [1], 0, 1),
                  (sorted([*stream(4001, 1000, 20.0), *stream(1, 1000, 20.001)],
                          key=itemgetter(1)), [1, 2], 0, 2),
                  (stream(5001, 2000, 25.0), [1], 0, 1)], id='two in turn'),
    # The first messages may come before it is discovered.
    pytest.param([(stream(1, 4000, 0.0), [1], 0, 1), (stream(1, 4000, 20.5), [2], 0, 1),
                  (stream(300, 4000, 41.0), [3], 0, 1)], id='a driver that starts anew'),
    pytest.param([(stream(1, 4000, 3600.0), [1], 0, 1), (stream(1, 8000, 5.0), [2], 0, 1)],
                 id='a driver that starts anew after the clock was set back'),
    # In parts, one of which ends where the first driver has ended.
    pytest.param([(stream(1, 100, 0.0), [1], 0, 1), *(
        (stream(1 + 50 * part, 50, 3.0 + 0.25 * part), [2], 0, 1) for part in range(8))],
        id='a driver that passes the last number of the one before')])
def test_numbers_tell_whose_messages_are_and_how_many_are_lost(steps):
    publishers = Publishers()
    for messages, senders, lost, delivering in steps:
        numbers, seconds = zip(*messages, strict=True)
        keys, missed = publishers.of(np.array(numbers),
                                     np.rint(np.array(seconds) * SECOND).astype(int))
        assert (list(dict.fromkeys(keys.tolist())), missed) == (senders, lost)
        assert len(set(np.bincount(keys)[senders])) == 1
        assert publishers.delivering(round((seconds[-1] + 4) * SECOND)) == delivering


def test_two_that_started_together_are_mixed_until_one_is_left():
    publishers, bundle = Publishers(), 20
    both = np.repeat(np.arange(1, 1001).reshape(-1, 1, bundle), 2, axis=1).ravel()
    keys, lost = publishers.of(both, (5_000_000 * both).astype(int))
    assert (set(keys[2 * bundle:].tolist()), lost) == ({MIXED}, 0)
    assert publishers.delivering(5 * SECOND) == 2
    left = np.arange(1001, 3001)
    keys, lost = publishers.of(left, 5_000_000 * left)
    assert (keys[0], keys[-1] > 0, lost) == (MIXED, True, 0)


def test_without_numbers_another_set_of_offers_is_another_publisher():
    offers = set()
    publishers = Publishers(lambda: set(offers))

    def sender(seconds, *there):
        offers.clear()
        offers.update(there)
        keys, lost = publishers.of(None, np.full(3, round(seconds * SECOND)))
        assert (len(set(keys)), lost) == (1, 0)
        return int(keys[0])

    assert [sender(0, *there) for there in ([], [b'a'], [b'a', b'b'], [b'b'], [b'c'], [])] == [
        1, 1, 1, 2, 3, 3]
    # The identity of a driver that was killed stays for a while: after a silence it is the
    # newcomer who sends. What that one loses is no other publisher.
    killed, both, three = [b'c'], [b'c', b'd'], [b'c', b'd', b'e']
    assert [sender(seconds, *there) for seconds, there in (
        (0.5, killed), (1.5, both), (6.0, three), (10.0, three))] == [3, 3, 4, 4]


@pytest.mark.parametrize('speed', [1.0, 100.0])
def test_a_fit_is_due_as_the_record_grows_however_fast_it_is_replayed(speed):
    run, looks, began = Mock(over=False, fitted=0, stamp_ns=1), [], time.monotonic()

    def fit(_, __, publish):
        looks.append(run.fed)
        publish(Mock(result=None, cpu_s=0.5))

    run.lanes = []
    fitting = Fitting('', Mock(), Mock(under_way=lambda _: False, start=fit), Mock(), Mock(), {
        'spec_file': '', 'reference': '', 'aiding_interval': 0.1, 'coast': 60.0,
        'publish_period': 1.0})
    for second in range(1, 61):
        run.fed, run.span_s = second, speed * second
        fitting.publish_or_fit(began + second + 0.5, run, began + second)
    # Half a second of the processor is 1 % of 50 s; until then the record is to be tripled.
    assert looks == [1, 3, 9, 27, 50, 60]


@pytest.mark.parametrize('bundle_s', [0.5, 1.0, 1.6])
def test_a_driver_that_sends_in_bundles_goes_on_beside_a_stranger(world, bundle_s):
    own = at_rest(2000, start_s=PROVEN_S, seed=2)
    stranger = at_rest(1000, start_s=PROVEN_S + 3.1, seed=3, mean=(0.5, 0, 0, 0, 0, 9.8))
    ends = np.arange(1, len(own) + 1) / RATE_HZ
    arrives_s = PROVEN_S + np.ceil(ends / bundle_s - 1e-9) * bundle_s
    own = replace(own, receive_ns=START_NS + np.rint(arrives_s * SECOND).astype(np.int64))
    for tick_s in np.arange(PROVEN_S, PROVEN_S + 21, 0.5):
        for publisher, block in (2, stranger), (1, own):
            since_s = (block.receive_ns - START_NS) / SECOND - tick_s
            part = block.part((since_s > 0) & (since_s <= 0.5))
            if len(part):
                world.runs.take(0, publisher, [part])
    world.runs.finish()
    assert world.samples == PROVEN_S * RATE_HZ + 2000
    assert (ended(world.runs.run), world.facts[0].mixed_samples) == ([], 1000)
    assert not world.lines


def test_a_single_message_of_a_stranger_is_passed_over_as_soon_as_the_driver_goes_on(world):
    world.comes(at_rest(1, start_s=PROVEN_S), publisher=2)
    assert world.facts[0].on_probation
    world.comes(at_rest(100, start_s=PROVEN_S))
    assert (world.facts[0].on_probation, world.facts[0].mixed_samples) == (False, 1)


def of_another(seconds, start_s=PROVEN_S):
    return replace(at_rest(round(seconds * RATE_HZ), start_s=start_s, seed=4), frame_id='other')


def test_a_reset_lets_the_run_of_another_imu_begin_at_once_and_keeps_the_one_before(world):
    before = world.runs.run
    world.comes(of_another(10.0), publisher=2)
    assert world.facts[0].elsewhere
    world.runs.begin_anew()
    assert ([run for run, _ in world.replaced], world.samples) == ([before], 1000)
    assert not world.facts[0].elsewhere
    # A reset without another IMU is what the user wants to be rid of.
    world.runs.begin_anew()
    assert (len(world.replaced), world.samples) == (1, 0)


def test_a_crash_costs_neither_the_run_nor_that_of_another_imu(world):
    world.comes(of_another(10.0), publisher=2)
    run, other = unpack(pack(world.runs.saved, SETUP), SETUP)
    again = World(run)
    again.runs = Runs(SETUP, run, [(again.facts[0], set)], lambda: 0.5, Mock(), Log(Mock), [other])
    again.comes(of_another(5.0, PROVEN_S + 20), publisher=1)
    assert (again.samples, again.runs.unproven) == (PROVEN_S * RATE_HZ, other)
    assert result_of(other).timeline.samples == 1500


@pytest.mark.usefixtures('boot')
def test_a_driver_without_a_frame_that_started_while_the_node_was_down_is_noticed():
    before = World()
    before.there = {'before'}
    before.comes(replace(at_rest(6000), frame_id=''))
    world = World(resumed(before.runs.run))
    world.there = {'another'}
    world.comes(replace(at_rest(6000, start_s=90.0, seed=2), frame_id=''))
    assert len(ended(world.runs.run)) == 1


def test_samples_of_a_restarted_driver_are_new_though_it_begins_with_the_same_zeros():
    world = World()
    for seed in range(2):
        # The stamps count from the start of the driver.
        block = at_rest(6000, seed=seed)
        block.samples[:10] = 0
        stamps = block.header_ns - block.header_ns[0] + SECOND
        world.comes(replace(block, header_ns=stamps, receive_ns=block.receive_ns
                            + 100 * seed * SECOND), publisher=seed + 1)
    assert not world.facts[0].looping
    assert world.samples >= 11_900
    # Both clocks run equally fast, though the header's begins anew.
    assert 'clock_speed' not in {remark.code for remark in world.summaries()[0].remarks}


def test_equal_zeros_before_a_sensor_measures_are_no_recording_that_begins_again():
    seen = Seen()
    passed = 0
    for seed in range(2):
        # Longer than all samples are remembered: of the second start, only zeros are known.
        block = at_rest(100_000, 10.0, seed=seed)
        block.samples[:10] = 0
        block = replace(block, header_ns=block.header_ns - START_NS + SECOND)
        passed += sum(map(len, seen.unseen([block.part(slice(at, at + 100))
                                            for at in range(0, len(block), 100)])))
    assert (passed, seen.looping) == (200_000, False)
