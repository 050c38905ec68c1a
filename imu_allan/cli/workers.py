# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Who works on several recordings: this process, others of this machine, or a Dask cluster.

Python's own process pools start their workers in a way that imports from the current folder first,
which may be a recording that somebody else made; those of this module are isolated.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, ExitStack, suppress
from itertools import groupby
from math import ceil
import os
import pickle
from queue import SimpleQueue
import signal
import subprocess
import sys
import threading
from typing import Any, IO, TYPE_CHECKING, TypeVar

from imu_allan.cli.dask_cluster import dask_client
from imu_allan.cli.tasks import characterize, Task
from imu_allan.errors import ImuAllanError, printable
from imu_allan.isolated_process import end_in_peace, portable, start_python

if TYPE_CHECKING:
    from imu_allan.analysis import Opening
    from imu_allan.result import Result

T = TypeVar('T')

_PATIENCE_S = 15.0
"""How long a worker may take to remove what it unpacked; it waits 10 s for its own reader."""


@contextmanager
def drawing_process(*, wanted: bool = True) -> Iterator[Executor | None]:
    """
    Give a process that draws pictures beside this one; None on a computer with one core.

    It begins at once with its imports, which take as long as reading and fitting a small
    recording.

    Parameters
    ----------
    wanted : bool, optional
        False gives none.

    """
    if not wanted or len(os.sched_getaffinity(0)) < 2:
        yield None
        return
    with WorkerProcesses(1) as artist:
        artist.submit(_prepare_to_draw)
        yield artist


def _prepare_to_draw() -> None:
    from imu_allan.writers.plot import prepare_to_draw

    prepare_to_draw()


@contextmanager
def executor(jobs: int, dask: str | None, artist: Executor | None = None) -> Iterator[Executor]:
    """
    Give whatever works: this process, `jobs` others of this machine, or a Dask cluster.

    Parameters
    ----------
    jobs : int
        Recordings to work on at a time.
    dask : str or None
        Address of the cluster.
    artist : Executor, optional
        Draws the pictures where this process works; the others draw theirs.

    Raises
    ------
    ImuAllanError
        If the cluster cannot be used.

    """
    if dask is not None:
        with dask_client(dask) as client:
            yield client.get_executor(pure=False)
    elif jobs == 1:
        yield _ThisProcess(artist)
    else:
        with WorkerProcesses(jobs) as workers:
            yield workers


def in_order(workers: Executor, tasks: Sequence[Task],
             progress: Callable[[int], None]
             ) -> 'Iterator[tuple[Task, Future[tuple[Result, ImuAllanError | None]]]]':
    """Submit every task; yield each with its finished future, in the order of `tasks`."""
    groups = [list(same) for _, same in groupby(tasks, _recording_of)]
    if isinstance(workers, _ThisProcess):
        yield from _here(workers, groups, progress)
        return
    # Of many recordings there is one for every worker without parting any. A cluster reads one up
    # to 16 times, so that each of its workers has a share, however uneven they are.
    most = (ceil(workers.jobs / max(len(groups), 1)) if isinstance(workers, WorkerProcesses)
            else 16)
    waiting = deque((part, workers.submit(characterize_each, part))
                    for group in groups for part in _parts(group, most))
    done_bytes = 0
    while waiting:
        part, futures = waiting.popleft()
        wait([futures])
        for task, future in zip(part, _apart(futures, len(part)), strict=True):
            done_bytes += task.size_bytes
            progress(done_bytes)
            yield task, future


def _here(workers: '_ThisProcess', groups: Sequence[Sequence[Task]],
          progress: Callable[[int], None]
          ) -> 'Iterator[tuple[Task, Future[tuple[Result, ImuAllanError | None]]]]':
    """Work in this process, so that each result is there at once."""
    done_bytes = 0
    for group in groups:
        with _opened_once(group) as opening:
            for task in group:
                yield task, workers.submit(
                    characterize, task, lambda done, before=done_bytes: progress(before + done),
                    workers.artist, opening)
                done_bytes += task.size_bytes


def characterize_each(tasks: Sequence[Task]
                      ) -> 'list[tuple[tuple[Result, ImuAllanError | None] | None, Any]]':
    """
    Characterize several topics of one recording; a failure stops none of the others.

    Parameters
    ----------
    tasks : sequence of Task
        Of one recording, or one of any kind.

    Returns
    -------
    list of (result of `characterize`, failure)
        One of them None.

    """
    with _opened_once(tasks) as opening:
        return [_outcome(characterize, (task, None, None, opening), {}) for task in tasks]


def _recording_of(task: Task) -> tuple[object, ...]:
    """Return what is the same of the topics of a recording; a task without one is by itself."""
    return task.path, task.reading, task.options, id(task) if task.topic is None else 0


