# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The state file, which preserves the run of a node over a crash or a reboot.

A file is the line ``imu_allan.state/VERSION``, the SHA-256 of the rest, and NumPy arrays in npz
format without pickles. It is replaced atomically, so a reader finds the old state or the new.
What has the right checksum was written by this package, so its arrays are not checked again.
"""

import contextlib
from datetime import datetime, timezone
import fcntl
from glob import escape
import hashlib
import io
import os
from pathlib import Path
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.node.parameters import at_home
from imu_allan.state import State
from imu_allan.writers.atomic import resolved, write_atomically
import numpy as np

VERSION = 11
"""Version of the layout, raised when other versions of the program would misread the file."""
_NAME = b'imu_allan.state/'


class UnusableState(Exception):
    """A state file that cannot be resumed from."""

    def __init__(self, reason: str, explanation: str) -> None:
        super().__init__(explanation)
        self.reason = reason


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

    def remove(self) -> None:
        """Remove the state, so that the next start begins a new run."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)

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
            with contextlib.suppress(FileNotFoundError):
                self.path.rename(aside)
        except OSError as error:
            raise ImuAllanError(f'{self.path}: cannot be renamed ({error.strerror}); move it '
                                'away or choose another state_file') from error
        with contextlib.suppress(OSError):
            kept = self.path.parent.glob(f'{escape(self.path.name)}.*Z')
            for path in sorted(kept, key=lambda path: path.name[-len(now):])[:-20]:
                path.unlink()
        return aside
