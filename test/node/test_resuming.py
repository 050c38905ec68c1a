# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A run goes on after a crash or a reboot; what it cannot go on with is kept and reported."""

import hashlib
import random
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.node.checkpoint import encode_state, VERSION
from imu_allan.node.run import new_run, pack, Setup
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from repeated import slow
from ros_harness import (
    at_rest,
    Driver,
    Health,
    kept_in,
    Process,
    RATE_HZ,
    Ros,
    said_in,
    start_repeatedly,
    STARVED_S,
)
from std_srvs.srv import Trigger
from whole_lines import Varying

PERIOD_S = 1.0
LATE_S = 0.2
"""How late a report may be about what had been received."""


def start(ros: Ros, **parameters: Any) -> Process:
    return ros.start('imu_allan_node', {
        'state_file': str(ros.folder / 'state'), 'checkpoint_period': PERIOD_S, **parameters})


def test_a_file_that_is_no_usable_state_is_kept_aside_and_reported(ros: Ros) -> None:
    topic = ros.name('imu/data_raw')
    setup = Setup(topic, TimelineOptions())
    run = new_run(setup)
    run.lanes[0].update([at_rest(2000)])
    good, whole = encode_state(pack(run, setup)), encode_state({'a': np.zeros(9)})
    payload = b'from the future'
    no_state = 'it is not a state file of imu_allan'
    cases: list[tuple[str, bytes, list[str], str]] = [
        ('damaged', whole[:100], [], 'its checksum is wrong'),
        ('damaged', whole, [], 'its arrays do not belong together (setup is missing)'),
        ('foreign', b'a photo of my robot', [], no_state),
        ('newer', b'imu_allan.state/99\n' + hashlib.sha256(payload).digest() + payload, [],
         f'it has version 99, this imu_allan reads {VERSION}'),
        ('settings', good, ['-p', 'gap_tolerance:=9'],
         'it was made with other parameters (gap_tolerance 5, now 9)'),
        ('topic', good, ['-r', 'imu/data_raw:=other/imu'], f'it is of the topic {topic}')]
    arguments = []
    for number, (_, content, given, _) in enumerate(cases):
        path = ros.folder / str(number) / 'state'
        path.parent.mkdir()
        path.write_bytes(content)
        arguments.append(['-p', f'state_file:={path}', *given])
    # Nobody has asked for the state at home, whose place takes nothing.
    home = ros.folder / 'home'
    home.write_text('in the way')
    *results, (status, text) = start_repeatedly(
        ros, [*arguments, []], env={'ROS_HOME': str(home)})
    state = home / 'imu_allan' / f'{ros.namespace.strip("/")}.imu_allan.state'
    assert (status, said_in(text)[0]) == (
        0, f'nothing is kept over a crash: state_file {state}: cannot be written (Not a '
        'directory); choose a folder that may be written to')
    for number, ((status, text), (reason, content, _, why)) in enumerate(
            zip(results, cases, strict=True)):
        path = ros.folder / str(number) / 'state'
        [aside] = path.parent.glob('state.*Z')
        assert aside.name.startswith(f'state.{reason}.')
        assert aside.read_bytes() == content
        assert (status, said_in(text)[0]) == (
            0, f'a new run: {path} could not be resumed from, {why}; it is kept as {aside.name}')
        assert said_in(text)[-1].startswith(f'characterizing the IMU on {ros.namespace}/')


@pytest.mark.parametrize(('kills', 'seconds'), [(2, 3.0), slow(50, 8.0)])
def test_kills_at_random_moments_leave_a_whole_state_and_cost_one_period_at_most(
        ros: Ros, health: Health, kills: int, seconds: float) -> None:
    chance = random.Random(kills)
    driver = Driver(ros, depth=5000)
    state_file = ros.folder / 'state'
    kept = 0
    at_stake = 0
    starved_s = 0.0
    received: list[tuple[float, int]] = []

    def hear(report: DiagnosticArray) -> None:
        for status in report.status:
            if (status.name.endswith('/imu_allan: reception')
                    and status.hardware_id == ros.name('imu/data_raw')):
                count = next(v.value for v in status.values if v.key == 'received')
                received.append((time.monotonic(), int(count)))

    ros.listen(DiagnosticArray, '/diagnostics', 10, hear)
    for turn in range(kills):
        node = start(ros)
        driver.wait_for_node()
        before, began = driver.next, time.monotonic()
        lives = chance.uniform(0.0, seconds)
        received.clear()
        while time.monotonic() - began < lives:
            driver.publish(round(RATE_HZ * (time.monotonic() - began)) - driver.next + before)
            ros.executor.spin_once(timeout_sec=0.02)
        # For what the computer kept it waiting the node is not to blame.
        killed, late_s = time.monotonic(), LATE_S + node.starved_s
        starved_s += node.starved_s
        assert node.running, node.log
        assert 'Traceback' not in node.log, node.log
        node.popen.kill()
        node.wait()
        # DDS forgets a killed node only when its lease runs out.
        driver.dead |= driver.subscriptions()
        # The robot stood still for a second without a node.
        driver.next += 200
        now = kept_in(state_file).messages
        assert now >= kept, turn
        # What had been received one period before, and if it came late, not all at once.
        due = [count for when, count in received if when < killed - PERIOD_S - late_s]
        assert now - kept >= max(due, default=0), turn
        at_stake += max(due, default=0)
        kept = now
    # On a computer without time for the node nothing is due: then it shows the rest alone.
    assert at_stake > kills * seconds * RATE_HZ / 10 or starved_s > STARVED_S, (
        'the kills must cost something to be a test')
    node = start(ros)
    line = Varying(f'resumed <words> of data from {state_file}')
    ros.until(lambda: line in node.lines and health.said('storage', line))
    # A reset empties the file at once.
    assert ros.call(Trigger, 'imu_allan/reset').success
    ros.until(lambda: health.said('storage', 'a new run'))
    node.popen.kill()
    node.wait()
    assert kept_in(state_file).messages == 0
    assert {path.name for path in ros.folder.glob('*state*')} == {'state', 'state.lock'}
