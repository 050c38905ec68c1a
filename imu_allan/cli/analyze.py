# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Characterize one or more recordings."""

import argparse
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, count as naturals
from pathlib import Path
import re
import signal
import sys
from typing import Any, TYPE_CHECKING, TypeVar

from imu_allan.cli.arguments import count, duration, moment, positive_number
from imu_allan.cli.progress import progress_bar
from imu_allan.errors import ImuAllanError, printable

if TYPE_CHECKING:
    from imu_allan.result import Result

T = TypeVar('T')


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'analyze', help='characterize recordings',
        description='Allan deviation and noise coefficients of every axis, from recordings of '
                    'an IMU at rest: a rosbag2 folder (sqlite3 or MCAP), a bare .mcap or .db3, '
                    'a ROS 1 .bag, or a CSV.')
    parser.add_argument('recordings', metavar='RECORDING', nargs='+')
    topics = parser.add_mutually_exclusive_group()
    topics.add_argument('--topic', metavar='NAME',
                        help='the Imu topic; may be left out where there is only one')
    topics.add_argument('--all-topics', action='store_true', help='every Imu topic in turn')
    parser.add_argument('--output', metavar='DIR',
                        help='write result.json, curve.csv, allan_deviation.png and report.html '
                             'here; with several recordings or topics, into a folder for each')
    parser.add_argument('--json', metavar='FILE', help='write the result file of one recording')
    parser.add_argument('--rate', metavar='HZ', type=positive_number,
                        help='sample rate, instead of the one measured from the stamps; needed '
                             'for a CSV without a time column')
    parser.add_argument('--force-rate', action='store_true',
                        help='use --rate even if the stamps advance at another rate')
    parser.add_argument('--clock', choices=('header', 'receive'),
                        help='stamps to trust (default: header, unless they are unusable)')
    parser.add_argument('--start', metavar='TIME', type=moment, default=0.0,
                        help='leave out the beginning, as long as this (10 or 10s, 5min, 2h)')
    parser.add_argument('--duration', metavar='TIME', type=duration,
                        help='use only as much (30min, 3h)')
    parser.add_argument('--motion', choices=('exclude', 'keep'), default='exclude',
                        help='what to do with knocks and motion (default: %(default)s)')
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument('--jobs', metavar='N', type=count, default=1,
                         help='recordings to work on at a time (default: %(default)s)')
    workers.add_argument('--dask', metavar='ADDRESS',
                         help='work on a running Dask cluster, for instance tcp://host:8786')
    parser.add_argument('--no-progress', action='store_true', help='show no progress bar')
    parser.set_defaults(run=run, parser=parser)


@dataclass(frozen=True)
class _Task:
    """One result to be made."""

    path: str
    topic: str | None
    options: Mapping[str, Any]
    start_s: float
    duration_s: float | None
    size_bytes: int
    folder: Path | None


def run(args: argparse.Namespace) -> int:
    """Characterize every recording; each result is shown once it and those before it are done."""
    if args.json is not None and len(args.recordings) > 1:
        args.parser.error('--json takes one recording; use --output DIR for several')
    if args.force_rate and args.rate is None:
        args.parser.error('--force-rate needs --rate')
    complaints: list[ImuAllanError] = []
    tasks = _tasks(args, complaints)
    if args.json is not None and len(tasks) > 1:
        raise ImuAllanError(f'{args.recordings[0]}: has {len(tasks)} Imu topics, too many for '
                            '--json; choose one with --topic or use --output DIR')
    label = printable(tasks[0].path if len(tasks) == 1 else f'{len(tasks)} recordings')
    with progress_bar(label, sum(task.size_bytes for task in tasks),
                      wanted=not args.no_progress) as progress, \
            _executor(args.jobs, args.dask) as executor:
        for shown, (task, future) in enumerate(_in_order(executor, tasks, progress)):
            try:
                result = future.result()
            except ImuAllanError as error:
                complaints.append(error)
                continue
            _hand_out(result, task.folder, args.json, first=not shown)
    for complaint in complaints[:-1]:
        print(f'imu_allan: {printable(complaint)}', file=sys.stderr)
    if complaints:
        raise complaints[-1]
    return 0