@contextmanager
def _opened_once(tasks: Sequence[Task]) -> 'Iterator[Opening | None]':
    """Open a recording once for all its topics in `tasks`; None where each task opens its own."""
    from imu_allan.recordings import open_recording

    with ExitStack() as stack:
        opening = None
        if len(tasks) > 1:
            first = tasks[0].arguments()
            # What is wrong with it meanwhile is reported with each task.
            with suppress(ImuAllanError):
                opening = stack.enter_context(open_recording(
                    tasks[0].path, rate_hz=first['options'].rate_hz,
                    options=first['reading'])).again
        yield opening


def _parts(group: Sequence[Task], most: int) -> Iterator[Sequence[Task]]:
    """Part the topics of a recording: each part is one reading, and several can work on them."""
    size = -(-len(group) // most)
    for first in range(0, len(group), size):
        yield group[first:first + size]


def _apart(done: 'Future[list[tuple[Any, Any]]]', count: int) -> 'Iterator[Future[Any]]':
    """Give the outcome of each task of a part."""
    error = done.exception()
    for value, failure in [(None, (error, ''))] * count if error is not None else done.result():
        future: Future[Any] = Future()
        if failure is None:
            future.set_result(value)
        else:
            future.set_exception(_raisable(*failure))
        yield future


def _raisable(error: BaseException, where: str) -> BaseException:
    """Return what a worker raised, with its traceback where it was not expected."""
    if where and not isinstance(error, (ImuAllanError, OSError)):
        error.__cause__ = RuntimeError(f'in a worker process:\n{where}')
    return error


class _ThisProcess(Executor):
    """Works at the moment of submission, so that Ctrl-C and progress need no messenger."""

    def __init__(self, artist: Executor | None = None) -> None:
        self.artist = artist

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> 'Future[T]':
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerProcesses(Executor):
    """Works in processes of this machine, each served by a thread of this one."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._threads = ThreadPoolExecutor(jobs)
        self._of_thread = threading.local()
        self._started: list[subprocess.Popen[bytes]] = []
        self._given_up = False

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> 'Future[T]':
        return self._threads.submit(self._ask, fn, args, kwargs)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Let the workers end; at once where an exception leaves the context."""
        if kind is not None:
            self._given_up = True
            self._threads.shutdown(wait=False, cancel_futures=True)
            for process in self._started:
                process.terminate()
        self._threads.shutdown()
        for process in self._started:
            _close(process)

    def _ask(self, fn: Callable[..., T], args: Any, kwargs: Any) -> T:
        """Have a task done by the process of this thread."""
        process = getattr(self._of_thread, 'process', None)
        if process is None:
            process = self._of_thread.process = self._start()
        tasks, answers = _pipes(process)
        try:
            with open(tasks.fileno(), 'wb', closefd=False) as stdin:
                pickle.dump((fn, args, kwargs), stdin)
            with open(answers.fileno(), 'rb', closefd=False) as stdout:
                value, failure = pickle.load(stdout)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            # The next task gets another process.
            self._of_thread.process = None
            raise ImuAllanError(
                f'--jobs: the process that worked on {_first(args)} was ended from outside, '
                'perhaps for want of memory; try fewer jobs') from None
        if failure is not None:
            raise _raisable(*failure)
        answer: T = value
        return answer

    def _start(self) -> subprocess.Popen[bytes]:
        try:
            # In a session of its own, Ctrl-C does not reach it: it ends with its standard input.
            process = start_python(__name__, 'serve', stdout=subprocess.PIPE,
                                   start_new_session=True)
        except OSError as error:
            raise ImuAllanError(f'--jobs: no further process can be started ({error.strerror}); '
                                'try fewer jobs') from error
        self._started.append(process)
        if self._given_up:
            process.terminate()
        return process


def serve() -> None:
    """Be a worker process: do what comes on standard input until that is closed."""
    end_in_peace()
    answers = os.fdopen(os.dup(1), 'wb')
    # What a library might print must not get among the answers.
    os.dup2(2, 1)
    tasks: SimpleQueue[tuple[Callable[..., Any], Any, Any]] = SimpleQueue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    with suppress(SystemExit, BrokenPipeError):
        while True:
            function, args, kwargs = tasks.get()
            pickle.dump(_outcome(function, args, kwargs), answers)
            answers.flush()
    # Not by the usual way: a thread still reads standard input.
    os._exit(0)


def _receive(tasks: SimpleQueue[tuple[Callable[..., Any], Any, Any]]) -> None:
    """Hand on what comes; whoever sent it having ended, what is under way is given up."""
    with suppress(EOFError, pickle.UnpicklingError):
        while True:
            tasks.put(pickle.load(sys.stdin.buffer))
    os.kill(os.getpid(), signal.SIGTERM)


def _outcome(function: Callable[..., Any], args: Any, kwargs: Any) -> tuple[Any, Any]:
    try:
        return function(*args, **kwargs), None
    except Exception as error:
        return None, portable(error)


def _close(process: subprocess.Popen[bytes]) -> None:
    tasks, answers = _pipes(process)
    tasks.close()
    try:
        process.wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    answers.close()


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout


def _first(args: Any) -> str:
    tasks = args[0] if args and isinstance(args[0], list) else args
    return printable(tasks[0].path) if tasks and isinstance(tasks[0], Task) else 'it'
