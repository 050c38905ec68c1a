# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Handling of Ctrl-C before a program is ready for it, and of a closed standard output."""

EXIT_INTERRUPTED = 130
"""128 + SIGINT, as shells report the signal."""

try:
    from collections.abc import Iterator
    from contextlib import contextmanager
    import os
    import signal
    import sys
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

    def interrupt(*_: object) -> None:
        _came.append(True)
        raise KeyboardInterrupt

    def dropped(what: 'sys.UnraisableHookArgs') -> None:
        if what.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(what)
            return
        from threading import Timer

        # A callback of the interpreter, in which an exception has no effect, soon ends.
        Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()

    sys.unraisablehook = dropped
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except Exception:
        if _came:
            raise SystemExit(EXIT_INTERRUPTED) from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.unraisablehook = sys.__unraisablehook__


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C came, which numpy may have turned into another error."""
    if _came:
        raise KeyboardInterrupt


def drop_stdout() -> None:
    """Discard the rest of standard output, which the interpreter would flush at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
