# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The connection to a Dask cluster; what else may answer at its address ends in one line."""

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
import logging
import threading
from typing import Any

from imu_allan.errors import ImuAllanError

ANSWER_S = 10.0
"""How long a scheduler may take to answer; one in the same building takes milliseconds."""


@contextmanager
def dask_client(address: str) -> Iterator[Any]:
    """Connect to a scheduler, or say in a line why that does not work."""
    try:
        from distributed import Client
    except ImportError:
        raise ImuAllanError('--dask: the package distributed is not installed; '
                            "pip install 'imu_allan[fleet]'") from None
    answer: Future[Any] = Future()

    class Quiet(Client):
        def __del__(self) -> None:
            """Do nothing: one that was never connected would wait for its end, and complain."""

    def connect() -> None:
        try:
            answer.set_result(Quiet(  # type: ignore[no-untyped-call]
                address, timeout=ANSWER_S, set_as_default=False))
        except Exception as error:
            answer.set_exception(error)

    # The library's own timeout does not end a wait for a peer that takes the connection and then
    # says nothing. A thread that may be left behind must not keep the process alive.
    threading.Thread(target=connect, daemon=True).start()
    # What is logged at a failure are tracebacks of what a stranger sent.
    disabled = logging.root.manager.disable
    logging.disable()
    try:
        client = answer.result(2 * ANSWER_S)
    except Exception as error:
        # What is no scheduler may send anything, and the library then raises anything.
        raise ImuAllanError(f'--dask {address}: no scheduler answers ({_reason(error)}); start '
                            'one with: dask scheduler') from error
    logging.disable(disabled)
    with client:
        yield client


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, (OSError, ValueError)) and str(error) else (
        type(error).__name__)
