# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run and its state, while disks are full or another run takes its place."""

from pathlib import Path
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.node import checkpoint
from imu_allan.node.checkpoint import decode_state, UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import new_run, pack, Setup, unpack
from imu_allan.node.storage import Storage
from imu_allan.node.worker import Worker
from imu_allan.timeline import TimelineOptions
import pytest
from ros_harness import at_rest, Heard

SETUP = Setup('/imu', TimelineOptions())


def test_a_run_has_its_own_folder_over_a_restart_and_keeps_its_state_where_the_disk_is_full(
        heard: Heard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log(heard)  # type: ignore[arg-type]
    worker, state = Worker(log), tmp_path / 'state'
    storage = Storage('/imu_allan', SETUP, worker, Facts('/imu', 100, 0.0, ''), log, {
        'state_file': str(state), 'output_dir': str(tmp_path / 'output'),
        'checkpoint_period': 60.0, 'export_for': []})
    runs = [storage.first_run(), new_run(SETUP)]
    for run in runs:
        run.lanes[0].update([at_rest(2000)])
    # One that begins equally has another folder.
    for run in (*runs, unpack(pack(runs[0], SETUP), SETUP)):
        storage.save(run, picture=False).result()
    assert len(list((tmp_path / 'output').iterdir())) == 2
    storage.checkpoint(runs[0]).result()
    runs[0].lanes[0].update([at_rest(500, start_s=20.0)])

    def full(*_: Any, **__: Any) -> None:
        raise ImuAllanError('No space left on device')

    with monkeypatch.context() as patched:
        patched.setattr(checkpoint, 'write_atomically', full)
        storage.keep_aside(runs[0], UnusableState('rate', 'it is of 100 Hz'))
        # One after the other.
        worker.start('save', lambda: None, lambda _: None).result()
    worker.hand_out()
    [aside] = tmp_path.glob('state.rate.*')
    kept = unpack(decode_state(aside.read_bytes()), SETUP).lanes[0].characterization
    assert kept.summary().timeline.samples == 2000
    assert 'error its latest samples are not in it: No space left on device' in heard.lines
    storage.close()
