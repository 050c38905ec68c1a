# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A run goes on after a crash or a reboot; what it cannot go on with is kept and reported."""

import hashlib
from pathlib import Path
import random
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.characterization import Characterization
from imu_allan.node.checkpoint import decode_state, encode_state, VERSION
from imu_allan.node.run import Lane, pack, Run, Setup, unpack
from imu_allan.node.same_imu import LOOK_S
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
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
SAMPLES = 2000


@pytest.fixture
def checkpoint(ros: Ros) -> Path:
    """Write a state file as a node that was killed leaves it."""
    topic = ros.name('imu/data_raw')
    run = Run(Lane(Characterization(kind='topic', topic=topic)))
    # As loud as the driver of a test.
    density = 0.01 / RATE_HZ**0.5
    model = parse_model(f'gyro: {{noise_density: {density} rad/s/sqrt(Hz)}}\n'
                        f'accel: {{noise_density: {density} m/s^2/sqrt(Hz)}}')
    for block in simulated_blocks(model, RATE_HZ, SAMPLES, start_ns=1_600_000_000 * 10**9,
                                  frame_id='imu'):
        run.lanes[0].update([block])
    run.learn([run.snapshot().result()], None)
    path = ros.folder / 'state'
    path.write_bytes(encode_state(pack(run, Setup(topic, TimelineOptions()))))
    return path


def start(ros: Ros, **parameters: Any) -> Process:
    return ros.start('imu_allan_node', {
        'state_file': str(ros.folder / 'state'), 'checkpoint_period': PERIOD_S, **parameters})


def kill(driver: Driver, node: Process) -> None:
    node.popen.kill()
    node.popen.wait()
    # DDS forgets a killed node only when its lease runs out.
    driver.dead |= driver.subscriptions()


def kept_aside(ros: Ros) -> list[Path]:
    return sorted(path for path in ros.folder.glob('state.*') if path.suffix != '.lock')


def samples_at_the_end(ros: Ros, node: Process) -> int:
    assert node.stop() == 0, node.log
    latest = max(ros.results(), key=lambda document: str(document['source']['start_time']))
    return int(latest['timeline']['samples'])


def test_another_imu_begins_a_new_run_with_its_first_sample(ros: Ros, checkpoint: Path) -> None:
    before = checkpoint.read_bytes()
    node, driver = start(ros), Driver(ros).wait_for_node()
    # Those of a single moment show nothing: it looks for a while.
    ros.until(lambda: driver.publish(200, frame_id='other') or Varying(
        f"a new run: {checkpoint} could not be resumed from, it is of frame_id 'imu', the "
        "messages now have 'other'; it is kept as state.frame_id.<words>") in node.lines)
    [aside] = kept_aside(ros)
    assert aside.read_bytes() == before
    assert driver.publisher.wait_for_all_acked()
    assert samples_at_the_end(ros, node) == driver.next


def test_a_few_samples_at_the_end_of_a_look_do_not_harm_the_run(
        ros: Ros, checkpoint: Path) -> None:
    before = checkpoint.read_bytes()
    node, driver = start(ros), Driver(ros).wait_for_node()
    driver.publish(10, frame_id='other')
    assert driver.publisher.wait_for_all_acked()
    assert node.stop() == 0
    assert checkpoint.read_bytes() == before


@pytest.mark.parametrize(('rate_hz', 'needed_s', 'reason'), [
    (200.0, 2.0, None), (202.0, 10.0, None), (400.0, 2.0, 'rate'),
    (50.0, 2.0, 'rate'), (220.0, 10.0, 'rate'), (206.0, 10.0, 'rate'), (4.0, 4.0, 'rate')])
def test_a_look_takes_longer_where_jitter_could_be_the_reason(
        ros: Ros, checkpoint: Path, rate_hz: float, needed_s: float, reason: str | None) -> None:
    run = unpack(decode_state(checkpoint.read_bytes()),
                 Setup(ros.name('imu/data_raw'), TimelineOptions()))
    known, held = run.lanes[0].known, [at_rest(round(rate_hz / 2), rate_hz)]
    while not known.suffices(held, LOOK_S, by_level=False):
        assert len(held) < 40
        held.append(at_rest(round(rate_hz / 2), rate_hz, start_s=0.5 * len(held)))
    assert 0.5 * len(held) == pytest.approx(needed_s, abs=0.5)
    why = known.departure(held, by_level=False)
    assert (why and why.reason) == reason
    if why is not None:
        assert str(why) == f'it is of 200 Hz, the messages now come at {rate_hz:g} Hz'


