# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Make results of recordings, in this process, in others of this machine, or on a Dask cluster.

The processes are not those of `concurrent.futures`, which import from the current folder first.
That folder may be a recording from somebody else. Moreover, if one of those processes is killed
for lack of memory, the results of all others are lost.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
import os
from pathlib import Path
import pickle
import signal
import subprocess
import sys
import threading
from typing import Any, TYPE_CHECKING, TypeVar

from imu_allan.errors import ImuAllanError, printable
from imu_allan.isolated_process import pipes_of, portable, start_python, to_parent, wait_for
from imu_allan.process import start_quickly

if TYPE_CHECKING:
    from distributed import Client
    from imu_allan.analysis import Choice
    from imu_allan.result import Result

T = TypeVar('T')


@dataclass(frozen=True)
class Task:
    """
    One result to be made.

    Attributes
    ----------
    paths : tuple of str
        The recording; several of one IMU give one joint result.
    choice : Choice
        Which part of it is used, and how it is read.
    size_bytes : int
        Size of the recording, for progress.
    folder : Path or None
        Where to write the result.
    unit : str
        Name of the recording among others.
    inspection : mapping of str to str
        What the result states about the unit.
    exports : tuple of str
        Consumers whose configurations are written into the folder.

    """

    paths: tuple[str, ...]
    choice: 'Choice'
    size_bytes: int
    folder: Path | None
    unit: str
    inspection: Mapping[str, str]
    exports: tuple[str, ...]

    @property
    def path(self) -> str:
        """Return the recording, or all of them."""
        return ' + '.join(self.paths)


def characterize(task: Task, progress: Callable[[int], None] | None = None
                 ) -> 'tuple[Result, ImuAllanError | None]':
    """
    Make the result of a task and write its folder, so that workers write their folders themselves.

    Return the result, and the error if the folder could not be written.
    """
    # Workers, which report no progress, leave no core idle.
    beside = progress is not None and task.folder is not None and (os.cpu_count() or 1) > 1
    with WorkerProcesses(1) if beside else nullcontext() as drawing:
        if drawing is not None:
            drawing.submit(_prepare_to_draw)
        from imu_allan.analysis import analyzed
        from imu_allan.result import Inspection

        result = analyzed(task.paths[0] if len(task.paths) == 1 else task.paths, task.choice,
                          progress)
        if task.inspection:
            result = replace(result, inspection=Inspection(**task.inspection))
        if task.folder is not None:
            from imu_allan.writers.result_files import save_folder
            try:
                save_folder(result, task.folder, task.exports,
                            drawn=None if drawing is None else _drawn(drawing, result))
            except ImuAllanError as error:
                return result, error
    return result, None


def _prepare_to_draw() -> None:
    """Import what draws a picture, which takes as long as drawing it."""
    import imu_allan.writers.plot  # noqa: F401
    import matplotlib.backends.backend_agg
    import matplotlib.figure  # noqa: F401


def _drawn(drawing: Executor, result: 'Result') -> Callable[[], bytes]:
    """Begin to draw the picture of a result; return a function that waits for it."""
    from imu_allan.writers.plot import overview_png

    picture = drawing.submit(overview_png, result)

    def wait() -> bytes:
        try:
            return picture.result()
        except ImuAllanError:
            # No process could be started, or it was ended from outside.
            return overview_png(result)

    return wait


@contextmanager
def executor(jobs: int, dask: str | None) -> Iterator[Executor | None]:
    """Yield an executor of `jobs` processes or of a Dask cluster, or None to use this process."""
    if dask is not None:
        with _dask_client(dask) as client:
            yield client.get_executor(pure=False)
    elif jobs > 1:
        with WorkerProcesses(jobs) as workers:
            yield workers
    else:
        yield None


