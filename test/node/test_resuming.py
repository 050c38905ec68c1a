# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A run goes on after a crash or a reboot; what it cannot go on with is kept and reported."""

import hashlib
import io
import os
from pathlib import Path
import pickle
import random
import signal
import time
import weakref

from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given, settings, strategies
from imu_allan.errors import ImuAllanError
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Setup, unpack, UnusableState
from imu_allan.node.storage import decode_state, encode_state, StateFile, Storage, VERSION
from imu_allan.node.worker import Worker
import numpy as np
import pytest
from repeated import slow
from ros_harness import (
    at_rest,
    Driver,
    Heard,
    kept_in,
    RATE_HZ,
    said_in,
    start_repeatedly,
    STARVED_S,
)
from std_srvs.srv import Trigger
from whole_lines import refused, unwritable, Varying

PERIOD_S = 1.0
LATE_S = 0.2
"""How late a report may be about what had been received."""
SETUP = Setup(('/imu',))
STATE = {'about': np.array('{"text": "ä"}'), 'sums': np.arange(12.0).reshape(3, 4),
         'counts': np.array([1, 2**62]), 'flags': np.array([True, False]),
         'empty': np.empty((0, 6))}
CONTENT = encode_state(STATE)


def start(ros):
    return ros.start('imu_allan_node', {
        'state_file': str(ros.folder / 'state'), 'checkpoint_period': PERIOD_S})


def test_a_file_that_is_no_usable_state_is_kept_aside_and_reported(ros):
    topic = ros.name('imu/data_raw')
    setup = Setup((topic,))
    run = new_run(setup)
    run.lanes[0].update([at_rest(2000)])
    good, whole = encode_state(pack([run], setup)), encode_state({'a': np.zeros(9)})
    no_state = 'it is not a state file of imu_allan'
    cases = [
        ('damaged', whole[:100], [], 'its checksum is wrong'),
        ('damaged', whole, [], "a part is missing ('setup')"),
        ('foreign', b'a photo of my robot', [], no_state),
        ('newer', framed(b'from the future', 99), [],
         f'it has version 99, this imu_allan reads {VERSION}'),
        *(('settings', good, other,
           f'it was made with other parameters or of another topic, {topic}') for other in (
               ['-p', 'gap_tolerance:=9'], ['-p', 'gyro_unit:=deg/s'],
               ['-r', 'imu/data_raw:=other/imu']))]
    arguments = []
    for number, (_, content, other, _) in enumerate(cases):
        path = ros.folder / str(number) / 'state'
        path.parent.mkdir()
        path.write_bytes(content)
        arguments.append(['-p', f'state_file:={path}', *other])
    # Nobody has asked for the state at home, whose place takes nothing.
    home = ros.folder / 'home'
    home.write_text('in the way')
    *results, (status, text) = start_repeatedly(ros, [*arguments, []], env={'ROS_HOME': str(home)})
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


@pytest.mark.parametrize(('kills', 'seconds'), [(2, 5.0), slow(50, 8.0)])
def test_kills_at_any_moment_leave_a_whole_state_and_cost_one_period(ros, health, kills, seconds):
    chance = random.Random(kills)
    driver = Driver(ros, depth=5000)
    state_file = ros.folder / 'state'
    kept, at_stake, starved_s = 0, 0, 0.0
    received = []
    for turn in range(kills):
        node = start(ros)
        driver.wait_for_node()
        before, began = driver.next, time.monotonic()
        lives = chance.uniform(0.0, seconds)
        received.clear()
        health.heard.clear()
        while time.monotonic() - began < lives:
            driver.publish(round(RATE_HZ * (time.monotonic() - began)) - driver.next + before)
            ros.executor.spin_once(timeout_sec=0.02)
            count = health.values('reception').get('received', 0)
            received.append((time.monotonic(), int(count)))
        # For what the computer kept it waiting the node is not to blame.
        killed, late_s = time.monotonic(), LATE_S + node.starved_s
        starved_s += node.starved_s
        assert (node.running, 'Traceback' in node.log) == (True, False), node.log
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
    node = start(ros)
    # Of a run without samples nothing is resumed.
    assert ros.until(lambda: node.lines)[0] == f'characterizing the IMU on {driver.topic}'
    assert {path.name for path in ros.folder.glob('state*')} == {'state', 'state.lock'}


