# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CPU time that a subscriber to an IMU costs, per message.

Three processes take the same messages of one publisher over DDS, at the same time:

floor     a subscription whose messages are never taken: what the middleware itself costs
node      imu_allan_node with its default settings, estimation and checkpoints included
ordinary  an rclpy callback that stores the six numbers of each message

What the middleware costs depends on how many messages it finds when the computer wakes it up: by a
factor of two from one minute to the next. Hence all three at once, and the medians of some rounds
with the least and the greatest of them.

With --hours the node goes on from a record of that length: fits become rarer as it grows.

The ratios are those of one run on one computer; the figures themselves are not comparable between
computers. Run it on an idle one: python bench/bench_node.py
"""

import argparse
from collections.abc import Collection, Iterator, Sequence
import contextlib
import itertools
import os
from pathlib import Path
import random
import signal
from statistics import median
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
RESUMED_S = 20.0
"""In place of it where the node resumes: it fits the whole record at first."""
BLOCK = 256
MOST_OF_ORDINARY = 0.25
MOST_OF_FLOOR = 2.5


def main() -> int:
    """Measure, print a table and the two ratios for each rate; 1 if one is missed at 1 kHz."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=20.0, help='per round')
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--rates', type=float, nargs='+', default=RATES_HZ)
    parser.add_argument('--hours', type=float, default=0.0,
                        help='length of the record that the node goes on from')
    parser.add_argument('--as', dest='kind', choices=KINDS, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.kind:
        subscribe(args.kind)
        return 0
    print(f'CPU time per message of the subscribing process, in microseconds: median, least and '
          f'greatest of {args.rounds} rounds of {args.seconds:g} s')
    print(f'{"rate":>8}' + ''.join(f'{name:>22}' for name in (
        *KINDS, 'node/ordinary', 'node/floor')))
    met = True
    for rate in args.rates:
        costs = [measure(rate, args.seconds, args.hours) for _ in range(args.rounds)]
        ratios = {kind: [cost['node'] / cost[kind] for cost in costs]
                  for kind in ('ordinary', 'floor')}
        print(f'{rate:>5g} Hz'
              + ''.join(spread([cost[kind] * 1e6 for cost in costs], 1) for kind in KINDS)
              + ''.join(spread(values, 2) for values in ratios.values()), flush=True)
        if rate == 1000:
            met = (median(ratios['ordinary']) <= MOST_OF_ORDINARY
                   and median(ratios['floor']) <= MOST_OF_FLOOR)
    print(f'wanted at 1 kHz: node/ordinary <= {MOST_OF_ORDINARY}, node/floor <= {MOST_OF_FLOOR}: '
          + ('met' if met else 'MISSED'))
    return 0 if met else 1


def spread(values: Sequence[float], digits: int) -> str:
    """Write the median, the least and the greatest."""
    text = f'{median(values):.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})'
    return f'{text:>22}'


def measure(rate: float, seconds: float, hours: float) -> dict[str, float]:
    """CPU seconds per message of each kind of subscriber, beside each other."""
    with tempfile.TemporaryDirectory() as folder, _domain(folder) as env, Publisher(rate) as imu:
        if hours:
            write_state(f'{folder}/state', rate, hours)
        arguments = {kind: [__file__, '--as', kind] for kind in KINDS} | {'node': [
            '-c', 'import sys; from imu_allan.node.imu_allan_node import main; sys.exit(main())',
            '--ros-args', '-p', f'output_dir:={folder}/output', '-p',
            f'state_file:={folder}/state', '-p', f'checkpoint_period:={seconds}']}
        subscribers = {kind: subprocess.Popen(
            [sys.executable, *arguments[kind]], env=env, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL) for kind in KINDS}
        try:
            imu.wait_for(subscribers.values())
            imu.publish(RESUMED_S if hours else WARM_UP_S)
            before = {kind: cpu_seconds(process.pid) for kind, process in subscribers.items()}
            published = imu.publish(seconds)
            return {kind: (cpu_seconds(process.pid) - before[kind]) / published
                    for kind, process in subscribers.items()}
        finally:
            for process in subscribers.values():
                process.send_signal(signal.SIGTERM)
            for process in subscribers.values():
                process.wait(60)


def write_state(path: str, rate: float, hours: float) -> None:
    """Write the state file of a node that has heard this publisher for so long."""
    from imu_allan.node.run import new_run, pack, Setup
    from imu_allan.node.storage import StateFile

    setup = Setup(('/imu/data_raw',))
    run = new_run(setup)
    random_numbers = np.random.default_rng(2)
    for number in range(-round(hours * 3600 * rate / BLOCK), 0):
        run.lanes[0].update([block_of(number, rate, random_numbers)])
    file = StateFile(path)
    file.save(pack([run], setup))
    file.close()


def block_of(number: int, rate: float, random: np.random.Generator) -> ImuBlock:
    """Give the messages of the publisher whose number begins at so many blocks."""
    index = np.arange(BLOCK) + number * BLOCK
    stamps = 10**18 + np.rint(index / rate * 1e9).astype(np.int64)
    return ImuBlock(stamps, stamps, random.normal(0, 0.01, (BLOCK, 6)),
                    np.zeros((BLOCK, 2), bool), 'imu_link')


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

    def wait_for(self, subscribers: 'Collection[subprocess.Popen[bytes]]') -> None:
        """Return when all subscribers are matched."""
        while self._publisher.get_subscription_count() < len(subscribers):
            for subscriber in subscribers:
                if subscriber.poll() is not None:
                    raise SystemExit(f'a subscriber ended with status {subscriber.returncode}')
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
        for number in itertools.count():
            for row in encode_imu_rows(block_of(number, self._rate, self._random)):
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


def subscribe(kind: str) -> None:
    """Take the messages in a callback that stores them, or, as the floor, never take them."""
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu

    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node(kind)
    stored = []

    def store(message: Imu) -> None:
        rate, force = message.angular_velocity, message.linear_acceleration
        stored.append((rate.x, rate.y, rate.z, force.x, force.y, force.z))

    node.create_subscription(Imu, 'imu/data_raw', store, qos_profile_sensor_data)
    if kind == 'floor':
        signal.pause()
    rclpy.spin(node)


if __name__ == '__main__':
    sys.exit(main())
