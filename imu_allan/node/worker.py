# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The worker threads, which work on copies: one for fits, plots and files, one for the state.

A fit or a plot takes seconds on a busy computer. If checkpoints had to wait for it, a crash
meanwhile would lose the latest samples.
"""

from collections.abc import Callable, Container
from concurrent.futures import Future, ThreadPoolExecutor
import contextlib
import ctypes
from functools import partial
import gc
from typing import Any, TypeVar

from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.log import Log
from imu_allan.writers.result_files import IncompleteSave

T = TypeVar('T')


class TooEarly(ImuAllanError):
    """Raised if there is nothing to work on yet; only the caller learns of it."""


class Worker:
    """Does the work that would hold up the executor's thread for too long."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._thread = ThreadPoolExecutor(1, 'imu_allan_worker')
        self._keeper = ThreadPoolExecutor(1, 'imu_allan_state')
        self._jobs: list[tuple[str, Future[Any], Callable[[Any], None]]] = []
        # By kind of job: what went wrong at the last attempt, empty if it succeeded.
        self.errors: dict[str, str] = {}

    def start(self, kind: str, work: Callable[[], T], done: Callable[[T], None]) -> Future[T]:
        """Queue `work`; `hand_out` passes what it returned to `done`."""
        of_state = kind in ('checkpoint', 'aside')
        job = partial(_draw, work) if kind in ('plot', 'save') else work
        future = (self._keeper if of_state else self._thread).submit(job)
        self._jobs.append((kind, future, done))
        return future

    def under_way(self, kind: str) -> bool:
        """Return whether a job of this kind is queued, running or not handed out yet."""
        return any(job == kind for job, _, _ in self._jobs)

    def hand_out(self) -> None:
        """Call `done`, or note the error, of every job that is finished, in this thread."""
        finished = [job for job in self._jobs if job[1].done()]
        for job in finished:
            self._jobs.remove(job)
            kind, future, done = job
            error = future.exception()
            if not isinstance(error, TooEarly):
                self.errors[kind] = ('' if error is None or isinstance(error, IncompleteSave)
                                     else self._logged(kind, error))
            if error is None:
                done(future.result())
        if finished:
            _give_back_memory()

    def _logged(self, kind: str, error: BaseException) -> str:
        """Log an error and return it as a line."""
        if isinstance(error, ImuAllanError):
            self._log.error(str(error), f'{type(error).__name__} {kind}')
            return str(error)
        # A bug in one fit must not end a run of days.
        self._log.bug(error, 'the node goes on')
        return f'internal error, see the log: {printable(error)}'

    def drop_all_but(self, kinds: Container[str]) -> None:
        """Cancel queued jobs of other kinds; nobody takes what one that has begun returns."""
        for kind, future, _ in self._jobs:
            if kind not in kinds:
                future.cancel()
        self._jobs = [job for job in self._jobs if job[0] in kinds]

    def finish(self) -> None:
        """Wait for all jobs, and hand them out."""
        for thread in (self._keeper, self._thread):
            thread.shutdown()
        self.hand_out()


def _draw(work: Callable[[], T]) -> T:
    """Do work that draws a picture, and free the picture."""
    try:
        return work()
    finally:
        # A figure is 8 MB in cycles. By itself Python frees them only after a dozen or two.
        gc.collect()


def _give_back_memory() -> None:
    """Return free memory to the system, where the C library can (GNU)."""
    # Threads of the middleware allocate messages and ours frees them. This scatters free memory
    # over ever more pages, which would otherwise never be returned.
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
