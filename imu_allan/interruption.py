# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C before a program is ready for it, and a reader of its output that has gone."""

EXIT_INTERRUPTED = 130
"""As a shell reports the signal: 128 + SIGINT."""

try:
    from collections.abc import Iterator
    from contextlib import contextmanager
    import os
    import signal
    import sys
except KeyboardInterrupt:
    # Nobody can handle it earlier.
    raise SystemExit(EXIT_INTERRUPTED) from None

EXIT_BROKEN_PIPE = 141
"""128 + SIGPIPE, what `... | head` ends other programs with."""


@contextmanager
def quiet_interrupt() -> Iterator[None]:
    """Let Ctrl-C end the process at once, unless it is ignored or somebody handles it."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    # An exception would be reported with a traceback, and forgotten in a callback of an import.
    signal.signal(signal.SIGINT, lambda *_: os._exit(EXIT_INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def heeded_interrupt() -> Iterator[None]:
    """Let Ctrl-C end the process without a word where an import made another error of it."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    came = False

    def interrupt(*_: object) -> None:
        nonlocal came
        came = True
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except Exception:
        if came:
            # As numpy does, which says that it is not installed rightly.
            raise SystemExit(EXIT_INTERRUPTED) from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def drop_stdout() -> None:
    """Let the rest of standard output go nowhere: the interpreter flushes it once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
