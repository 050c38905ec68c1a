# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run, into which ``~/save`` writes."""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import re
import secrets
import tempfile

from imu_allan.errors import ImuAllanError
from imu_allan.node.interface import at_home, DEFAULT_OUTPUT_DIR
from imu_allan.result import Result
from imu_allan.writers.output_path import open_folder, resolved


def try_folder(output_dir: str) -> None:
    """Check that the output folder can be written to: create a file in it and remove it."""
    expanded = at_home(output_dir, 'output_dir')
    try:
        with contextlib.ExitStack() as undone:
            folder, name = open_folder(resolved(expanded)), f'.imu_allan.{secrets.token_hex(4)}'
            undone.callback(os.close, folder)
            handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600, dir_fd=folder)
            undone.callback(os.unlink, name, dir_fd=folder)
            undone.callback(os.close, handle)
            os.write(handle, b'x')
    except OSError as error:
        raise ImuAllanError(
            f'output_dir {output_dir}: cannot be written ({error.strerror or error}); set the '
            'parameter to a folder that may be written to') from error


def other_folders(state_file: Path | None) -> Iterator[str]:
    """Yield folders to try if the output folder cannot be written to, likeliest first."""
    if state_file is not None:
        yield str(state_file.parent)
    yield DEFAULT_OUTPUT_DIR
    # Raised if none of the system's folders for temporary files is writable.
    with contextlib.suppress(OSError):
        yield str(Path(tempfile.gettempdir()) / 'imu_allan')


def run_folder(output_dir: str, node_name: str, result: Result, mark: str) -> Path:
    """Return the folder of a run, named by node, time of the first sample and mark."""
    start = (result.source.start_time or 'unknown').removesuffix('Z')
    name = f'{node_name.strip("/")}_{start}_{mark}'
    return at_home(output_dir, 'output_dir') / re.sub(
        r'[^A-Za-z0-9_-]+', '-', name.replace('/', '_'))
