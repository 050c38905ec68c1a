# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that a test starts, with all that they start, and waiting for their end."""

from collections.abc import Callable
import contextlib
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

_MARK = 'IMU_ALLAN_TEST'


def marked(folder: Path) -> dict[str, str]:
    """Return an environment by which a process, and those it starts, are known as `folder`'s."""
    return {**os.environ, _MARK: str(folder)}


def living(folder: Path) -> list[int]:
    mark = f'{_MARK}={folder}'.encode()
    found = []
    # What has ended and is not waited for yet has no environment any more.
    for environment in Path('/proc').glob('[0-9]*/environ'):
        with contextlib.suppress(OSError):
            if mark in environment.read_bytes().split(b'\0'):
                found.append(int(environment.parent.name))
    return found


_INTERRUPTED = """
import importlib, os, signal, sys


class Interrupt:
    def find_spec(self, name, *_):
        if name == interrupted:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                if name not in ('numpy', 'scipy'):
                    raise
                # What their C code makes of it.
                raise ImportError('PyCapsule_Import could not import module') from None


entry, interrupted = sys.argv.pop(1), sys.argv.pop(1)
# As in a fresh interpreter, which has not met them yet.
sys.modules.pop(interrupted, None)
sys.meta_path.insert(0, Interrupt())
raise SystemExit(importlib.import_module(entry).main())
"""


def python(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run this interpreter, and keep what it says."""
    return subprocess.run([sys.executable, *map(str, arguments)], **{
        'check': False, 'capture_output': True, 'text': True, 'timeout': 300, **options})


def interrupted(entry: str, module: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the main of a module, which is interrupted while it imports another."""
    return python('-c', _INTERRUPTED, entry, module, *arguments)


def wait_until(reached: Callable[[], object], timeout_s: float = 30.0) -> None:
    """Wait for what takes longer on a busy machine; an error if it never comes."""
    end = time.monotonic() + timeout_s
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.02)


# The largest memory of a process begins with that of the one that started it: a small one.
_METER = """
import json, os, subprocess, sys
process = subprocess.Popen(sys.argv[2:])
_, status, usage = os.wait4(process.pid, 0)
with open(sys.argv[1], 'w') as file:
    json.dump([os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime,
               usage.ru_maxrss], file)
"""


def run(*arguments: object, most_s: float = 10.0, most_kb: int = 300_000) -> tuple[int, str, str]:
    """Run the command within CPU time and memory; returns status, stdout and stderr."""
    with tempfile.TemporaryDirectory() as folder:
        measured = Path(folder, 'measured')
        done = python('-c', _METER, measured, sys.executable, '-m', 'imu_allan', *arguments,
                      timeout=12 * most_s, check=True)
        status, seconds, kilobytes = json.loads(measured.read_text())
    assert seconds < most_s
    assert kilobytes < most_kb
    return status, done.stdout, done.stderr
