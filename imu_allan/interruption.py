# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Handling of Ctrl-C and SIGTERM at any time, and of a closed standard output."""

EXIT_INTERRUPTED = 130
"""128 + SIGINT, as shells report the signal."""

try:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import contextmanager
    import os
    import signal
    import sys
    import time
    from types import FrameType
    from typing import Any
except KeyboardInterrupt:
    # It cannot be handled any earlier.
    raise SystemExit(EXIT_INTERRUPTED) from None

EXIT_BROKEN_PIPE = 141
"""128 + SIGPIPE, the status with which `... | head` ends other programs."""


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
"""The signals that came since `interrupt_despite_errors` began."""


@contextmanager
def interrupt_despite_errors() -> Iterator[None]:
    """
    Let Ctrl-C end the process silently, even where a library turns it into another error.

    SIGTERM does the same, so that no unfinished file is left. Either is left alone if it is
    ignored or handled elsewhere.
    """
    usual: dict[int, Any] = {
        signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    numbers = [number for number, handler in usual.items() if signal.getsignal(number) == handler]
    _came.clear()
    raise_at_signal(numbers, KeyboardInterrupt, _came.append)
    try:
        yield
    except Exception:
        if _came:
            raise SystemExit(exit_status()) from None
        raise
    finally:
        for number in numbers:
            signal.signal(number, usual[number])
        sys.unraisablehook = sys.__unraisablehook__
        # After an interrupt within `exec`, as dataclasses call it, CPython would end the process
        # by the signal, unless other code was executed since.
        exec('')


def raise_at_signal(numbers: Sequence[int], error: type[BaseException],
                    before: Callable[[int], None]) -> None:
    """
    Let signals raise an exception, after a call of `before` with the number of the signal.

    If the signal arrives during a callback of the interpreter, for example in an import, the
    exception would be printed and dropped. The signal is then sent again, a moment later, until
    it takes effect.
    """
    latest = 0
    dropped: list[bool] = []

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal latest
        while frame is not None:
            if frame.f_code is once_more.__code__:
                # An exception raised in the hook would be dropped, too.
                return
            frame = frame.f_back
        dropped.clear()
        latest = number
        before(number)
        raise error

    def once_more(what: 'sys.UnraisableHookArgs') -> None:
        if what.exc_type is not error:
            sys.__unraisablehook__(what)
            return
        from threading import Thread

        dropped.append(True)
        signal.signal(latest, handle)
        Thread(target=ask, daemon=True).start()

    def ask() -> None:
        # A callback of the interpreter ends within this time.
        time.sleep(0.01)
        while dropped:
            os.kill(os.getpid(), latest)
            time.sleep(0.01)

    sys.unraisablehook = once_more
    for number in numbers:
        signal.signal(number, handle)


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
