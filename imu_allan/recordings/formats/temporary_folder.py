# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Where a file is unpacked or copied to, and how that goes away again."""

from pathlib import Path
import shutil
import tempfile


def make_folder() -> Path:
    """Make a temporary folder that nobody else can look into."""
    return Path(tempfile.mkdtemp(prefix='imu_allan_'))


def remove_folder(folder: Path) -> None:
    """Remove a temporary folder and all it holds, also where an end from outside interrupts."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        # A process that is ended in peace is interrupted once, see `serve` of the workers.
        shutil.rmtree(folder, ignore_errors=True)
        raise
