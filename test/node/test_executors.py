# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The node in the executors of rclpy, alone and four in one process."""

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
from ros_harness import Driver, LOSSLESS, PATIENCE_S, resident_mb, Ros
from std_srvs.srv import SetBool, Trigger

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()
SCRIPT = Path(__file__).with_name('several_nodes.py')
MOST_MB = 40
"""Of each further IMU in a process."""
SAMPLES = 2000


@contextmanager
def spinning(ros: Ros, executor: str, namespaces: Sequence[str]
             ) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, str(SCRIPT), executor, str(ros.folder / 'output'), *namespaces],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def feed(ros: Ros, places: Sequence[str]) -> None:
    """Publish to all nodes, and wait for what each makes of it."""
    drivers = [Driver(ros, f'{place}imu/data_raw') for place in places]
    arrays = [ros.listen(DiagnosticArray, f'{place}imu_allan/coefficients') for place in places]
    for driver in drivers:
        driver.wait_for_node()
        driver.publish(SAMPLES)
    for driver in drivers:
        assert driver.publisher.wait_for_all_acked()
    ros.until(lambda: all(arrays))


def fed(ros: Ros, places: Sequence[str]) -> list[int]:
    """Publish to each node and save: tell how many samples each had."""
    feed(ros, places)
    counts = []
    for place in places:
        assert ros.call(SetBool, f'{place}imu_allan/pause').success
        response = ros.call(Trigger, f'{place}imu_allan/save')
        assert response.success, response.message
        counts.append(samples_in(Path(response.message.splitlines()[0])))
    return counts


def samples_in(path: Path) -> int:
    return int(json.loads(path.read_text())['timeline']['samples'])


# That of the page has several threads, the node itself has a single one.
EXECUTORS = [*(slow(name) for name in (
    'SingleThreadedExecutor', 'MultiThreadedExecutor')), 'EventsExecutor']


@pytest.mark.parametrize('executor', EXECUTORS)
def test_an_ordinary_executor_runs_the_node(ros: Ros, executor: str) -> None:
    with spinning(ros, executor, [ros.namespace]) as process:
        assert fed(ros, ['']) == [SAMPLES]
        for path in (ros.folder / 'output').rglob('result.json'):
            path.unlink()
        # Whoever spins it destroys it at the end, and it saves.
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0, process.stdout and process.stdout.read()
    [path] = (ros.folder / 'output').rglob('result.json')
    assert samples_in(path) == SAMPLES


@pytest.mark.slow
@pytest.mark.parametrize('executor', ['MultiThreadedExecutor', 'EventsExecutor'])
def test_four_imus_in_one_process_share_what_is_large(ros: Ros, executor: str) -> None:
    used_mb = []
    for names in (['alone'], [f'imu{number}' for number in range(4)]):
        with spinning(ros, executor, [ros.name(name) for name in names]) as process:
            assert fed(ros, [f'{name}/' for name in names]) == [SAMPLES] * len(names)
            used_mb.append(resident_mb(process.pid))
    assert used_mb[1] - used_mb[0] < 3 * MOST_MB


def test_the_four_imus_of_the_page_are_characterized_in_one_process_and_share_what_is_large(
        ros: Ros) -> None:
    [code] = re.findall(r'^```python\n(import rclpy\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    sides = ('front', 'rear', 'left', 'right')
    arguments = ['--ros-args', '-p', 'publish_period:=0.5']
    for side in sides:
        assert f"'{side}'" in code
        code = code.replace(f"'{side}'", f"'{ros.name(side)}'")
        for key, value in LOSSLESS.items():
            topic = ros.name(f'{side}/imu/data_raw')
            arguments += ['-p', f'{key.replace("/imu/data_raw", topic)}:={value}']
    process = subprocess.Popen([sys.executable, '-c', code, *arguments], env={
        **os.environ, 'HOME': str(ros.folder), 'ROS_HOME': str(ros.folder)})
    try:
        alone = ros.start('imu_allan_node', {'publish_period': 0.5}, namespace=ros.name('alone'))
        feed(ros, ['alone/', *(f'{side}/' for side in sides)])
        assert resident_mb(process.pid) - resident_mb(alone.popen.pid) < 3 * MOST_MB
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
    finally:
        process.kill()
    assert [samples_in(path) for path in ros.folder.rglob('result.json')] == (
        [SAMPLES] * len(sides))
