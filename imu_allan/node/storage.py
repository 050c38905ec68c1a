# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Storage of a run: its state, to survive a crash or a reboot, and its result files.

A state file is the line ``imu_allan.state/VERSION``, the SHA-256 of the rest, and NumPy arrays in
npz format without pickles. It is replaced atomically, so a reader finds the old state or the new.
What has the right checksum was written by this package, so its arrays are not checked again.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from datetime import datetime, timezone
import fcntl
from glob import escape
import hashlib
import io
import os
from pathlib import Path
import re
import tempfile
import time
from typing import Any

from imu_allan.characterization.join_results import fitted
from imu_allan.errors import ImuAllanError
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.parameters import at_home, DEFAULT_STATE_FILE
from imu_allan.node.run import new_run, pack, Run, Setup, unpack, UnusableState
from imu_allan.node.worker import TooEarly, Worker
from imu_allan.state import State
from imu_allan.wording import duration
from imu_allan.writers.atomic import resolved, write_atomically
from imu_allan.writers.result_files import IncompleteSave, save_folder
import numpy as np

VERSION = 15
"""Version of the layout, raised when other versions of the program would misread the file."""
_NAME = b'imu_allan.state/'


def encode_state(state: State) -> bytes:
    """Return the content of a state file."""
    content = io.BytesIO()
    parts: dict[str, Any] = state
    np.savez(content, **parts)
    payload = content.getvalue()
    return _NAME + b'%d\n' % VERSION + hashlib.sha256(payload).digest() + payload


def decode_state(data: bytes) -> State:
    """Return the arrays from the content of a state file."""
    if not data.startswith(_NAME):
        # An interrupted copy may have left the beginning of the name, or nothing.
        reason = 'damaged' if _NAME.startswith(data) else 'foreign'
        raise UnusableState(reason, 'it is not a state file of imu_allan')
    line, newline, rest = data.partition(b'\n')
    version = line[len(_NAME):]
    if not newline or not version.isdigit() or len(version) > 9:
        raise UnusableState('damaged', 'its first line is damaged')
    if int(version) != VERSION:
        raise UnusableState('newer' if int(version) > VERSION else 'foreign',
                            f'it has version {int(version)}, this imu_allan reads {VERSION}')
    digest, payload = rest[:32], rest[32:]
    if hashlib.sha256(payload).digest() != digest:
        raise UnusableState('damaged', 'its checksum is wrong')
    try:
        with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except ValueError as error:
        raise UnusableState('damaged', f'its arrays cannot be read ({error})') from error


def _grown(runs: Sequence[Run]) -> bool:
    """Return whether runs have messages that the last checkpoint lacks."""
    return any(run.fed != run.checkpointed for run in runs)