def start_at_home(ros, **parameters):
    node = ros.start('imu_allan_node', {'checkpoint_period': PERIOD_S, **parameters},
                     env={'ROS_HOME': str(ros.folder / 'home')})
    ros.until(lambda: 'characterizing the IMU' in node.log)
    return node


@pytest.mark.parametrize('nothing', ['', 'none', 'null'])
def test_a_node_whose_hang_up_is_ignored_goes_on_and_without_a_state_keeps_nothing(ros, nothing):
    # A script has what it starts with & ignore SIGINT: that ends the node all the same.
    before = {number: signal.signal(number, signal.SIG_IGN)
              for number in (signal.SIGHUP, signal.SIGINT)}
    try:
        node = start_at_home(ros, state_file=nothing)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    driver = Driver(ros).wait_for_node()
    node.popen.send_signal(signal.SIGHUP)
    driver.publish(2000)
    assert driver.publisher.wait_for_all_acked()
    assert node.stop() == 0, node.log
    assert ros.results()[0]['timeline']['samples'] == 2000
    assert not (ros.folder / 'home').exists()
    assert not Path(nothing).is_file()


def test_a_run_that_was_killed_goes_on_and_one_that_was_ended_does_not(ros, health):
    node, driver = start_at_home(ros), Driver(ros, depth=5000)
    driver.wait_for_node()
    driver.publish(2000)
    state = ros.folder / 'home' / 'imu_allan' / f'{ros.namespace.strip("/")}.imu_allan.state'
    ros.until(lambda: kept_in(state).timeline.samples == 2000)
    node.popen.kill()
    node.popen.wait()
    driver.dead |= driver.subscriptions()
    again = start_at_home(ros)
    assert again.lines[0] == Varying(
        f'resumed <words> of data from {state}, of a run that has ended without saving; call '
        '~/reset to begin anew')
    arrays = ros.listen(DiagnosticArray, 'imu_allan/coefficients')
    # The result so far is published before any new sample.
    assert len(ros.until(lambda: arrays)[0].status) == 6
    driver.wait_for_node()
    driver.publish(1000)
    # The node that was killed acknowledges nothing.
    ros.until(lambda: health.number('reception', 'received') == 1000)
    assert again.stop() == 0, again.log
    assert max(document['timeline']['samples'] for document in ros.results()) == 3000
    # Few samples permit no configuration, but the run is over too.
    few = start_at_home(ros)
    driver.wait_for_node()
    driver.publish(40)
    ros.until(lambda: health.number('reception', 'received') == 40)
    assert few.stop() == 1, few.log
    for node in few, start_at_home(ros):
        assert node.lines[0] == f'characterizing the IMU on {driver.topic}'


def test_a_run_has_its_own_folder_and_keeps_its_state_on_a_full_disk(heard, tmp_path, monkeypatch):
    log = Log(lambda: heard)
    worker, state = Worker(log), tmp_path / 'state'
    storage = Storage('/imu_allan', SETUP, worker, Facts('/imu', 100, 0.0), log, {
        'state_file': str(state), 'output_dir': str(tmp_path / 'output'),
        'checkpoint_period': 60.0, 'export_for': []})
    runs = [*storage.resumed_or_new_run(), new_run(SETUP)]
    for run in runs:
        run.lanes[0].update([at_rest(2000)])
    # One that begins equally has another folder.
    for run in (*runs, *unpack(pack(runs[:1], SETUP), SETUP)):
        storage.save(run, picture=False).result()
    assert len(list((tmp_path / 'output').iterdir())) == 2
    storage.checkpoint(runs[:1]).result()
    runs[0].lanes[0].update([at_rest(500, start_s=20.0)])

    def full(*_, **__):
        raise ImuAllanError('No space left on device')

    with monkeypatch.context() as patched:
        patched.setattr('imu_allan.node.storage.write_atomically', full)
        storage.keep_aside(runs[0], UnusableState('rate', 'it is of 100 Hz'))
        # One after the other.
        worker.start('checkpoint', lambda: None, lambda _: None).result()
    worker.hand_out()
    [aside] = tmp_path.glob('state.rate.*')
    kept = unpack(decode_state(aside.read_bytes()), SETUP)[0].lanes[0].characterization
    assert kept.summary().timeline.samples == 2000
    assert heard.lines[-1] == 'error No space left on device'
    storage.close(is_over=False)


