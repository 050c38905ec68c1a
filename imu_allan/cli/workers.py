# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Several recordings and who works on them, in one module because all workers do the same task.

What to make of each, into which folder, and by whom. The work is done in this process, in others
of this machine or on a Dask cluster. Python's own process pools start their workers in a way that
imports from the current folder first, which may be a recording that somebody else made; those of
this module are isolated.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    Executor,
    Future,
    ThreadPoolExecutor,
    TimeoutError as FutureTimeout,
    wait,
)
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from itertools import count as naturals, groupby
import logging
from math import ceil
import os
from pathlib import Path
import pickle
from queue import SimpleQueue
import re
import signal
import subprocess
import sys
import threading
from typing import Any, IO, Literal, TYPE_CHECKING, TypeVar

from imu_allan.errors import ImuAllanError, printable
from imu_allan.isolated_process import end_in_peace, portable, start_python

if TYPE_CHECKING:
    from imu_allan.analysis import Opening
    from imu_allan.recordings import RecordingOptions
    from imu_allan.result import Inspection, Result

T = TypeVar('T')

ANSWER_S = 10.0
"""How long a scheduler may take to answer; one in the same building takes milliseconds."""
_PATIENCE_S = 15.0
"""How long a worker may take to remove what it unpacked; it waits 10 s for its own reader."""


@dataclass(frozen=True)
class Task:
    """
    One result to be made.

    Attributes
    ----------
    path : str
        The recording.
    topic : str or None
        None where the recording has one Imu topic.
    options : mapping
        Of `TimelineOptions`.
    start_s, duration_s : float
        The part to use; a duration of None means all the rest.
    size_bytes : int
        Of the recording, for progress.
    folder : Path or None
        Where to write the result.
    unit : str
        What the recording is called among others.
    inspection : mapping
        Of `Inspection`; empty where nothing was said.
    exports : tuple of str
        Consumers whose configurations are written into the folder.
    reading : RecordingOptions or None
        How the recording is to be read.
    together : tuple of str
        Recordings of one IMU that make one result; empty where it is one recording.

    """

    path: str
    topic: str | None
    options: Mapping[str, Any]
    start_s: float | Literal['auto']
    duration_s: float | None
    size_bytes: int
    folder: Path | None
    unit: str = ''
    inspection: Mapping[str, str] = field(default_factory=dict)
    exports: tuple[str, ...] = ()
    reading: 'RecordingOptions | None' = None
    together: tuple[str, ...] = ()

    def arguments(self) -> dict[str, Any]:
        """Return those of `imu_allan.analysis.analyze` and `said`, but the path."""
        from imu_allan.recordings import RecordingOptions
        from imu_allan.timeline import TimelineOptions

        return {'topic': self.topic, 'options': TimelineOptions(**self.options),
                'reading': self.reading or RecordingOptions(), 'start_s': self.start_s,
                'duration_s': self.duration_s}

    def said(self) -> dict[str, str]:
        """Return the options that a result made of it names."""
        from imu_allan.analysis import said

        return said(**self.arguments())

    def inspected(self) -> 'Inspection | None':
        """Return what a result made of it says of the unit."""
        from imu_allan.result import Inspection

        return Inspection(**self.inspection) if self.inspection else None


def characterize(task: Task, progress: Callable[[int], None] | None = None,
                 artist: Executor | None = None, opening: 'Opening | None' = None,
                 ) -> 'tuple[Result, ImuAllanError | None]':
    """
    Make the result of a task and write its folder: where the work is done, not one by one.

    Beside the result stands why the folder could not be written, where it could not.

    Parameters
    ----------
    task : Task
        What to do.
    progress : callable, optional
        As for `analyze`.
    artist : Executor, optional
        Draws the picture meanwhile.
    opening : callable, optional
        As for `analyze`.

    """
    from imu_allan.analysis import analyze

    drawing = None
    if task.folder is not None and artist is not None:
        drawing = partial(_drawn, artist)
    result = analyze(list(task.together) or task.path, progress=progress, opening=opening,
                     **task.arguments())
    if task.inspection:
        result = replace(result, inspection=task.inspected())
    if task.folder is not None:
        from imu_allan.writers.folder import save_folder
        from imu_allan.writers.folder_lock import turn_in
        try:
            with turn_in(task.folder):
                save_folder(result, task.folder, task.exports, drawing=drawing)
        except ImuAllanError as error:
            return result, error
    return result, None


def _drawn(artist: Executor, result: 'Result') -> Callable[[], bytes]:
    """Have the picture of a result drawn; return what waits for it."""
    from imu_allan.writers.plot import overview_png

    drawn = artist.submit(overview_png, result)

    def picture() -> bytes:
        # While it waits: what prints the result afterwards.
        import_module('imu_allan.writers.table')
        import_module('rich.console')
        try:
            return drawn.result()
        except ImuAllanError:
            # No process could be started, or it was ended from outside.
            return overview_png(result)

    return picture


# ------------------------------------------------------------------------------- into which folder

def folder_names(recordings: Sequence[tuple[str, str | None]],
                 units: Mapping[str, str] | None = None) -> list[str]:
    """
    Name a folder after each recording and topic, every name once.

    Parameters
    ----------
    recordings : sequence of (str, str or None)
        Path and topic. Nothing in a topic's name leads out of the folder above, and no name is
        longer than a file system takes.
    units : mapping of str to str, optional
        What the unit of each path is called; the recording's own name by default.

    """
    from imu_allan.fleet.names import unit_name

    taken: set[str] = set()
    numbers: dict[str, Iterator[int]] = {}
    stems = units or {path: unit_name(path) for path in {path for path, _ in recordings}}
    names = []
    for path, topic in recordings:
        first = name = _folder_name(stems[path], topic)
        # Where capitals count for nothing, two names that differ in them are one folder.
        while name.casefold() in taken:
            name = f'{first}-{next(numbers.setdefault(first.casefold(), naturals(2)))}'
        taken.add(name.casefold())
        names.append(name)
    return names


def _folder_name(stem: str, topic: str | None) -> str:
    name = stem if topic is None else f'{stem}_{topic.strip("/")}'
    name = re.sub(r'[^\w.-]+', '_', name).lstrip('.')
    # Bytes of a folder's name; file systems take 255, and a number may have to be added.
    return name.encode()[:200].decode(errors='ignore') or 'recording'


# -------------------------------------------------------------------------------------- by whom

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
        with _dask_client(dask) as client:
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


@contextmanager
def _dask_client(address: str) -> Iterator[Any]:
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
            # What is no scheduler may send anything, and the library then raises anything.
            answer.set_exception(error)

    # The library's own timeout does not end a wait for a peer that takes the connection and then
    # says nothing. A thread that may be left behind must not keep the process alive.
    threading.Thread(target=connect, daemon=True).start()
    loggers = [logging.getLogger(name) for name in ('distributed', 'tornado', 'asyncio')]
    levels = [logger.level for logger in loggers]
    try:
        # Their tracebacks tell what a stranger sent; the line below says enough.
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        client = answer.result(2 * ANSWER_S)
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
    except FutureTimeout:
        raise ImuAllanError(f'--dask {address}: what listens there does not answer as a '
                            'scheduler; start one with: dask scheduler') from None
    except (OSError, ValueError) as error:
        raise ImuAllanError(f'--dask {address}: no scheduler answers ({error}); start one with: '
                            'dask scheduler') from error
    except Exception as error:
        raise ImuAllanError(f'--dask {address}: what listens there is no scheduler '
                            f'({type(error).__name__}); start one with: dask scheduler') from error
    with client:
        yield client
