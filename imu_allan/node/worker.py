# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The worker threads, which work on copies: one for fits, plots and files, one for the state.

A fit or a plot takes seconds on a busy computer. If checkpoints had to wait for it, a crash
meanwhile would lose the latest samples.
"""

from collections.abc import Callable, Container
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
import gc
from typing import Any, TypeVar

from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.log import Log
from imu_allan.node.process import give_back_memory

T = TypeVar('T')


class Worker:
    """Does the work that would hold up the executor's thread for too long."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._thread = ThreadPoolExecutor(1, 'imu_allan_worker')
        self._keeper = ThreadPoolExecutor(1, 'imu_allan_state')
        self._jobs: list[tuple[str, Future[Any], Callable[[Future[Any]], None]]] = []

    def start(self, kind: str, work: Callable[[], T],
              done: Callable[[Future[T]], None]) -> Future[T]:
        """Queue `work`; `done` is called by `hand_out` once it is finished."""
        of_state = kind in ('checkpoint', 'aside')
        job = partial(_draw, work) if kind in ('plot', 'save') else work
        future = (self._keeper if of_state else self._thread).submit(job)
        self._jobs.append((kind, future, done))
        return future

    def under_way(self, kind: str) -> bool:
        """Return whether a job of this kind is queued, running or not handed out yet."""
        return any(job == kind for job, _, _ in self._jobs)

    def hand_out(self) -> None:
        """Call `done` of every job that is finished, in this thread."""
        finished = [job for job in self._jobs if job[1].done()]
        for job in finished:
            self._jobs.remove(job)
            _, future, done = job
            done(future)
        if finished:
            give_back_memory()

    def failure(self, kind: str, future: Future[Any]) -> str:
        """Log the error of a finished job, if any; return it as a line, empty if none."""
        error = future.exception()
        if error is None:
            return ''
        if isinstance(error, ImuAllanError):
            self._log.error(str(error), f'{type(error).__name__} {kind}')
            return str(error)
        # A bug in one fit must not end a run of days.
        self._log.bug(error, 'the node goes on')
        return f'internal error, see the log: {printable(error)}'

    def drop_queued(self, kinds: Container[str]) -> None:
        """Cancel the jobs of these kinds that have not begun."""
        self._jobs = [(kind, future, done) for kind, future, done in self._jobs
                      if kind not in kinds or not future.cancel()]

    def finish(self, kinds: Container[str]) -> None:
        """Wait for running jobs, cancel queued ones, and hand out finished ones of these kinds."""
        for thread in (self._keeper, self._thread):
            thread.shutdown(wait=True, cancel_futures=True)
        self._jobs = [(kind, future, done) for kind, future, done in self._jobs
                      if kind in kinds and not future.cancelled()]
        self.hand_out()


def _draw(work: Callable[[], T]) -> T:
    """Do work that draws a picture, and free the picture."""
    try:
        return work()
    finally:
        # A figure is 8 MB in cycles. By itself Python frees them only after a dozen or two.
        gc.collect()
