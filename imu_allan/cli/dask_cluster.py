# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Connection to a Dask cluster; anything else at its address gives an error of one line."""

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
import logging
import threading
from typing import Any

from imu_allan.errors import ImuAllanError

ANSWER_S = 10.0
"""Longest time for a scheduler to answer; one in the same building takes milliseconds."""


@contextmanager
def dask_client(address: str) -> Iterator[Any]:
    """Connect to a scheduler, or raise an error of one line that says why that fails."""
    try:
        from distributed import Client
    except ImportError:
        raise ImuAllanError('--dask: the package distributed is not installed; '
                            "pip install 'imu_allan[fleet]'") from None
    answer: Future[Any] = Future()

    class Quiet(Client):
        def __del__(self) -> None:
            """Do nothing: a client that never connected would wait for its end, and complain."""

    def connect() -> None:
        try:
            answer.set_result(Quiet(  # type: ignore[no-untyped-call]
                address, timeout=ANSWER_S, set_as_default=False))
        except Exception as error:
            answer.set_exception(error)

    # The library's own timeout does not cover a peer that accepts the connection and then sends
    # nothing. The thread may be left behind and must not keep the process alive.
    threading.Thread(target=connect, daemon=True).start()
    # On failure the library logs tracebacks about whatever the peer sent.
    disabled = logging.root.manager.disable
    logging.disable()
    try:
        client = answer.result(2 * ANSWER_S)
    except Exception as error:
        # A peer that is no scheduler may send anything, so the library may raise anything.
        raise ImuAllanError(f'--dask {address}: no scheduler answers ({_reason(error)}); start '
                            'one with: dask scheduler') from error
    logging.disable(disabled)
    with client:
        yield client


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, (OSError, ValueError)) and str(error) else (
        type(error).__name__)
