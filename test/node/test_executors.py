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
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from ros_harness import Driver, PATIENCE_S, Ros
from std_srvs.srv import SetBool, Trigger

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()
SCRIPT = Path(__file__).with_name('several_nodes.py')
EXECUTORS = 'SingleThreadedExecutor', 'MultiThreadedExecutor', 'EventsExecutor'
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


def fed(ros: Ros, places: Sequence[str]) -> list[Any]:
    """Publish to each node and save: give the documents."""
    documents = []
    for place in places:
        driver = Driver(ros, f'{place}imu/data_raw')
        driver.wait_for_node()
        driver.publish(SAMPLES)
        assert driver.publisher.wait_for_all_acked()
        arrays = ros.listen(DiagnosticArray, f'{place}imu_allan/coefficients')
        ros.until(lambda arrays=arrays: arrays)
        assert ros.call(SetBool, f'{place}imu_allan/pause').success
        response = ros.call(Trigger, f'{place}imu_allan/save')
        assert response.success, response.message
        documents.append(json.loads(Path(response.message.splitlines()[0]).read_text()))
    return documents


def resident_mb(process: subprocess.Popen[str]) -> float:
    pages = Path(f'/proc/{process.pid}/statm').read_text().split()[1]
    return int(pages) * 4096 / 1e6


@pytest.mark.parametrize('executor', EXECUTORS)
def test_an_ordinary_executor_runs_the_node(ros: Ros, executor: str) -> None:
    with spinning(ros, executor, [ros.namespace]) as process:
        [document] = fed(ros, [''])
        assert document['timeline']['samples'] == SAMPLES
        for path in (ros.folder / 'output').rglob('result.json'):
            path.unlink()
        # Whoever spins it destroys it at the end, and it saves.
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0, process.stdout and process.stdout.read()
    [path] = (ros.folder / 'output').rglob('result.json')
    assert json.loads(path.read_text())['timeline']['samples'] == SAMPLES


@pytest.mark.parametrize('executor', ['MultiThreadedExecutor', 'EventsExecutor'])
def test_four_imus_in_one_process_share_what_is_large(ros: Ros, executor: str) -> None:
    used_mb = []
    for names in (['alone'], [f'imu{number}' for number in range(4)]):
        with spinning(ros, executor, [ros.name(name) for name in names]) as process:
            documents = fed(ros, [f'{name}/' for name in names])
            assert [document['timeline']['samples'] for document in documents] == (
                [SAMPLES] * len(names))
            used_mb.append(resident_mb(process))
    assert used_mb[1] - used_mb[0] < 3 * MOST_MB


def test_the_four_imus_of_the_page_are_characterized_in_one_process(ros: Ros) -> None:
    [code] = re.findall(r'^```python\n(import rclpy\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    sides = ('front', 'rear', 'left', 'right')
    for side in sides:
        assert f"'{side}'" in code
        code = code.replace(f"'{side}'", f"'{ros.name(side)}'")
    process = subprocess.Popen([sys.executable, '-c', code], env={
        **os.environ, 'HOME': str(ros.folder), 'ROS_HOME': str(ros.folder)})
    try:
        for side in sides:
            driver = Driver(ros, f'{side}/imu/data_raw')
            driver.wait_for_node()
            arrays = ros.listen(DiagnosticArray, f'{side}/imu_allan/coefficients')
            driver.publish(SAMPLES)
            ros.until(lambda arrays=arrays: arrays)
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
    finally:
        process.kill()
    assert len(list(ros.folder.rglob('result.json'))) == len(sides)