class StateFile:
    """One node's state file, locked against every other node while this object is open."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self.path = resolved(at_home(path, 'state_file'))
            if self.path.exists() and not self.path.is_file():
                raise ImuAllanError(f'state_file {path}: is a folder, a device or a pipe; name a '
                                    'regular file, or one that is not there yet')
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = self.path.with_name(f'{self.path.name}.lock').open('ab')
        except OSError as error:
            raise ImuAllanError(f'state_file {path}: cannot be written ({error.strerror}); '
                                'choose a folder that may be written to') from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._lock.close()
            raise ImuAllanError(f'state_file {path}: is in use by another node; give every node '
                                'a file of its own') from error

    def close(self) -> None:
        """Release the lock."""
        self._lock.close()

    def load(self) -> State | None:
        """Read the last saved state; return None if there is no file."""
        try:
            with self.path.open('rb') as file:
                # A state has some megabytes; more of what is no state is not read into memory.
                return decode_state(file.read(64_000_000))
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UnusableState('unreadable', f'it cannot be read ({error.strerror})') from error

    def save(self, state: State) -> None:
        """Replace the saved state."""
        write_atomically(self.path, encode_state(state), private=True)

    def keep_aside(self, reason: str) -> Path:
        """
        Rename the saved state so that a new run cannot overwrite it, and return its path.

        Of those that were renamed before, the newest are kept, twenty in all.
        """
        now = datetime.now(timezone.utc).strftime('%Y%m%dT%H%M%S.%fZ')
        aside = self.path.with_name(f'{self.path.name}.{reason}.{now}')
        try:
            with suppress(FileNotFoundError):
                self.path.rename(aside)
        except OSError as error:
            raise ImuAllanError(f'{self.path}: cannot be renamed ({error.strerror}); move it '
                                'away or choose another state_file') from error
        with suppress(OSError):
            kept = self.path.parent.glob(f'{escape(self.path.name)}.*Z')
            for path in sorted(kept, key=lambda path: path.name[-len(now):])[:-20]:
                path.unlink()
        return aside


def try_folder(output_dir: str) -> None:
    """Check that the output folder can be written to: create a file in it and remove it."""
    folder = at_home(output_dir, 'output_dir')
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(b'x')
    except OSError as error:
        raise ImuAllanError(
            f'output_dir {output_dir}: cannot be written ({error.strerror or error}); set the '
            'parameter to a folder that may be written to') from error


class Storage:
    """The state file and the output folder."""

    def __init__(self, node_name: str, setup: Setup, worker: Worker, facts: Facts, log: Log,
                 values: Mapping[str, Any]) -> None:
        self._node_name = node_name
        self._setup = setup
        self._worker = worker
        self._facts = facts
        self._log = log
        self._unasked = values['state_file'] == DEFAULT_STATE_FILE
        self._state_file = self._opened(values['state_file'])
        facts.state_file = '' if self._state_file is None else str(self._state_file.path)
        self._values = values
        self._last_checkpoint = time.monotonic()
        # Whether the result did not permit all files that were asked for at the end.
        self.incomplete = False

    def close(self, is_over: bool) -> None:
        """Release the state file; remove it if the run is over and nobody asked for the file."""
        if self._state_file is not None:
            if is_over and self._unasked:
                # The next start begins a new run.
                with suppress(OSError):
                    self._state_file.path.unlink()
            self._state_file.close()

    # -- the state file -------------------------------------------------------------------------

    def _opened(self, path: str) -> StateFile | None:
        # The launch file takes the same word, as ros2 launch takes no empty argument.
        if path in ('', 'none'):
            return None
        if not self._unasked:
            return StateFile(path)
        name = re.sub(r'[^A-Za-z0-9_]+', '.', self._node_name.strip('/'))
        try:
            return StateFile(Path(os.environ.get('ROS_HOME') or '~/.ros') / 'imu_allan'
                             / f'{name}.state')
        except ImuAllanError as error:
            # The default file was not asked for, so the node runs without it.
            self._log.warning(f'nothing is kept over a crash: {error}', 'no state', 0.0)
            return None

    def resumed_or_new_run(self) -> list[Run]:
        """Return the run from the state file, or a new one; and that of another IMU, if any."""
        runs = [new_run(self._setup)]
        if self._state_file is None:
            return runs
        try:
            if (state := self._state_file.load()) is not None:
                runs = unpack(state, self._setup)
        except UnusableState as error:
            aside = self._state_file.keep_aside(error.reason)
            self._note_aside(f'a new run: {self._state_file.path} could not be resumed from, '
                             f'{error}; it', aside)
        longest_s = max(lane.characterization.summary().timeline.duration_s
                        for lane in runs[0].lanes)
        # Without samples there is nothing to go on with, as at first or after a reset.
        if longest_s:
            for run in runs:
                run.resumed = True
            unasked = (', of a run that has ended without saving; call ~/reset to begin anew'
                       if self._unasked else '')
            self._facts.resumed = (f'resumed {duration(longest_s)} of data from '
                                   f'{self._state_file.path}{unasked}')
            self._log.info(self._facts.resumed)
        return runs

    def keep_aside(self, run: Run, why: UnusableState) -> None:
        """Rename the state of the run so that the next one cannot overwrite it."""
        state_file = self._state_file
        if state_file is None:
            return
        state = pack([run], self._setup) if run.fed != run.checkpointed else None

        def keep() -> Path:
            try:
                if state is not None:
                    state_file.save(state)
            finally:
                # Where the latest samples cannot be saved, the earlier ones are.
                aside = state_file.keep_aside(why.reason)
            return aside

        self._worker.start('aside', keep, lambda aside: self._note_aside(
            f'the last run cannot go on, {why}; its state', aside))
        # The next run has to be on the disk at once.
        self._last_checkpoint = time.monotonic() - self._values['checkpoint_period']

    def _note_aside(self, what: str, aside: Path) -> None:
        self._facts.resumed = f'{what} is kept as {aside.name}'
        self._log.warning(self._facts.resumed, 'aside', 0.0)

    def checkpoint_due(self, now: float, runs: Sequence[Run]) -> bool:
        """Return whether the state is to be written now."""
        period = self._values['checkpoint_period']
        # Before the period ends, so that samples are on the disk within it.
        due = now - self._last_checkpoint >= max(period / 3, period - 2.0)
        return (self._state_file is not None and due and _grown(runs)
                and not self._worker.under_way('checkpoint'))

    def checkpoint(self, runs: Sequence[Run]) -> 'Future[None] | None':
        """Start writing the state of runs, if there is a state file."""
        state_file = self._state_file
        if state_file is None:
            return None
        began = self._last_checkpoint = time.monotonic()
        fed = [run.fed for run in runs]
        state = pack(runs, self._setup)

        def note(_: None) -> None:
            for run, count in zip(runs, fed, strict=True):
                run.checkpointed = count
            self._facts.checkpointed_at = began
            self._worker.errors['aside'] = ''

        return self._worker.start('checkpoint', lambda: state_file.save(state), note)

    # -- the output folder ----------------------------------------------------------------------

    def try_output(self) -> None:
        """Start a check of the output folder, to report faults early and not only at the end."""
        self._worker.start('output_dir', lambda: try_folder(self._values['output_dir']),
                           lambda _: None)

    def save(self, run: Run, picture: bool = True) -> 'Future[list[Path]]':
        """Start writing result, curves, plot and configurations."""
        folder, snapshot = self._values['output_dir'], run.snapshot()
        consumers = [consumer for consumer in self._values['export_for'] if consumer]

        def work() -> list[Path]:
            result, _ = fitted(snapshot)
            if not result.axes:
                why = '; '.join(filter(None, [one.finish() for one in snapshot]))
                raise TooEarly('nothing to save: ' + (
                    why or f'too few usable samples have come from '
                           f'{", ".join(self._setup.topics)} yet'))
            start = (result.source.start_time or 'unknown').removesuffix('Z')
            own = at_home(folder, 'output_dir') / re.sub(
                r'[^A-Za-z0-9_-]+', '-',
                f'{self._node_name.strip("/")}_{start}_{run.mark}'.replace('/', '_'))
            run.saved = result
            try:
                return save_folder(result, own, consumers, report=False, picture=picture)
            finally:
                # Only an empty folder is removed: nothing could be written.
                with suppress(OSError):
                    own.rmdir()

        def note(paths: list[Path]) -> None:
            self._worker.errors['output_dir'] = ''
            self._log.info(f'wrote {", ".join(path.name for path in paths)} to {paths[0].parent}',
                           f'wrote to {paths[0].parent}')

        return self._worker.start('save', work, note)

    # -- the end --------------------------------------------------------------------------------

    def save_state_at_end(self, runs: Sequence[Run]) -> bool:
        """Write the state if it is newer than the last checkpoint; return whether that worked."""
        future = self.checkpoint(runs) if _grown(runs) else None
        return future is None or future.exception() is None

    def save_files_at_end(self, run: Run, picture: bool = True) -> bool:
        """Write the files; return whether that worked, and if not the state is kept."""
        if not run.fed and not (self._unasked and run.resumed):
            return True
        try:
            self.save(run, picture=picture).result()
        except (TooEarly, IncompleteSave) as error:
            # All that the result permits is written, so the run is over.
            self._log.info(str(error))
            self.incomplete |= isinstance(error, IncompleteSave)
        except ImuAllanError:
            return False
        return True
