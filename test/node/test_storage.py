# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What stays of a run while a disk is full for a moment, and what is told of it."""

from collections.abc import Iterator
from pathlib import Path
import threading
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.node import checkpoint
from imu_allan.node.checkpoint import decode_state, UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Run, Setup, unpack
from imu_allan.node.storage import Storage
from imu_allan.node.worker import Worker
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest

SETUP = Setup('/imu', TimelineOptions())


class Logger:
    """What a node logs to, as far as it is used here."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def info(self, line: str) -> None:
        self.lines.append(line)

    warning = error = info


def feed(run: Run, count: int, start: int = 0) -> None:
    numbers = np.arange(start, start + count)
    stamps = 10**18 + 10_000_000 * numbers
    samples = np.random.default_rng(start).normal([0, 0, 0, 0, 0, 10], 1, (count, 6))
    run.lanes[0].update([ImuBlock(stamps, stamps, samples, np.zeros((count, 2), bool), 'imu')])


def samples_in(path: Path) -> int:
    run = unpack(decode_state(path.read_bytes()), SETUP)
    return int(run.lanes[0].characterization.summary().timeline.samples)


@pytest.fixture
def logger() -> Logger:
    return Logger()


@pytest.fixture
def worker(logger: Any) -> Worker:
    return Worker(Log(logger))


@pytest.fixture
def facts() -> Facts:
    return Facts('/imu', 100, 0.0, '')


@pytest.fixture
def storage(tmp_path: Path, logger: Any, worker: Worker, facts: Facts) -> Iterator[Storage]:
    kept = Storage('/imu_allan', SETUP, worker, facts, Log(logger), {
        'state_file': str(tmp_path / 'state'), 'output_dir': str(tmp_path / 'output'),
        'checkpoint_period': 60.0, 'export_for': []})
    yield kept
    kept.close()


def test_old_state_is_not_overwritten_where_its_latest_samples_cannot_be_saved(
        storage: Storage, worker: Worker, facts: Facts, logger: Logger, tmp_path: Path,
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
    assert 'its latest samples are not in it: No space left on device' in logger.lines


def test_a_run_keeps_its_folder_over_a_restart_and_another_that_begins_alike_has_its_own(
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
    assert storage.save_state_at_end(run)
    assert samples_in(tmp_path / 'state') == 2000
    busy.set()
    worker.finish({'plot', 'fit'})
    # The plot was under way, the fit had not begun.
    assert len(done) == 1


def test_a_configuration_that_cannot_be_made_at_the_end_is_told_once(
        worker: Worker, facts: Facts, logger: Any, tmp_path: Path) -> None:
    storage = Storage('/imu_allan', SETUP, worker, facts, Log(logger), {
        'state_file': '', 'output_dir': str(tmp_path / 'output'), 'checkpoint_period': 60.0,
        'export_for': ['kalibr']})
    run = storage.first_run()
    # Constant: there is no noise density.
    stamps = 10**18 + 10_000_000 * np.arange(2000)
    run.lanes[0].update([ImuBlock(stamps, stamps, np.full((2000, 6), 1.0),
                                  np.zeros((2000, 2), bool), 'imu')])
    assert not storage.save_files_at_end(run)
    worker.finish({'save'})
    assert [line for line in logger.lines if 'kalibr' in line] == [logger.lines[-1]]
    storage.close()