def _tasks(args: argparse.Namespace, complaints: list[ImuAllanError]) -> list[_Task]:
    from imu_allan.recordings import open_recording

    options = {'clock': args.clock or 'auto', 'rate_hz': args.rate,
               'force_rate': args.force_rate, 'motion': args.motion}
    found: list[tuple[str, str | None, int]] = []
    for path in args.recordings:
        try:
            with open_recording(path, rate_hz=args.rate) as recording:
                topics: list[str | None] = [args.topic] if not args.all_topics else [
                    topic.name for topic in recording.topics] or [None]
                found.extend((path, topic, recording.size_bytes) for topic in topics)
        except ImuAllanError as error:
            complaints.append(error)
    output = None if args.output is None else Path(args.output)
    names = _distinct([_folder_name(path, topic) for path, topic, _ in found])
    return [
        _Task(path, topic, options, args.start, args.duration, size,
              None if output is None else output if len(found) == 1 else output / name)
        for (path, topic, size), name in zip(found, names, strict=True)]


def _folder_name(path: str, topic: str | None) -> str:
    """Name a folder after a recording; nothing in a topic's name leads out of its parent."""
    resolved = Path(path).resolve()
    name = resolved.name if resolved.is_dir() else resolved.stem
    if topic is not None:
        name += '_' + topic.strip('/')
    return re.sub(r'[^\w.-]+', '_', name).lstrip('.') or 'recording'


def _distinct(names: list[str]) -> list[str]:
    taken: list[str] = []
    for name in names:
        candidates = chain([name], (f'{name}-{number}' for number in naturals(2)))
        taken.append(next(candidate for candidate in candidates if candidate not in taken))
    return taken


def _characterize(task: _Task, progress: Callable[[int], None] | None = None) -> 'Result':
    from imu_allan.analysis import analyze
    from imu_allan.timeline import TimelineOptions

    return analyze(task.path, task.topic, options=TimelineOptions(**task.options),
                   start_s=task.start_s, duration_s=task.duration_s, progress=progress)


def _hand_out(result: 'Result', folder: Path | None, json: str | None, *, first: bool) -> None:
    from imu_allan.writers.result_file import save_result
    from imu_allan.writers.table import print_result

    if json is not None:
        save_result(result, json)
    if folder is not None:
        from imu_allan.writers.folder import save_folder
        save_folder(result, folder)
    if not first:
        print()
    print_result(result)
    sys.stdout.flush()


def _in_order(executor: Executor, tasks: list[_Task],
              progress: Callable[[int], None]) -> 'Iterator[tuple[_Task, Future[Result]]]':
    """Submit every task; yield each with its finished future, in the order of `tasks`."""
    waiting: deque[tuple[_Task, Future[Result]]] = deque()
    done_bytes = 0
    for task in tasks:
        if isinstance(executor, _InThisProcess):
            future = executor.submit(_characterize, task,
                                     lambda done, before=done_bytes: progress(before + done))
        else:
            future = executor.submit(_characterize, task)
        waiting.append((task, future))
        while waiting and waiting[0][1].done():
            done_bytes += waiting[0][0].size_bytes
            yield waiting.popleft()
    while waiting:
        wait([waiting[0][1]])
        done_bytes += waiting[0][0].size_bytes
        progress(done_bytes)
        yield waiting.popleft()


class _InThisProcess(Executor):
    """Works at the moment of submission, so that Ctrl-C and progress need no messenger."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> 'Future[T]':
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def _executor(jobs: int, dask: str | None) -> Iterator[Executor]:
    """Where the work is done: here, in processes of this machine, or on a Dask cluster."""
    if dask is not None:
        with _dask_client(dask) as client:
            yield client.get_executor(pure=False)
    elif jobs == 1:
        yield _InThisProcess()
    else:
        with _processes(jobs) as executor:
            yield executor


@contextmanager
def _processes(jobs: int) -> Iterator[Executor]:
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    import multiprocessing

    executor = ProcessPoolExecutor(jobs, multiprocessing.get_context('spawn'), _die_of_sigint)
    try:
        yield executor
    except BrokenProcessPool:
        raise ImuAllanError('--jobs: a worker process was ended from outside, perhaps for want '
                            'of memory; try fewer jobs') from None
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    executor.shutdown()


def _die_of_sigint() -> None:
    # Ctrl-C reaches the whole process group: the workers end without a word of their own.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def _dask_client(address: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ImportError:
        raise ImuAllanError('--dask: the package distributed is not installed; '
                            "pip install 'imu_allan[fleet]'") from None
    try:
        client = Client(  # type: ignore[no-untyped-call]
            address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ImuAllanError(f'--dask {address}: no scheduler answers ({error}); start one with: '
                            'dask scheduler') from error
    with client:
        yield client
