# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose messages come: a driver and its sensor go and return, change, or give way to others."""

from collections.abc import Callable
import json
import random
import signal
import time

from characterized import AXES
from imu_allan.node.drained_subscription import DrainedSubscription
import numpy as np
import pytest
from rclpy.topic_endpoint_info import TopicEndpointInfo
from repeated import slow
from ros_harness import assert_density, at_rest, Driver, NOISE, RATE_HZ, Sensor
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import SetBool
from whole_lines import Varying

PLUG_S = 2.5
"""Nobody plugs in faster: whoever sends again sooner has only been slow."""
COSTS = {'rate': 1300, 'stranger beside': 300, 'pause': 300}
"""Samples of the IMU that may be lost: what comes meanwhile, and what is held for a look at it."""


def saved(ros, sensor):
    sensor.driver.until_taken()
    return ros.saved()


def test_a_lasting_change_begins_a_new_run_and_keeps_the_old_one_until_its_imu_returns(ros):
    state, reason = ros.folder / 'state', "it is of frame_id 'imu', the messages now have 'other'"
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'state_file': str(state)})

    def measure_until(sensor, words, frame_id='imu'):
        ros.until(lambda: sensor.measure(5.0, frame_id=frame_id) or words in node.log,
                  timeout=90.0)

    sensor = Sensor(ros)
    sensor.plug_in()
    sensor.measure(300.0)
    # The first fit, from which on the run is known.
    ros.until(lambda: 'observable: noise density' in node.log)
    sensor.unplug()
    other = Sensor(ros, seed=2)
    other.now_s = sensor.now_s
    other.plug_in()
    measure_until(other, f'a new run begins, the last one cannot go on: {reason}', 'other')
    other.measure(20.0, frame_id='other')
    document = saved(ros, other)
    # It begins with the first sample after the change.
    assert document['timeline']['rejected'] == 0
    assert document['source']['frame_id'] == 'other'
    assert document['timeline']['sample_rate_hz'] == pytest.approx(50.0, rel=1e-3)
    kept = Varying(f'the last run cannot go on, {reason}; its state is kept as state.<words>')
    ros.until(lambda: kept in node.lines)
    [aside] = ros.folder.glob('state.*Z')
    assert aside.stat().st_size > 10_000
    assert sorted(found['source']['frame_id'] for found in ros.results()) == ['imu', 'other']
    other.unplug()
    sensor.now_s = other.now_s
    sensor.plug_in()
    measure_until(sensor, 'the earlier run goes on, the last one cannot go on')
    sensor.measure(20.0)
    document = saved(ros, sensor)
    assert document['timeline']['samples'] == pytest.approx(sensor.sent, abs=100)
    assert document['source']['frame_id'] == 'imu'
    # At the end the run of a third is saved too, which has not lasted; drawings come last.
    sensor.unplug()
    other.now_s = sensor.now_s
    other.plug_in()
    # Longer than the longest look at it, and shorter than it has to last.
    other.measure(15.0, frame_id='third')
    ros.until(lambda: node.log.count('are of another IMU') == 3)
    other.unplug()
    began_ns = time.time_ns()
    assert node.stop(within_s=10.0) == 0, node.log
    # The state may have been written before, at a checkpoint: nothing has come to the run since.
    written = sorted((path.stat().st_mtime_ns, path.name)
                     for path in (ros.folder / 'output').glob('*/*'))
    written = [(when, name) for when, name in written if when > began_ns]
    assert state.stat().st_mtime_ns < written[0][0]
    names = [name for _, name in written]
    assert names[-1] == 'allan_deviation.png'
    assert (names.count('result.json'), names.count('allan_deviation.png')) == (2, 1)


def test_replugs_are_power_ons_and_neither_a_step_nor_a_random_walk(ros):
    node, sensor = ros.start('imu_allan_node', {'publish_period': 0.5}), Sensor(ros, 100.0)
    biases = [[0.0, 0.0, 0.0], [0.01, -0.02, 0.1],
              *np.random.default_rng(3).normal(0, 0.1, (2, 3)).tolist()]
    for count, bias in enumerate(biases, 1):
        sensor.bias[:3] = bias
        sensor.unplug()
        # Longer than any pause of which nothing is said.
        time.sleep(1.5 if count == 2 else 0)
        sensor.plug_in()
        # Each time for longer than from one fit to the next.
        for _ in range(2):
            sensor.measure(60.0)
            ros.executor.spin_once(timeout_sec=0.6)
        ros.until(lambda: 'observable: noise density' in node.log)
        if count not in (2, len(biases)):
            continue
        document = saved(ros, sensor)
        assert node.log.count('may have been switched off and on') == count - 1
        timeline = document['timeline']
        assert timeline['samples'] == pytest.approx(sensor.sent, abs=10 * count)
        assert timeline['rejected'] == timeline['out_of_order'] == 0
        assert not {'bias_step', 'warm_up', 'slow_cycle', 'trend_or_walk', 'not_steady'} & {
            warning['code'] for warning in document['warnings']}
        for name, sigma in zip(AXES, np.std(biases[:count], axis=0, ddof=1), strict=False):
            assert document['turn_on_bias'][name]['sigma'] == pytest.approx(sigma, rel=0.1), name
            for key in ('rate_random_walk', 'bias_instability', 'rate_ramp'):
                assert not document['axes'][name]['coefficients'][key]['observable'], (name, key)
    low, high = document['turn_on_bias']['gyro_x']['ci95']
    assert low < np.std(np.array(biases)[:, 0], ddof=1) < high
    assert_density(document, 100.0)
    assert 'a new run begins' not in node.log