def test_a_file_that_is_no_usable_state_is_kept_aside_and_reported(ros: Ros) -> None:
    whole = encode_state({'a': np.zeros(9)})
    payload = b'from the future'
    no_state = 'it is not a state file of imu_allan'
    cases = [
        ('damaged', whole[:-1] + b'x', 'its checksum is wrong'),
        ('damaged', whole[:100], 'its checksum is wrong'),
        ('damaged', b'', no_state),
        ('damaged', whole, 'its arrays do not belong together (setup is missing)'),
        ('foreign', b'a photo of my robot', no_state),
        ('newer', b'imu_allan.state/99\n' + hashlib.sha256(payload).digest() + payload,
         f'it has version 99, this imu_allan reads {VERSION}')]
    paths = []
    for number, (_, content, _) in enumerate(cases):
        path = ros.folder / str(number) / 'state'
        path.parent.mkdir()
        path.write_bytes(content)
        paths.append(path)
    results = start_repeatedly(ros, [['-p', f'state_file:={path}'] for path in paths])
    for (status, text), path, (reason, content, why) in zip(results, paths, cases, strict=True):
        assert status == 0
        [aside] = path.parent.glob('state.*Z')
        assert aside.name.startswith(f'state.{reason}.')
        assert aside.read_bytes() == content
        assert said_in(text) == [
            f'a new run: {path} could not be resumed from, {why}; it is kept as {aside.name}',
            f'characterizing the IMU on {ros.name("imu/data_raw")}']


def test_another_topic_or_other_settings_begin_a_new_run(ros: Ros, checkpoint: Path) -> None:
    content = checkpoint.read_bytes()
    second = checkpoint.with_name('second')
    second.write_bytes(content)
    results = start_repeatedly(ros, [
        ['-p', f'state_file:={checkpoint}', '-p', 'gap_tolerance:=9'],
        ['-p', f'state_file:={second}', '-r', 'imu/data_raw:=other/imu']])
    assert [status for status, _ in results] == [0, 0]
    [aside] = kept_aside(ros)
    assert aside.read_bytes() == content
    assert [said_in(text)[0] for _, text in results] == [
        f'a new run: {checkpoint} could not be resumed from, it was made with other parameters '
        f'(gap_tolerance 5, now 9); it is kept as {aside.name}',
        Varying(f'a new run: {second} could not be resumed from, it is of the topic '
                f'{ros.name("imu/data_raw")}; it is kept as second.topic.<words>')]


def test_reset_empties_the_state_file_at_once(
        ros: Ros, checkpoint: Path, health: Health) -> None:
    node = start(ros)
    ros.until(lambda: health.said('storage', f'resumed 10 s of data from {checkpoint}'))
    assert ros.call(Trigger, 'imu_allan/reset').success
    ros.until(lambda: health.said('storage', 'a new run'))
    node.popen.kill()
    node.popen.wait()
    assert kept_in(checkpoint).messages == 0
    assert kept_aside(ros) == []


def test_a_state_file_that_cannot_be_written_any_more_is_reported_and_costs_no_result(
        ros: Ros) -> None:
    folder = ros.folder / 'disk'
    node = ros.start('imu_allan_node', {'state_file': str(folder / 'state'),
                                        'checkpoint_period': PERIOD_S})
    driver = Driver(ros).wait_for_node()
    # The subscription is there before the state file.
    ros.until((folder / 'state.lock').exists)
    (folder / 'state.lock').unlink()
    folder.rmdir()
    folder.write_text('in the way')
    driver.publish(500)
    ros.until(lambda: f'{folder / "state"}: cannot be written (Not a directory); choose a folder '
                      'that exists on a disk with room and may be written to' in node.lines)
    driver.publish(1500)
    assert driver.publisher.wait_for_all_acked()
    assert node.stop() == 1
    assert [document['timeline']['samples'] for document in ros.results()] == [2000]


@pytest.mark.parametrize(('kills', 'seconds'), [(2, 3.0), slow(50, 8.0)])
def test_kills_at_random_moments_leave_a_whole_state_and_cost_one_period_at_most(
        ros: Ros, kills: int, seconds: float) -> None:
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
        kill(driver, node)
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
    ros.until(lambda: Varying(f'resumed <words> of data from {state_file}') in node.lines)
    assert kept_aside(ros) == []
    assert list(ros.folder.glob('.state*')) == []
    assert node.stop(signal.SIGTERM) == 0
