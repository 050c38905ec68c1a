# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes of several IMUs in one process, in the executors of rclpy, as the page has them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from repeated import slow
from ros_harness import Driver, lossless, PATIENCE_S, resident_mb, Ros
from std_srvs.srv import SetBool

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()
IMPORTS = 'from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor\n'
MOST_MB = 40
"""Of each further IMU in a process."""
SAMPLES = 2000


@contextmanager
def spinning(ros: Ros, executor: str, namespaces: Sequence[str]) -> Iterator[subprocess.Popen]:
    """Run the example of the page for these namespaces, in an executor."""
    [code] = re.findall(r'^```python\n(import rclpy\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    sides = "('front', 'rear', 'left', 'right')"
    assert sides in code
    assert IMPORTS in code
    code = code.replace(sides, repr(tuple(namespaces)))
    if executor == 'EventsExecutor':
        # Its `spin` calls nothing in the wheels of rclpy 7.1.6.
        code = code.replace(IMPORTS, 'from rclpy.executors import ExternalShutdownException\n'
                            'from rclpy.experimental import EventsExecutor\n').replace(
            '    executor.spin()\n', '    while rclpy.ok():\n        executor.spin_once(1.0)\n')
    code = code.replace('MultiThreadedExecutor', executor)
    arguments = ['--ros-args', '-p', 'publish_period:=0.5']
    for namespace in namespaces:
        for key, value in lossless(f'{namespace}/imu/data_raw').items():
            arguments += ['-p', f'{key}:={value}']
    process = subprocess.Popen([sys.executable, '-c', code, *arguments], env={
        **os.environ, 'HOME': str(ros.folder), 'ROS_HOME': str(ros.folder)})
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def feed(ros: Ros, places: Sequence[str]) -> None:
    """Publish to all nodes, and wait for what each makes of it."""
    drivers = [Driver(ros, f'{place}/imu/data_raw') for place in places]
    arrays = [ros.listen(DiagnosticArray, f'{place}/imu_allan/coefficients') for place in places]
    for driver in drivers:
        driver.wait_for_node()
        driver.publish(SAMPLES)
    for driver in drivers:
        assert driver.publisher.wait_for_all_acked()
    ros.until(lambda: all(arrays))


@pytest.mark.parametrize(('executor', 'count'), [
    ('EventsExecutor', 1), ('MultiThreadedExecutor', 4), slow('SingleThreadedExecutor', 4)])
def test_imus_in_one_process_are_characterized_in_any_executor_and_share_what_is_large(
        ros: Ros, executor: str, count: int) -> None:
    sides = [f'imu{number}' for number in range(count)]
    with spinning(ros, executor, list(map(ros.name, sides))) as process:
        alone = [] if count == 1 else ['alone']
        nodes = [ros.start('imu_allan_node', {'publish_period': 0.5}, namespace=ros.name(name))
                 for name in alone]
        feed(ros, [*alone, *sides])

        def is_shared() -> bool:
            return all(resident_mb(process.pid) - resident_mb(node.popen.pid)
                       < (count - 1) * MOST_MB for node in nodes)

        assert is_shared()
        for side in [*alone, *sides]:
            assert ros.call(SetBool, f'{side}/imu_allan/pause').success
            assert ros.saved(f'{side}/imu_allan')['timeline']['samples'] == SAMPLES
        # What drawing has taken is given back.
        ros.until(is_shared, timeout=10.0)
        for path in ros.folder.rglob('result.json'):
            path.unlink()
        # Whoever spins it destroys it at the end, and it saves.
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
    assert [json.loads(path.read_text())['timeline']['samples']
            for path in ros.folder.rglob('result.json')] == [SAMPLES] * count