@pytest.mark.parametrize('kind', ['plot', 'save'])
def test_a_picture_is_freed_once_it_is_drawn(heard, kind):
    def draw():
        figure = Heard()
        figure.canvas = figure
        return weakref.ref(figure)

    drawn = Worker(Log(lambda: heard)).start(kind, draw, lambda _: None)
    assert drawn.result()() is None


def framed(payload, version=VERSION):
    return b'imu_allan.state/%d\n' % version + hashlib.sha256(payload).digest() + payload


def assert_damaged(content):
    with pytest.raises(UnusableState) as caught:
        decode_state(content)
    assert caught.value.reason == 'damaged'


@settings(max_examples=300, deadline=None)
@given(position=strategies.integers(0, len(CONTENT) - 1), flip=strategies.integers(1, 255))
def test_a_state_changed_or_cut_anywhere_is_unusable(position, flip):
    mutated = bytearray(CONTENT)
    mutated[position] ^= flip
    with pytest.raises(UnusableState):
        decode_state(bytes(mutated))
    assert_damaged(CONTENT[:position])


def test_pickles_are_never_loaded(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (Path.touch, (tmp_path / 'exploded',))

    arrays = io.BytesIO()
    np.savez(arrays, allow_pickle=True, bomb=np.array([Bomb()], dtype=object))
    for payload in (arrays.getvalue(), pickle.dumps(Bomb())):
        assert_damaged(framed(payload))
    assert not (tmp_path / 'exploded').exists()


def in_folder(folder):
    return {path.name for path in folder.iterdir()}


def test_a_state_is_for_nobody_else_and_stays_where_a_save_fails(tmp_path, monkeypatch):
    path = tmp_path / 'new' / 'state'
    file = StateFile(path)
    assert file.load() is None
    file.save(STATE)
    loaded, expected = ([(key, array.dtype, array.shape, array.tolist())
                         for key, array in state.items()] for state in (file.load() or {}, STATE))
    assert loaded == expected
    assert in_folder(path.parent) == {'state', 'state.lock'}
    assert path.stat().st_mode & 0o777 == 0o600
    content = path.read_bytes()

    def full(*_):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with refused(unwritable(path, 'No space left on device')):
        file.save({'sums': np.zeros(5)})
    assert in_folder(path.parent) == {'state', 'state.lock'}
    aside = file.keep_aside('foreign')
    assert aside.name.startswith('state.foreign.20')
    assert aside.read_bytes() == content
    assert not path.exists()


@pytest.mark.parametrize(('made', 'path', 'words'), [
    (lambda at: (at / 'file').write_text('in the way'), 'file/state',
     'cannot be written (Not a directory); choose a folder that may be written to'),
    (lambda at: (at / 'state').mkdir(), 'state', 'is a folder, a device or a pipe; name a '
     'regular file, or one that is not there yet'),
    # A pipe is waited for until somebody writes to it: for ever.
    (lambda at: os.mkfifo(at / 'state'), 'state', 'is a folder, a device or a pipe; name a '
     'regular file, or one that is not there yet')], ids=['below a file', 'folder', 'pipe'])
def test_what_can_be_no_state_is_one_line_and_left_alone(tmp_path, made, path, words):
    made(tmp_path)
    before = in_folder(tmp_path)
    with refused(f'state_file {tmp_path / path}: {words}'):
        StateFile(tmp_path / path)
    assert in_folder(tmp_path) == before


def test_states_kept_aside_are_capped_oldest_first(tmp_path):
    file = StateFile(tmp_path / 'state')
    (tmp_path / 'state.notes').write_text('of the user')
    aside = []
    for number in range(25):
        file.path.write_bytes(bytes([number]))
        aside.append(file.keep_aside('rate' if number % 2 else 'frame_id').name)
    assert in_folder(tmp_path) == {*aside[5:], 'state.lock', 'state.notes'}
    file.close()
