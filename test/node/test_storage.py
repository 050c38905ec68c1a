# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What stays of a run while a disk is full for a moment, and what is reported of it."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import threading
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.node import checkpoint
from imu_allan.node.checkpoint import decode_state, UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Run, Setup, unpack
from imu_allan.node.storage import Storage
from imu_allan.node.worker import Worker
from imu_allan.timeline import TimelineOptions
import pytest
from ros_harness import at_rest, Heard, resident_mb
from whole_lines import unwritable

SETUP = Setup('/imu', TimelineOptions())


def feed(run: Run, count: int, start: int = 0) -> None:
    run.lanes[0].update([at_rest(count, start_s=start / 100, seed=start)])


def samples_in(path: Path) -> int:
    run = unpack(decode_state(path.read_bytes()), SETUP)
    return int(run.lanes[0].characterization.summary().timeline.samples)


@pytest.fixture
def worker(heard: Any) -> Worker:
    return Worker(Log(heard))


@pytest.fixture
def facts() -> Facts:
    return Facts('/imu', 100, 0.0, '')


@pytest.fixture
def storage(tmp_path: Path, heard: Any, worker: Worker, facts: Facts) -> Iterator[Storage]:
    kept = Storage('/imu_allan', SETUP, worker, facts, Log(heard), {
        'state_file': str(tmp_path / 'state'), 'output_dir': str(tmp_path / 'output'),
        'checkpoint_period': 60.0, 'export_for': []})
    yield kept
    kept.close()


def test_old_state_is_not_overwritten_where_its_latest_samples_cannot_be_saved(
        storage: Storage, worker: Worker, facts: Facts, heard: Heard, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    run = storage.first_run()
    feed(run, 2000)
    storage.checkpoint(run).result()
    feed(run, 500, start=2000)
    write = checkpoint.write_atomically
    tries = []

    def full_once(*args: Any, **options: Any) -> None:
        tries.append(args)
        if len(tries) == 1:
            raise ImuAllanError('No space left on device')
        write(*args, **options)

    monkeypatch.setattr(checkpoint, 'write_atomically', full_once)
    storage.keep_aside(run, UnusableState('rate', 'it is of 100 Hz'))
    another = new_run(SETUP)
    feed(another, 300, start=9000)
    storage.checkpoint(another).result()
    [aside] = tmp_path.glob('state.rate.*')
    assert samples_in(aside) == 2000
    assert samples_in(tmp_path / 'state') == 300
    worker.hand_out()
    assert facts.resumed == (f'a new run: {tmp_path / "state"} could not be resumed from, it is '
                             f'of 100 Hz; it is kept as {aside.name}')
    assert 'error its latest samples are not in it: No space left on device' in heard.lines


def test_a_run_keeps_its_folder_over_a_restart_and_another_that_begins_equally_has_its_own(
        storage: Storage, worker: Worker, tmp_path: Path) -> None:
    runs = [new_run(SETUP), new_run(SETUP)]
    for run in runs:
        feed(run, 2000, 1)
    for run in (*runs, unpack(pack(runs[0], SETUP), SETUP)):
        storage.save(run, picture=False).result()
    storage.save(new_run(SETUP), picture=False).exception()
    worker.finish({'save'})
    assert len(list((tmp_path / 'output').iterdir())) == 2


def test_at_the_end_the_state_waits_for_no_fit_and_no_drawing(
        storage: Storage, worker: Worker, tmp_path: Path) -> None:
    run = storage.first_run()
    feed(run, 2000)
    busy, done = threading.Event(), []
    worker.start('plot', busy.wait, done.append)
    worker.start('fit', lambda: None, done.append)
    try:
        # Nor does a checkpoint while the run goes on.
        storage.checkpoint(run).result(timeout=60)
        assert samples_in(tmp_path / 'state') == 2000
        feed(run, 500, start=2000)
        assert storage.save_state_at_end(run)
        assert samples_in(tmp_path / 'state') == 2500
    finally:
        busy.set()
    worker.finish({'plot', 'fit'})
    # The plot was under way, the fit had not begun.
    assert len(done) == 1


def test_a_state_file_that_cannot_be_written_any_more_is_reported_and_costs_no_result(
        storage: Storage, worker: Worker, facts: Facts, heard: Heard, tmp_path: Path) -> None:
    run = storage.first_run()
    feed(run, 2000)
    (tmp_path / 'state.lock').unlink()
    tmp_path.rename(tmp_path.with_name('elsewhere'))
    tmp_path.write_text('in the way')
    storage.checkpoint(run).exception()
    worker.hand_out()
    line = unwritable(tmp_path / 'state', 'Not a directory')
    assert facts.checkpoint_error == line
    assert f'error {line}' in heard.lines
    assert not storage.save_state_at_end(run)
    tmp_path.unlink()
    assert storage.save_files_at_end(run, picture=False)
    worker.finish({'save'})
    [result] = (tmp_path / 'output').rglob('result.json')
    assert json.loads(result.read_text())['timeline']['samples'] == 2000


def test_a_configuration_that_cannot_be_made_at_the_end_is_reported_once(
        worker: Worker, facts: Facts, heard: Any, tmp_path: Path) -> None:
    storage = Storage('/imu_allan', SETUP, worker, facts, Log(heard), {
        'state_file': '', 'output_dir': str(tmp_path / 'output'), 'checkpoint_period': 60.0,
        'export_for': ['kalibr']})
    run = storage.first_run()
    # Constant: there is no noise density.
    run.lanes[0].update([at_rest(2000, noise=0.0)])
    assert not storage.save_files_at_end(run)
    worker.finish({'save'})
    assert [line for line in heard.lines if 'kalibr' in line] == [heard.lines[-1]]
    storage.close()


def test_memory_that_a_finished_job_has_freed_is_given_back(worker: Worker) -> None:
    def save() -> list[bytearray]:
        # What is kept lies among it, and would keep all of it.
        return [bytearray(2000) for _ in range(50_000)][::100]

    kept = [worker.start('save', save, lambda _: None).result()]
    taken_mb = resident_mb(os.getpid())
    worker.hand_out()
    assert len(kept[0]) == 500
    assert taken_mb - resident_mb(os.getpid()) > 50
