# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The process of the command: a fast start, one thread, Ctrl-C and SIGTERM at any time.

Nodes start in the same way, and handle signals in `imu_allan.node.program`.
"""

import atexit
from collections.abc import Iterator
from contextlib import contextmanager
import gc
import os
import signal
import sys
from threading import Timer
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

EXIT_INTERRUPTED = 130
"""128 + SIGINT, as shells report the signal."""
EXIT_BROKEN_PIPE = 141
"""128 + SIGPIPE, the status with which `... | head` ends other programs."""


def start_quickly() -> None:
    """
    Search less for garbage; call it before importing numpy.

    Imports make a hundred thousand objects, none of which is garbage. Python would look through
    all of them twice while they are made, and twice more before it ends.
    """
    gc.set_threshold(5_000, 10, 10)
    atexit.register(gc.freeze)


def open_closed_streams() -> None:
    """Let what goes to a closed standard stream (>&-, 2>&-) vanish."""
    # Python has None in its place. The system would give its number to the next file or socket
    # that is opened, and what libraries write to standard error would go there.
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: PTH123, SIM115


def use_one_thread() -> None:
    """
    Limit OpenBLAS to one thread unless the user sets a number; call it before importing numpy.

    The matrices of a fit have some thousand rows. Threads for them mostly wait for one another,
    and OpenBLAS waits by spinning, on cores that a robot needs for other work.
    """
    if 'OMP_NUM_THREADS' not in os.environ:
        os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')


@contextmanager
def quiet_interrupt() -> Iterator[None]:
    """Let Ctrl-C end the process at once, unless it is ignored or handled elsewhere."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def end(*_: object) -> None:
        os._exit(EXIT_INTERRUPTED)

    # An exception would print a traceback, or be dropped in a callback during an import.
    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is end:
            signal.signal(signal.SIGINT, signal.default_int_handler)


_came: list[int] = []
"""The signals that came since `interruptible` began."""


@contextmanager
def interruptible() -> Iterator[None]:
    """
    Let SIGTERM raise KeyboardInterrupt, as Ctrl-C does, so that no unfinished file is left.

    Either is left alone if it is ignored or handled elsewhere.
    """
    def interrupt(number: int, frame: 'FrameType | None') -> None:
        _came.append(number)
        while frame:
            if frame.f_code is raise_again.__code__:
                later()
                return
            frame = frame.f_back
        raise KeyboardInterrupt

    def later() -> None:
        Timer(0.01, signal.raise_signal, [_came[-1]]).start()

    def raise_again(ignored: 'sys.UnraisableHookArgs') -> None:
        # Raised in a callback, such as those of an import, an interrupt would be lost; here, too.
        if isinstance(ignored.exc_value, KeyboardInterrupt):
            later()
        else:
            report(ignored)

    usual: dict[int, Any] = {
        signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    numbers = [number for number, handler in usual.items() if signal.getsignal(number) == handler]
    _came.clear()
    for number in numbers:
        signal.signal(number, interrupt)
    report, sys.unraisablehook = sys.unraisablehook, raise_again
    try:
        yield
    except Exception:
        # While numpy is imported, it turns an interrupt into another error.
        if _came:
            raise SystemExit(exit_status()) from None
        raise
    finally:
        sys.unraisablehook = report
        for number in numbers:
            signal.signal(number, usual[number])
        # After an interrupt within `exec`, as dataclasses call it, CPython would end the process
        # by the signal, unless other code was executed since.
        exec('')


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if a signal came, which numpy may have turned into another error."""
    if _came:
        raise KeyboardInterrupt


def exit_status() -> int:
    """Return the status of an interrupted process: 128 and the signal, as shells report it."""
    return 128 + _came[-1] if _came else EXIT_INTERRUPTED


def drop_stdout() -> None:
    """Discard the rest of standard output, which the interpreter would flush at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
