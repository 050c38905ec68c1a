# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CPU time that a subscriber to an IMU costs, per message.

Three processes take the same messages over DDS, one after the other:

floor     a subscription whose messages are never taken: what the middleware itself costs
node      imu_allan_node with its default settings, estimation and checkpoints included
ordinary  an rclpy callback that stores the six numbers of each message

With --hours the node goes on from a record of that length: fits become rarer as it grows.

The ratios are those of one run on one computer; the figures themselves are not comparable between
computers. Run it on an idle one: python bench/bench_node.py
"""

import argparse
from collections.abc import Iterator
import contextlib
import itertools
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import tempfile
import time

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
import numpy as np

RATES_HZ = (200.0, 1000.0, 4000.0)
KINDS = ('floor', 'node', 'ordinary')
WARM_UP_S = 4.0
MOST_OF_ORDINARY = 0.25
MOST_OF_FLOOR = 2.5


def main() -> int:
    """Measure, print a table and the two ratios for each rate; 1 if one is missed at 1 kHz."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=20.0, help='per measurement')
    parser.add_argument('--rounds', type=int, default=1)
    parser.add_argument('--rates', type=float, nargs='+', default=RATES_HZ)
    parser.add_argument('--hours', type=float, default=0.0,
                        help='length of the record that the node goes on from')
    parser.add_argument('--as', dest='kind', choices=KINDS, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.kind:
        SUBSCRIBERS[args.kind]()
        return 0
    print(f'CPU time per message of the subscribing process, in microseconds '
          f'({args.rounds} x {args.seconds:g} s each)')
    print(f'{"rate":>8} ' + ' '.join(f'{kind:>10}' for kind in KINDS)
          + f' {"node/ordinary":>14} {"node/floor":>11}')
    met = True
    for rate in args.rates:
        costs: dict[str, list[float]] = {kind: [] for kind in KINDS}
        for _ in range(args.rounds):
            for kind in KINDS:
                costs[kind].append(measure(kind, rate, args.seconds, args.hours))
        best = {kind: min(values) for kind, values in costs.items()}
        of_ordinary, of_floor = best['node'] / best['ordinary'], best['node'] / best['floor']
        print(f'{rate:>5g} Hz ' + ' '.join(f'{best[kind] * 1e6:>10.1f}' for kind in KINDS)
              + f' {of_ordinary:>14.3f} {of_floor:>11.2f}', flush=True)
        if rate == 1000:
            met = of_ordinary <= MOST_OF_ORDINARY and of_floor <= MOST_OF_FLOOR
    print(f'wanted at 1 kHz: node/ordinary <= {MOST_OF_ORDINARY}, node/floor <= {MOST_OF_FLOOR}: '
          + ('met' if met else 'MISSED'))
    return 0 if met else 1


def measure(kind: str, rate: float, seconds: float, hours: float = 0.0) -> float:
    """CPU seconds per message of a subscriber of `kind`."""
    with tempfile.TemporaryDirectory() as folder, _domain(folder) as env, Publisher(rate) as imu:
        arguments = {'node': [
            '-c', 'import sys; from imu_allan.node.imu_allan_node import main; sys.exit(main())',
            '--ros-args', '-p', f'output_dir:={folder}/output', '-p',
            f'state_file:={folder}/state', '-p', f'checkpoint_period:={seconds}']}
        if kind == 'node' and hours:
            write_state(f'{folder}/state', rate, hours)
        subscriber = subprocess.Popen(
            [sys.executable, *arguments.get(kind, [__file__, '--as', kind])],
            env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            imu.wait_for_subscription(subscriber)
            imu.publish(WARM_UP_S)
            before = cpu_seconds(subscriber.pid)
            published = imu.publish(seconds)
            spent = cpu_seconds(subscriber.pid) - before
        finally:
            subscriber.send_signal(signal.SIGTERM)
            subscriber.wait(60)
        return spent / published


def write_state(path: str, rate: float, hours: float) -> None:
    """Write the state file of a node that has run for so long."""
    from imu_allan.characterization import Characterization
    from imu_allan.node.checkpoint import StateFile
    from imu_allan.node.resuming import pack, Setup
    from imu_allan.node.run import Lane, Run
    from imu_allan.sensor.noise_model import load_model
    from imu_allan.sensor.simulated_imu import find_model, simulated_blocks
    from imu_allan.timeline import TimelineOptions

    setup = Setup('/imu/data_raw', TimelineOptions())
    run = Characterization(kind='topic', topic=setup.topic, options=setup.options)
    for block in simulated_blocks(load_model(find_model('consumer_mems')), rate,
                                  round(hours * 3600 * rate), start_ns=10**18):
        run.update(block)
    file = StateFile(path)
    file.save(pack(Run(Lane(run)), setup))
    file.close()


class Publisher:
    """An IMU driver in this process that counts what it publishes."""

    def __init__(self, rate: float) -> None:
        import rclpy
        from rclpy.node import Node
        from rclpy.qos import QoSProfile
        from sensor_msgs.msg import Imu

        rclpy.init(args=[])
        self._rate = rate
        self._node = Node('driver')
        self._publisher = self._node.create_publisher(Imu, 'imu/data_raw', QoSProfile(depth=100))
        self._random = np.random.default_rng(1)
        self._next = 0
        self._messages = self._encoded()

    def __enter__(self) -> 'Publisher':
        return self

    def __exit__(self, *_: object) -> None:
        import rclpy
        self._node.destroy_node()
        rclpy.shutdown()

    def wait_for_subscription(self, subscriber: 'subprocess.Popen[bytes]') -> None:
        """Return when the subscriber is matched."""
        while not self._publisher.get_subscription_count():
            if subscriber.poll() is not None:
                raise SystemExit(f'the subscriber ended with status {subscriber.returncode}')
            time.sleep(0.02)

    def publish(self, seconds: float) -> int:
        """Publish in real time; return how many messages."""
        began, first = time.monotonic(), self._next
        while (now := time.monotonic()) - began < seconds:
            due = int((now - began) * self._rate) + 1 - (self._next - first)
            if due <= 0:
                time.sleep(1 / self._rate)
                continue
            for _ in range(due):
                self._publisher.publish(next(self._messages))
            self._next += due
        return self._next - first

    def _encoded(self) -> Iterator[bytes]:
        for block in itertools.count():
            index = np.arange(256) + block * 256
            stamps = 10**18 + np.rint(index / self._rate * 1e9).astype(np.int64)
            samples = self._random.normal(0, 0.01, (256, 6))
            for row in encode_imu_rows(ImuBlock(stamps, stamps, samples,
                                                np.zeros((256, 2), bool), 'imu_link')):
                yield row.tobytes()


def cpu_seconds(pid: int) -> float:
    """CPU time of all threads of a process."""
    threads = Path(f'/proc/{pid}/task').iterdir()
    return sum(int((thread / 'schedstat').read_text().split()[0]) for thread in threads) * 1e-9


@contextlib.contextmanager
def _domain(folder: str) -> Iterator[dict[str, str]]:
    """Set a ROS domain of our own for this process and those it starts."""
    before = dict(os.environ)
    os.environ |= {'ROS_DOMAIN_ID': str(random.randint(1, 101)), 'ROS_LOG_DIR': folder,
                   'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    try:
        yield dict(os.environ)
    finally:
        os.environ.clear()
        os.environ.update(before)


def _floor() -> None:
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu

    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node('floor')
    node.create_subscription(Imu, 'imu/data_raw', print, qos_profile_sensor_data)
    signal.pause()


def _ordinary() -> None:
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu

    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node('ordinary')
    stored = []

    def store(message: Imu) -> None:
        rate, force = message.angular_velocity, message.linear_acceleration
        stored.append((rate.x, rate.y, rate.z, force.x, force.y, force.z))

    node.create_subscription(Imu, 'imu/data_raw', store, qos_profile_sensor_data)
    rclpy.spin(node)


SUBSCRIBERS = {'floor': _floor, 'ordinary': _ordinary}

if __name__ == '__main__':
    sys.exit(main())