def _dask_client(address: str) -> 'Client':
    try:
        from distributed import Client
    except ImportError:
        raise ImuAllanError('--dask: the package distributed is not installed; '
                            "pip install 'imu_allan[fleet]'") from None
    try:
        # One in the same building answers within milliseconds.
        return Client(  # type: ignore[no-untyped-call]
            address, timeout=10.0, set_as_default=False)
    except Exception as error:
        # A peer that is no scheduler may send anything, so the library may raise anything.
        raise ImuAllanError(f'--dask {address}: no scheduler answers ({error}); start one with: '
                            'dask scheduler') from error


def in_order(workers: Executor | None, tasks: Sequence[Task], progress: Callable[[int], None]
             ) -> 'Iterator[tuple[Task, Callable[[], tuple[Result, ImuAllanError | None]]]]':
    """Work on all tasks; yield each in order, with a function that gives its result or raises."""
    from imu_allan.analysis import offset_progress

    waiting = deque((task, None if workers is None else workers.submit(characterize, task))
                    for task in tasks)
    done_bytes = 0
    while waiting:
        task, future = waiting.popleft()
        if future is None:
            # In this process, Ctrl-C and progress need no communication.
            yield task, partial(characterize, task, offset_progress(progress, done_bytes))
            done_bytes += task.size_bytes
        else:
            future.exception()
            done_bytes += task.size_bytes
            progress(done_bytes)
            yield task, future.result


class WorkerProcesses(ThreadPoolExecutor):
    """Executor whose threads have each task done by a process of this machine."""

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs)
        self._of_thread = threading.local()
        self._started: list[subprocess.Popen[bytes]] = []
        self._given_up = False

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> 'Future[T]':
        return super().submit(self._ask, partial(fn, *args, **kwargs))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Let the workers end, at once if an exception leaves the context."""
        if kind is not None:
            self._given_up = True
            self.shutdown(wait=False, cancel_futures=True)
            for process in self._started:
                process.terminate()
        self.shutdown()
        for process in self._started:
            tasks, answers = pipes_of(process)
            tasks.close()
            # It may have to remove unpacked files, and waits 10 s for its own reader.
            wait_for(process, 15.0)
            answers.close()

    def _ask(self, work: 'partial[T]') -> T:
        """Run a task in the process of this thread, and raise its error."""
        process = getattr(self._of_thread, 'process', None)
        if process is None:
            process = self._of_thread.process = self._start()
        tasks, answers = pipes_of(process)
        try:
            with open(tasks.fileno(), 'wb', closefd=False) as stdin:
                pickle.dump(work, stdin)
            with open(answers.fileno(), 'rb', closefd=False) as stdout:
                done: T
                done, failure = pickle.load(stdout)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            # The next task gets another process.
            self._of_thread.process = None
            task = work.args[0]
            raise ImuAllanError(
                '--jobs: the process that worked on '
                f'{printable(task.path) if isinstance(task, Task) else "it"} was ended from '
                'outside, perhaps for want of memory; try fewer jobs') from None
        if failure is None:
            return done
        error, where = failure
        if not isinstance(error, (ImuAllanError, OSError)):
            error.__cause__ = RuntimeError(f'in a worker process:\n{where}')
        raise error

    def _start(self) -> subprocess.Popen[bytes]:
        try:
            process = start_python(__name__, 'serve')
        except OSError as error:
            raise ImuAllanError(f'--jobs: no further process can be started ({error.strerror}); '
                                'try fewer jobs') from error
        self._started.append(process)
        if self._given_up:
            process.terminate()
        return process


def serve() -> None:
    """Run a worker process, which executes what comes on standard input until that is closed."""
    answers = to_parent()
    start_quickly()
    with suppress(EOFError, BrokenPipeError, pickle.UnpicklingError):
        while True:
            work = pickle.load(sys.stdin.buffer)
            answer: tuple[Any, tuple[Exception, str] | None]
            try:
                answer = work(), None
            except Exception as error:
                answer = None, portable(error)
            pickle.dump(answer, answers)
            answers.flush()
    # Linux sends SIGTERM as soon as the thread ends that started this process, which is exiting.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
