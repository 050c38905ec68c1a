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
from typing import Any, IO

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


def start_python(module: str, function: str, *given: Any, **options: Any
                 ) -> subprocess.Popen[bytes]:
    """
    Start an interpreter that calls a function of this package.

    The function finds what is `given`, pickled, on standard input. The options are those of
    `subprocess.Popen`, except standard input and output: these are unbuffered pipes.
    """
    # A separate session keeps Ctrl-C from the process; it ends with the pipe instead.
    process = subprocess.Popen(
        [sys.executable, '-I', '-c', _PROGRAM.format(
            module=module, function=function, parent=os.getpid())],
        bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        **options)
    # It may have ended already; whoever reads from it will notice.
    with suppress(BrokenPipeError), open(
            pipes_of(process)[0].fileno(), 'wb', closefd=False) as stdin:
        for item in (import_path(), *given):
            pickle.dump(item, stdin)
    return process


def pipes_of(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    """Return standard input and output of a process from `start_python`."""
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout


def wait_for(process: subprocess.Popen[bytes], longest_s: float) -> None:
    """Wait until a process has ended, and end it if that takes too long."""
    try:
        process.wait(longest_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def to_parent() -> IO[bytes]:
    """
    Return the pipe to the process that started this one by `start_python`.

    Anything that a library prints goes to standard error, and SIGTERM raises SystemExit, so that
    unpacked files are removed.
    """
    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_IGN)
        # After this time the kernel ends the process.
        signal.alarm(20)
        raise SystemExit

    signal.signal(signal.SIGTERM, end)
    answers = os.fdopen(os.dup(1), 'wb')
    os.dup2(2, 1)
    return answers


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
