# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Everything at once, at random, with a seed: drivers, listeners, kills, disks, parameters."""

from collections.abc import Callable
import json
from pathlib import Path
import random
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.cdr import encode_imu
from imu_allan.noise.terms import AXES
import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_harness import Driver, Process, RATE_HZ, Ros
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

TRUTH = 0.01 / RATE_HZ**0.5
TOPICS = {'imu_allan/coefficients': DiagnosticArray, 'imu_allan/result': String,
          'imu_allan/gyro/noise_density': Vector3Stamped,
          'imu_allan/plot/compressed': CompressedImage, '/diagnostics': DiagnosticArray}
GOOD = 200
"""Samples at rest between two faults."""


class HostileWorld:
    """Draws what happens next to a node that has a state file."""

    def __init__(self, ros: Ros, seed: int) -> None:
        self.ros = ros
        self.draw = random.Random(seed)
        self.happened: list[str] = []
        self._subscriptions: list[Any] = []
        self._folder = ros.folder / 'world'
        self.node = self._started()
        # It does not wait for a node that was killed.
        self.driver = Driver(ros, depth=1000)
        self.driver.wait_for_node()
        self._actions: dict[str, Callable[[], None]] = {
            'unusable values': self._unusable_values, 'no messages': self._no_messages,
            'another frame_id': self._another_frame, 'lost samples': self._lost_samples,
            'the same again': self._the_same_again, 'clock jump': self._clock_jump,
            'driver restarts': self._driver_restarts, 'listener': self._listener,
            'listener leaves': self._listener_leaves, 'kill': self._kill, 'stop': self._stop,
            'output in the way': self._output_in_the_way, 'state in the way':
            self._state_in_the_way, 'parameter': self._parameter, 'save': self._save,
            'pause': self._pause}

    def _started(self) -> Process:
        node = self.ros.start('imu_allan_node', {
            'publish_period': 0.5, 'checkpoint_period': 1.0,
            'state_file': str(self._folder / 'states' / 'state'),
            'output_dir': str(self._folder / 'output')})
        # A signal before its handler is there ends any process.
        self.ros.until(lambda: 'characterizing the IMU' in node.log)
        return node

    def go_on(self) -> None:
        """Let one thing happen, then some samples at rest."""
        kind = self.draw.choice(sorted(self._actions))
        self.happened.append(kind)
        self._actions[kind]()
        self.driver.publish(GOOD)
        self.ros.executor.spin_once(timeout_sec=0.05)
        assert self.node.running, (self.happened[-5:], self.node.log)
        assert 'Traceback' not in self.node.log, (self.happened[-5:], self.node.log)

    def make_good(self) -> None:
        """Take everything out of the way."""
        for name in ('states', 'output'):
            if (self._folder / name).is_file():
                (self._folder / name).unlink()

    def _send(self, value: float, absent: tuple[bool, bool] = (False, False)) -> None:
        stamp = 1_700_000_000 * 10**9 + round(self.driver.next / RATE_HZ * 1e9)
        self.driver.send(encode_imu(stamp, np.full(6, value), 'imu', absent))
        self.driver.next += 1

    def _unusable_values(self) -> None:
        value = self.draw.choice((float('nan'), float('inf'), 1e300))
        for _ in range(self.draw.randrange(1, 50)):
            self._send(value)

    def _no_messages(self) -> None:
        for _ in range(20):
            self.driver.send(self.draw.randbytes(self.draw.randrange(4, 400)))

    def _another_frame(self) -> None:
        for _ in range(20):
            sample = np.asarray([self.draw.gauss(0, 1) for _ in range(6)])
            self.driver.send(encode_imu(10**18, sample, 'other'))

    def _lost_samples(self) -> None:
        self.driver.next += self.draw.randrange(1, 400)

    def _the_same_again(self) -> None:
        self.driver.next -= self.draw.randrange(1, 100)
        before = self.driver.random.bit_generator.state
        self.driver.publish(1)
        self.driver.random.bit_generator.state = before

    def _clock_jump(self) -> None:
        self.driver.next += round(RATE_HZ * self.draw.choice((3600, 100_000)))

    def _driver_restarts(self) -> None:
        following = self.driver.next
        self.ros.node.destroy_publisher(self.driver.publisher)
        self.driver = Driver(self.ros, depth=1000)
        self.driver.next = following

    def _listener(self) -> None:
        topic = self.draw.choice(sorted(TOPICS))
        name = topic if topic.startswith('/') else self.ros.name(topic)
        self._subscriptions.append(self.ros.node.create_subscription(
            TOPICS[topic], name, lambda _: None, 10))

    def _listener_leaves(self) -> None:
        if self._subscriptions:
            self.ros.node.destroy_subscription(self._subscriptions.pop())

    def _kill(self) -> None:
        self.node.popen.send_signal(signal.SIGKILL)
        self.node.wait()
        self.make_good()
        self.node = self._started()

    def _stop(self) -> None:
        # With a disk in the way the end says 1, but it says so.
        assert self.node.stop(self.draw.choice((signal.SIGINT, signal.SIGTERM))) in (0, 1)
        assert 'Traceback' not in self.node.log
        self.make_good()
        self.node = self._started()

    def _output_in_the_way(self) -> None:
        self._put_in_the_way('output')

    def _state_in_the_way(self) -> None:
        self._put_in_the_way('states')

    def _put_in_the_way(self, name: str) -> None:
        folder = self._folder / name
        if folder.is_dir():
            folder.rename(self._folder / f'{name}{len(self.happened)}')
            folder.write_text('in the way')
        else:
            self.make_good()

    def _parameter(self) -> None:
        name, value = self.draw.choice((
            ('publish_period', 0.5), ('publish_period', 1.0), ('publish_period', -1.0),
            ('checkpoint_period', 1.0), ('checkpoint_period', 2.0), ('export_for', ['kalibr']),
            ('export_for', ['']), ('export_for', ['nonsense']), ('coast', 20.0),
            ('aiding_interval', 50.0), ('aiding_interval', 0.1), ('motion', 'keep')))
        client = self.ros.node.create_client(
            SetParameters, self.ros.name('imu_allan/set_parameters'))
        if client.service_is_ready():
            client.call_async(SetParameters.Request(
                parameters=[Parameter(name, value=value).to_parameter_msg()]))
            self.ros.executor.spin_once(timeout_sec=0.1)
        self.ros.node.destroy_client(client)

    def _ask(self, kind: type, service: str, request: Any) -> None:
        client = self.ros.node.create_client(kind, self.ros.name(f'imu_allan/{service}'))
        if client.service_is_ready():
            client.call_async(request)
            self.ros.executor.spin_once(timeout_sec=0.1)
        self.ros.node.destroy_client(client)

    def _save(self) -> None:
        self._ask(Trigger, 'save', Trigger.Request())

    def _pause(self) -> None:
        self._ask(SetBool, 'pause', SetBool.Request(data=self.draw.random() < 0.3))


def survive(ros: Ros, seconds: float, seed: int) -> None:
    (ros.folder / 'world').mkdir()
    world = HostileWorld(ros, seed)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        world.go_on()
    world.make_good()
    ros.until(lambda: ros.call(SetBool, 'imu_allan/pause').success)

    def saved() -> Any:
        world.driver.publish(500)
        response = ros.call(Trigger, 'imu_allan/save')
        if not response.success:
            return None
        document = json.loads(Path(response.message.splitlines()[0]).read_text())
        return document if set(document['axes']) == set(AXES) else None

    document = ros.until(saved)
    for name in AXES:
        low, high = document['axes'][name]['coefficients']['noise_density']['ci95']
        # Three intervals wide, so that chance has no say.
        assert low - (high - low) < TRUTH < high + (high - low), (name, low, high)
    assert world.node.running
    assert 'Traceback' not in world.node.log
    assert world.node.stop() == 0, world.node.log


def test_a_hostile_half_minute_leaves_a_node_with_the_true_noise_density(ros: Ros) -> None:
    survive(ros, 30.0, 12)


@pytest.mark.slow
def test_a_hostile_hour_leaves_a_node_with_the_true_noise_density(ros: Ros) -> None:
    survive(ros, 3600.0, 1)
