# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Everything at once, at random, with a seed: drivers, sensors, strangers, kills, signals."""

from collections.abc import Callable
import json
from math import inf
import random
import signal
import time

import pytest
from rclpy.duration import Duration
from repeated import slow
from ros_harness import assert_density, NOISE, Process, Ros, Sensor
from std_msgs.msg import String
from std_srvs.srv import SetBool

PLUG_S = 2.5
"""Nobody plugs in faster: whoever sends again sooner has only been slow."""
COSTS = {'rate': 1300, 'stranger beside': 300, 'pause': 300}
"""Samples of the IMU that may be lost: what comes meanwhile, and what is held for a look at it."""
CHECKPOINT_S = 1.0
LATE_S = 0.2
"""A checkpoint that is due may take so long to reach the disk."""


class HostileWorld:
    """Draws what happens next to an IMU, to its driver and to the node, or in place of them."""

    def __init__(self, ros: Ros, seed: int, polled: int) -> None:
        self.ros = ros
        self.draw = random.Random(seed)
        self.polled = polled
        self.happened: list[str] = []
        self.nodes: list[Process] = []
        # Samples that kills may have lost, and when how many had come to the node that runs.
        self.killed = 0
        self._taken: list[tuple[float, int]] = []
        self.imu = Sensor(ros, 100.0, seed)
        self._start()
        self.imu.plug_in()
        self._actions: dict[str, Callable[[], None]] = {
            'replug': self._replug, 'swap': self._swap, 'stranger beside': self._beside,
            'stranger instead': self._instead, 'rate': self._rate, 'kill': self._kill,
            'signal': self._signal, 'clock jump': self._clock_jump, 'pause': self._pause}

    def go_on(self) -> None:
        """Let one thing happen, then the IMU be at rest."""
        kind = self.draw.choice(sorted(self._actions))
        self.happened.append(kind)
        self._actions[kind]()
        self.rest(20.0)
        assert self.nodes[-1].running, (self.happened[-5:], self.nodes[-1].log)

    def rest(self, seconds: float) -> None:
        """Measure in peace, and leave the node its time."""
        for _ in range(2):
            self.imu.measure(seconds / 2, self.polled)
            self.ros.executor.spin_once(timeout_sec=0.1)
            if self._has_come(0.1):
                self._taken.append((self._lived_s(), self.imu.sent))

    def _has_come(self, within_s: float = 0.0) -> bool:
        """Whether nothing is on its way to the node, or to one that was killed just now."""
        assert self.imu.driver is not None
        return bool(self.imu.driver.publisher.wait_for_all_acked(
            Duration(seconds=within_s)))

    def _lived_s(self) -> float:
        """Tell how long the node had a core, or needed none."""
        return time.monotonic() - self.nodes[-1].starved_s

    def _start(self) -> None:
        self.nodes.append(self.ros.start('imu_allan_node', {
            'publish_period': 0.5, 'checkpoint_period': CHECKPOINT_S,
            'state_file': str(self.ros.folder / 'state')}))
        self.ros.until(lambda: 'characterizing the IMU' in self.nodes[-1].log)
        self._taken = [(-inf, self.imu.sent)]

    def _again(self) -> None:
        """Start the node and the driver anew: nobody waits for a reader that was killed."""
        assert self.imu.driver is not None
        self.imu.dead |= self.imu.driver.subscriptions()
        self.imu.unplug(in_peace=False)
        self._start()
        self.imu.plug_in()

    def _plug_in(self, sensor: Sensor) -> None:
        """Plug in a sensor in place of the one before, which takes its time."""
        time.sleep(PLUG_S)
        sensor.plug_in(self.draw.uniform(PLUG_S, 60.0))

    def _replug(self) -> None:
        self.imu.unplug()
        self.imu.bias[:3] = [self.draw.gauss(0, 10 * NOISE) for _ in range(3)]
        self._plug_in(self.imu)

    def _other(self) -> Sensor:
        other = Sensor(self.ros, 100.0, self.draw.randrange(1000))
        other.now_s, other.dead = self.imu.now_s, self.imu.dead
        return other

    def _in_place_of_it(self, other: Sensor, seconds: float, frame_id: str = 'imu') -> None:
        self.imu.unplug()
        self._plug_in(other)
        other.measure(seconds, self.polled, frame_id)
        other.unplug()
        self.imu.now_s = other.now_s
        self._plug_in(self.imu)

    def _swap(self) -> None:
        other = self._other()
        other.noise *= self.draw.choice((0.6, 1.5))
        self._in_place_of_it(other, 8.0)

    def _instead(self) -> None:
        other, frame_id = self._other(), 'imu'
        if self.draw.random() < 0.5:
            frame_id = 'other'
        else:
            other.rate_hz *= self.draw.choice((0.5, 2.0))
        self._in_place_of_it(other, 8.0, frame_id)

    def _beside(self) -> None:
        other = self._other()
        other.noise *= 5
        other.plug_in(0.0)
        for _ in range(200):
            self.imu.measure(0.04, self.polled)
            other.measure(0.04)
        other.unplug()

    def _rate(self) -> None:
        rate_hz = self.imu.rate_hz
        self.imu.rate_hz *= 1 + self.draw.choice((-1, 1)) * self.draw.uniform(0.01, 0.1)
        self.imu.measure(8.0, self.polled)
        self.imu.rate_hz = rate_hz

    def _kill(self) -> None:
        # Data comes faster than time goes: behind a checkpoint of it all some seconds are lost.
        last, _ = self._taken[-1]
        self.ros.until(lambda: self._lived_s() > last + CHECKPOINT_S + LATE_S)
        self.imu.measure(2.0, self.polled)
        due = self._lived_s() - CHECKPOINT_S - LATE_S
        self.killed += self.imu.sent - max(sent for when, sent in self._taken if when < due)
        self.nodes[-1].popen.send_signal(signal.SIGKILL)
        self.nodes[-1].wait()
        self._again()

    def _signal(self) -> None:
        self.ros.until(self._has_come)
        assert self.nodes[-1].stop(self.draw.choice((
            signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT))) == 0
        self._again()

    def _clock_jump(self) -> None:
        self.imu.now_s += self.draw.choice((1, 3600, 100_000))

    def _pause(self) -> None:
        assert self.imu.driver is not None
        self.ros.until(self._has_come)
        self.ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=True))
        self.imu.measure(2.0, self.polled)
        assert self.imu.driver.publisher.wait_for_all_acked()
        self.ros.call(SetBool, 'imu_allan/pause')


@pytest.mark.parametrize(('seconds', 'seed', 'polled'), [
    (60.0, 5, 2), slow(60.0, 5, 1), slow(1800.0, 6, 1), slow(1800.0, 6, 2)])
def test_a_hostile_time_is_one_run_of_one_imu(
        ros: Ros, seconds: float, seed: int, polled: int) -> None:
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
    assert world.imu.driver is not None
    world.imu.driver.until_taken()
    document = ros.saved()
    assert_density(document, 100.0)
    lines = [line for node in world.nodes for line in node.lines]
    assert not [line for line in lines if line.startswith('a new run')], (world.happened, lines)
    assert not [line for line in lines if 'Traceback' in line or 'RuntimeWarning' in line]
    samples = document['timeline']['samples']
    # What a kill loses are seconds.
    assert samples > 0.8 * world.imu.sent, (samples, world.imu.sent, world.happened)
    # What has come since the last checkpoint, at another rate, or among another's, is no more.
    lost = world.killed + sum(COSTS.get(kind, 0) for kind in world.happened)
    assert samples >= world.imu.sent - lost - 1000, (samples, world.imu.sent, world.happened)