def test_a_publisher_that_is_no_node_is_called_a_program(ros, monkeypatch):
    subscription = DrainedSubscription(ros.node, Imu, ros.name('imu'), 10)
    offers = [TopicEndpointInfo(node_name=name, node_namespace=namespace, topic_type='a/msg/B')
              for name, namespace in (('_NODE_NAME_UNKNOWN_', '_NODE_NAMESPACE_UNKNOWN_'),
                                      ('_CREATED_BY_BARE_DDS_APP_',) * 2, ('driver', '/'))]
    monkeypatch.setattr(ros.node, 'get_publishers_info_by_topic', lambda _: offers)
    assert subscription.publisher_names() == ['/driver', *['an unknown program'] * 2]
    assert subscription.refused_publishers()[0] == (
        'an unknown program publishes a/msg/B, not sensor_msgs/msg/Imu')


def test_a_run_goes_on_with_the_samples_of_its_own_publisher(ros, health):
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    first = Driver(ros).wait_for_node()
    first.publish(2000)
    first.until_taken()
    second = Driver(ros).wait_for_node()
    second.next = first.next
    # For longer than the longest look at it.
    for _ in range(2200):
        first.publish(1)
        second.publish(1, shaken=5.0)
    first.until_taken()
    second.until_taken()
    mixed = (f'messages on {first.topic} are passed over: they are of another publisher than the '
             'run, or too few to tell')
    names = f'{ros.name("tester")} and {ros.name("tester")}'
    for line in (mixed, f'2 publishers on {first.topic} ({names}): where their samples mix they '
                 'are passed over; give every IMU a topic of its own'):
        ros.until(lambda line=line: line in node.lines)
        assert node.lines.count(line) == 1
    ros.until(lambda: health.said('reception', mixed, b'\2'))
    ros.node.destroy_publisher(second.publisher)
    first.publish(300)
    first.until_taken()
    ros.until(lambda: f'one publisher is left on {first.topic}' in node.lines)
    health.news()
    assert health.number('reception', 'lost') == 0
    document = ros.saved()
    assert document['timeline']['samples'] == 4500
    assert_density(document, RATE_HZ)


def test_a_driver_that_was_killed_and_started_again_is_one_publisher(ros, health):
    ros.start('imu_allan_node')
    for seed in range(2):
        before = health.number('reception', 'received') if seed else 0
        driver = ros.start('imu_simulator', {'rate': RATE_HZ, 'seed': seed})
        ros.until(lambda least=before + 2 * RATE_HZ: health.number(
            'reception', 'received') > least)
        driver.popen.kill()
        driver.wait()
    # The middleware takes each for one that is there until its lease has run out.
    assert max(int(entry.value) for status in health.heard for entry in status.values
               if entry.key == 'publishers') == 1
    assert health.number('reception', 'lost') == 0


def test_a_recording_in_a_loop_is_counted_once(ros, health):
    parameters = {'publish_period': 0.5, 'state_file': str(ros.folder / 'state')}
    node = ros.start('imu_allan_node', parameters)
    driver = Driver(ros).wait_for_node()
    recording = at_rest(2000, RATE_HZ)
    # The node joins in the middle.
    for first in (1200, 0, 0):
        driver.replay(recording.part(slice(first, None)))
        driver.until_taken()
    repeat = (f'the messages on {driver.topic} repeat from the first one on, as a recording '
              'played in a loop does: what has come before is passed over')
    ros.until(lambda: repeat in node.lines and health.said('reception', repeat))
    document = ros.until(ros.saved)
    assert document['timeline']['samples'] == 2000
    assert document['timeline']['out_of_order'] == document['timeline']['duplicates'] == 0
    # A node that is started anew hears first what it joined too late the time before.
    driver.dead = driver.subscriptions()
    assert node.stop() == 0
    node = ros.start('imu_allan_node', parameters)
    driver.wait_for_node()
    driver.replay(recording.part(slice(500, None)))
    driver.until_taken()
    ros.until(lambda: repeat in node.lines)
    assert ros.saved()['timeline']['samples'] == 2000
    # New stamps are new samples.
    driver.next = 2000
    driver.publish(1000)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == 3000
    assert set(document['axes']) == set(AXES)


