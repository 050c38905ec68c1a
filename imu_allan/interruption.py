# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Handling of Ctrl-C before a program is ready for it, and of a closed standard output."""

EXIT_INTERRUPTED = 130
"""128 + SIGINT, as shells report the signal."""

try:
    from collections.abc import Callable, Iterator
    from contextlib import contextmanager
    import os
    import signal
    import sys
    import time
    from types import FrameType
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


_came: list[bool] = []
"""An entry for each Ctrl-C since `interrupt_despite_errors` began."""


@contextmanager
def interrupt_despite_errors() -> Iterator[None]:
    """Let Ctrl-C end the process silently, even where a library turns it into another error."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _came.clear()
    raise_at_signal(signal.SIGINT, KeyboardInterrupt, lambda: _came.append(True))
    try:
        yield
    except Exception:
        if _came:
            raise SystemExit(EXIT_INTERRUPTED) from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = sys.__unraisablehook__
        # After an interrupt within `exec`, as dataclasses call it, CPython would end the process
        # by the signal, unless other code was executed since.
        exec('')


def raise_at_signal(number: int, error: type[BaseException], before: Callable[[], None]) -> None:
    """
    Let a signal raise an exception, after a call of `before`.

    If the signal arrives during a callback of the interpreter, for example in an import, the
    exception would be printed and dropped. The signal is then sent again, a moment later, until
    it takes effect.
    """
    dropped: list[bool] = []

    def handle(_: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_code is once_more.__code__:
                # An exception raised in the hook would be dropped, too.
                return
            frame = frame.f_back
        dropped.clear()
        before()
        raise error

    def once_more(what: 'sys.UnraisableHookArgs') -> None:
        if what.exc_type is not error:
            sys.__unraisablehook__(what)
            return
        from threading import Thread

        dropped.append(True)
        signal.signal(number, handle)
        Thread(target=ask, daemon=True).start()

    def ask() -> None:
        # A callback of the interpreter ends within this time.
        time.sleep(0.01)
        while dropped:
            os.kill(os.getpid(), number)
            time.sleep(0.01)

    sys.unraisablehook = once_more
    signal.signal(number, handle)


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C came, which numpy may have turned into another error."""
    if _came:
        raise KeyboardInterrupt


def drop_stdout() -> None:
    """Discard the rest of standard output, which the interpreter would flush at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
