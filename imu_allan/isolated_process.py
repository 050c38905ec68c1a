# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Python processes that import nothing from the current folder.

Users may run the command inside a recording that somebody else made. An interpreter started with
``-c`` imports from the current folder first, so a ``pickle.py`` among the files would run.
Processes are therefore started isolated (``-I``, which ignores the current folder and the
environment). They then receive the import path of this process without the current folder.
"""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
import pickle
import signal
import subprocess
import sys
import traceback
from typing import Any

_PROGRAM = """
import ctypes, os, pickle, signal, sys
try:
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)
except (AttributeError, OSError, TypeError):
    pass
if os.getppid() != {parent}:
    sys.exit()
sys.path[:] = pickle.load(sys.stdin.buffer)
from {module} import {function}
{function}()
"""
"""With PR_SET_PDEATHSIG (1) the Linux kernel ends the process with its parent."""


def import_path() -> list[str]:
    """
    Return the folders that this process imports from, without the current one.

    The folder of this package is appended if it is missing, as in a checkout or an editable
    installation. In the last place it cannot hide other modules.
    """
    here, home = _real(os.curdir), str(Path(__file__).parents[1])
    folders = [folder for folder in sys.path if folder and _real(folder) != here]
    return folders if home in folders else [*folders, home]


def start_python(module: str, function: str, **options: Any) -> subprocess.Popen[bytes]:
    """
    Start an interpreter that calls a function of this package.

    The options are those of `subprocess.Popen`, except standard input: it is an unbuffered pipe.
    """
    process = subprocess.Popen(
        [sys.executable, '-I', '-c', _PROGRAM.format(
            module=module, function=function, parent=os.getpid())],
        bufsize=0, stdin=subprocess.PIPE, **options)
    assert process.stdin is not None
    # It may have ended already; whoever reads from it will notice.
    with suppress(BrokenPipeError), open(process.stdin.fileno(), 'wb', closefd=False) as stdin:
        pickle.dump(import_path(), stdin)
    return process


def portable(error: Exception) -> tuple[Exception, str]:
    """Return an exception that can be sent to another process, and its traceback as text."""
    where = ''.join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f'{type(error).__name__}: {error}'), where
    return error, where


def _real(folder: str) -> str | None:
    try:
        return os.path.realpath(folder)
    except OSError:
        # A relative folder, after the current one was removed.
        return None


def exit_on_sigterm() -> None:
    """Let SIGTERM end this process by SystemExit, so that unpacked files are removed."""
    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_IGN)
        # After this time the kernel ends the process.
        signal.alarm(20)
        raise SystemExit

    signal.signal(signal.SIGTERM, end)