class HostileWorld:
    """Draws what happens next to an IMU, to its driver and to the node, or in place of them."""

    def __init__(self, ros, seed, polled):
        self.ros = ros
        self.draw = random.Random(seed)
        self.polled = polled
        self.happened = []
        self.nodes = []
        self.imu = Sensor(ros, 100.0, seed)
        self._start()
        self.imu.plug_in()
        self._actions: dict[str, Callable[[], None]] = {
            'replug': self._replug, 'stranger beside': self._beside,
            'stranger instead': self._instead, 'rate': self._rate,
            'signal': self._signal, 'clock jump': self._clock_jump, 'pause': self._pause}

    def go_on(self):
        kind = self.draw.choice(sorted(self._actions))
        self.happened.append(kind)
        self._actions[kind]()
        self.rest(20.0)
        assert self.nodes[-1].running, (self.happened[-5:], self.nodes[-1].log)

    def rest(self, seconds):
        """Measure in peace, and leave the node its time."""
        for _ in range(2):
            self.imu.measure(seconds / 2, self.polled)
            self.ros.executor.spin_once(timeout_sec=0.1)

    def _start(self):
        self.nodes.append(self.ros.start('imu_allan_node', {
            'publish_period': 0.5, 'checkpoint_period': 1.0,
            'state_file': str(self.ros.folder / 'state')}))
        self.ros.until(lambda: 'characterizing the IMU' in self.nodes[-1].log)

    def _plug_in(self, sensor):
        """Plug in a sensor in place of the one before, which takes its time."""
        time.sleep(PLUG_S)
        sensor.plug_in(self.draw.uniform(PLUG_S, 60.0))

    def _replug(self):
        self.imu.unplug()
        self.imu.bias[:3] = [self.draw.gauss(0, 10 * NOISE) for _ in range(3)]
        self._plug_in(self.imu)

    def _other(self):
        other = Sensor(self.ros, 100.0, self.draw.randrange(1000))
        other.now_s = self.imu.now_s
        return other

    def _instead(self):
        other = self._other()
        kind = self.draw.choice(('noise', 'frame_id', 'rate'))
        if kind == 'noise':
            other.noise *= self.draw.choice((0.6, 1.5))
        elif kind == 'rate':
            other.rate_hz *= self.draw.choice((0.5, 2.0))
        self.imu.unplug()
        self._plug_in(other)
        other.measure(8.0, self.polled, 'other' if kind == 'frame_id' else 'imu')
        other.unplug()
        self.imu.now_s = other.now_s
        self._plug_in(self.imu)

    def _beside(self):
        other = self._other()
        other.noise *= 5
        other.plug_in(0.0)
        for _ in range(200):
            self.imu.measure(0.04, self.polled)
            other.measure(0.04)
        other.unplug()

    def _rate(self):
        rate_hz = self.imu.rate_hz
        self.imu.rate_hz *= 1 + self.draw.choice((-1, 1)) * self.draw.uniform(0.01, 0.1)
        self.imu.measure(8.0, self.polled)
        self.imu.rate_hz = rate_hz

    def _signal(self):
        assert self.imu.driver.publisher.wait_for_all_acked()
        assert self.nodes[-1].stop(self.draw.choice((
            signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT))) == 0
        self.imu.unplug()
        self._start()
        self.imu.plug_in()

    def _clock_jump(self):
        self.imu.now_s += self.draw.choice((1, 3600, 100_000))

    def _pause(self):
        assert self.imu.driver.publisher.wait_for_all_acked()
        self.ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=True))
        self.imu.measure(2.0, self.polled)
        assert self.imu.driver.publisher.wait_for_all_acked()
        self.ros.call(SetBool, 'imu_allan/pause')


@pytest.mark.parametrize(('seconds', 'seed', 'polled'), [
    (30.0, 5, 2), slow(60.0, 5, 1), slow(1800.0, 6, 1), slow(1800.0, 6, 2)])
def test_a_hostile_time_is_one_run_of_one_imu(ros, seconds, seed, polled):
    results = ros.listen(String, 'imu_allan/result')
    world = HostileWorld(ros, seed, polled)
    # What it is known by.
    for _ in range(3):
        world.rest(100.0)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        world.go_on()
        for message in results:
            shown = {(name, term) for name, axis in json.loads(message.data)['axes'].items()
                     for term, found in axis['coefficients'].items()
                     if term != 'noise_density' and found['observable']}
            assert not shown, world.happened
        results.clear()
    world.imu.driver.until_taken()
    document = ros.saved()
    assert_density(document, 100.0)
    lines = [line for node in world.nodes for line in node.lines]
    assert not [line for line in lines if line.startswith('a new run')], (world.happened, lines)
    assert not [line for line in lines if 'Traceback' in line or 'RuntimeWarning' in line]
    samples = document['timeline']['samples']
    assert samples > 0.8 * world.imu.sent, (samples, world.imu.sent, world.happened)
    # What has come at another rate or among another's is no more.
    lost = sum(COSTS.get(kind, 0) for kind in world.happened)
    assert samples >= world.imu.sent - lost - 1000, (samples, world.imu.sent, world.happened)
