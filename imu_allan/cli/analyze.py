# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Characterize one or more recordings."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import sys
import traceback
from typing import Any, TYPE_CHECKING

from imu_allan.cli import arguments
from imu_allan.cli.workers import executor, in_order, Task
from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.process import raise_if_interrupted
from imu_allan.writers.atomic import (
    kinds_of_files,
    require_replaceable_in,
    require_writable,
    RESULT,
)
from imu_allan.writers.terminal import console_of, print_wrapped, progress_bar

if TYPE_CHECKING:
    from imu_allan.analysis import Choice
    from imu_allan.result import Result


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'analyze', help='characterize recordings', usage='%(prog)s RECORDING... [options]',
        short='topic all-topics output together for rate start duration columns jobs '
              'units verbose',
        examples=('analyze imu_at_rest --output out',
                  'analyze day1.mcap day2.mcap --together --start 5m --output out',
                  'analyze log.csv --rate 200Hz --columns gyro_x=w0,gyro_y=w1,gyro_z=w2'),
        description='Allan deviation and noise coefficients of every axis, from recordings of '
                    'an IMU at rest. It reads rosbag2 folders (sqlite3 or MCAP), bare .mcap and '
                    '.db3, ROS 1 .bag, PX4 .ulg, ArduPilot .bin and CSV. A folder holds several, '
                    'or a CSV for each sensor of a phone.')
    parser.add_argument('recordings', metavar='RECORDING', nargs='+', help='file or folder')
    topics = parser.add_mutually_exclusive_group()
    topics.add_argument('--topic', metavar='NAME',
                        help='the Imu topic; may be left out where there is only one')
    topics.add_argument('--all-topics', action='store_true', help='every Imu topic in turn')
    parser.add_argument('-o', '--output', metavar='DIR',
                        help='folder for result.json, curve.csv, allan_deviation.png and '
                             'report.html; of several recordings or topics a folder each, with '
                             'fleet.html, fleet.csv and fleet.json')
    parser.add_argument('--together', action='store_true',
                        help='the recordings are of one IMU: one result by their joint '
                             'likelihood, with the turn-on bias')
    parser.add_argument('--name-from', choices=('file', 'folder'), default='file',
                        help='what names a unit: its file, or the folder in which it lies '
                             '(default: %(default)s)')
    arguments.add_inspection(parser)
    parser.add_argument('--json', metavar='FILE',
                        help='write the result file of one recording; - prints it')
    parser.add_argument('--for', dest='consumers', metavar='NAME', action='append', default=[],
                        type=arguments.consumer,
                        help='configuration of a filter, too (imu_allan export --list names '
                             'them; may be repeated): into --output DIR, or to stdout, and the '
                             'table to stderr')
    parser.add_argument('--units', choices=('datasheet', 'si'), default='datasheet',
                        help='of the table (default: %(default)s)')
    parser.add_argument('--verbose', action='store_true',
                        help='findings in full, and terms that no axis shows')
    arguments.add_recording_options(parser)
    arguments.add_timeline_options(parser)
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument('--jobs', metavar='N', type=arguments.count, default=1,
                         help='recordings to work on at a time (default: %(default)s)')
    workers.add_argument('--dask', metavar='ADDRESS',
                         help='work on a running Dask cluster, for instance tcp://host:8786')
    parser.set_defaults(run=run, inputs=('recordings',), outputs={'json': RESULT, 'output': ''})


def run(args: argparse.Namespace) -> int:
    """Characterize every recording; show each result once it and all earlier ones are done."""
    from imu_allan.recordings import recordings_in

    choice, given = arguments.choice_of(args), args.recordings
    args.recordings = [str(path) for folder in given
                       for path in recordings_in(folder, choice.reading)]
    apart = len(args.recordings) > 1 and not args.together
    of_one = ('--json' if args.json is not None
              else '--for' if args.consumers and args.output is None else None)
    _require_right_usage(args, apart, of_one)
    output = None if args.output is None else Path(args.output)
    gathering = FleetResults(output)
    tasks = _tasks(args, choice, output, gathering)
    _require_own_folder([*given, *args.recordings], [output, *(task.folder for task in tasks)])
    if len(tasks) > 1 and of_one:
        raise ImuAllanError(f'{args.recordings[0]}: has {len(tasks)} Imu topics, too many for '
                            f'{of_one}; choose one with --topic or use --output DIR')
    # The workers of a cluster may see another disk.
    if args.dask is None and tasks:
        _require_room(args, tasks)
    shown = 0
    label = tasks[0].path if len(tasks) == 1 else f'{len(tasks)} recordings'
    with progress_bar(label, sum(task.size_bytes for task in tasks),
                      wanted=not args.no_progress) as progress, \
            executor(args.jobs, args.dask) as workers:
        for task, outcome in in_order(workers, tasks, progress):
            try:
                result, unsaved = outcome()
            except Exception as error:
                raise_if_interrupted()
                if not apart and not isinstance(error, ImuAllanError):
                    raise
                gathering.fail(task.unit, task.path, error)
                continue
            gathering.add(task, result)
            with progress.aside():
                # Up to seven topics of a recording get a table each, more get a line each.
                _hand_out(task, result, args, first=not shown, brief=apart or len(tasks) > 7)
            shown += 1
            if unsaved is not None:
                gathering.complaints.append(unsaved)
            elif task.folder is not None and len(tasks) == 1:
                print_wrapped(f'Written to {printable(str(task.folder))}: '
                              f'{", ".join(kinds_of_files(task.exports))}')
            from imu_allan.fleet import shows_anything
            from imu_allan.writers.key_figures import verdict_lines

            if not shows_anything(result):
                topic = task.choice.topic if args.all_topics else None
                where = task.path if topic is None else f'{task.path}, topic {shorten(topic)}'
                gathering.complaints.append(ImuAllanError(
                    f'{where}: no coefficient. {" ".join(verdict_lines(result))}'))
    try:
        gathering.finish()
    except ImuAllanError as error:
        gathering.complaints.append(error)
    if shown and args.output is args.json is None and not args.consumers:
        print_wrapped('Nothing is saved: --output DIR keeps result, report, plot and curve.')
    raise_last(gathering.complaints)
    return 0


def _require_right_usage(args: argparse.Namespace, apart: bool, of_one: str | None) -> None:
    """End the program if options contradict; `apart` means several results, `of_one` one."""
    if args.together and (len(args.recordings) < 2 or args.all_topics):
        args.parser.error('--together takes several recordings of one topic')
    if apart and of_one:
        args.parser.error(f'{of_one} takes one recording; use --output DIR for several')
    if apart and 'serial' in dict(args.meta):
        args.parser.error('--meta serial is of one unit; several are named by --name-from')


def _require_own_folder(recordings: Sequence[str], outputs: Sequence[Path | None]) -> None:
    """Raise ImuAllanError if an output folder is a recording, or a folder of recordings."""
    for folder in filter(None, outputs):
        # With a result in it, a folder of CSV files would be taken for that of the result.
        if folder.is_dir() and any(folder.samefile(path) for path in recordings
                                   if Path(path).exists()):
            raise ImuAllanError(f'--output: would write into {printable(folder)}, which is a '
                                'recording of this command; name another folder')


def _tasks(args: argparse.Namespace, choice: 'Choice', output: Path | None,
           gathering: 'FleetResults') -> list[Task]:
    """Return the tasks; recordings that cannot be opened have failed."""
    from imu_allan.recordings import open_recording
    from imu_allan.wording import distinct_names, unit_names

    units = unit_names(args.recordings, by_folder=args.name_from == 'folder')
    found: list[tuple[str, str, str | None, int]] = []
    for path, unit in zip(args.recordings, units, strict=True):
        try:
            with open_recording(path, options=choice.reading) as recording:
                topics: list[str | None] = [args.topic] if not args.all_topics else [
                    topic.name for topic in recording.topics] or [None]
                found.extend((path, unit, topic, recording.size_bytes) for topic in topics)
        except ImuAllanError as error:
            if args.together:
                # A joint result must not leave out a recording silently.
                raise
            gathering.fail(unit, path, error)
    of_all = dict(args.meta), tuple(args.consumers)
    if args.together:
        return [Task(tuple(args.recordings), choice, sum(size for *_, size in found), output,
                     'together', *of_all)]
    names = distinct_names(unit if topic is None else f'{unit}_{topic.strip("/")}'
                           for _, unit, topic, _ in found)
    alone = len(found) == 1 == len(units)
    return [Task((path,), replace(choice, topic=topic), size,
                 output if output is None or alone else output / name, name, *of_all)
            for (path, _, topic, size), name in zip(found, names, strict=True)]


def _require_room(args: argparse.Namespace, tasks: Sequence[Task]) -> None:
    """Raise ImuAllanError if an output cannot be written, before any work is done."""
    if args.json is not None and not Path(args.json).exists():
        require_writable(Path(args.json).parent)
    if args.output is not None:
        require_writable(args.output)
        for task in tasks:
            require_replaceable_in(task.folder or args.output, kinds_of_files(task.exports))


def _hand_out(task: Task, result: 'Result', args: argparse.Namespace, *, first: bool,
              brief: bool) -> None:
    """Print a result, whose folder has been written already."""
    from imu_allan.writers.filters import export
    from imu_allan.writers.key_figures import verdict_lines
    from imu_allan.writers.result_files import save_result
    from imu_allan.writers.table import result_table

    try:
        if args.json is not None:
            save_result(result, args.json)
    finally:
        # If it cannot be written, the result is printed all the same.
        configurations = [] if task.folder is not None else [
            export(result, consumer) for consumer in args.consumers]
        table = sys.stderr if configurations else sys.stdout
        if brief:
            print(f'{task.unit}: {" ".join(verdict_lines(result))}')
        else:
            if not first:
                print(file=table)
            console = console_of(table)
            console.print(result_table(
                result, console.width, si=args.units == 'si', verbose=args.verbose))
        table.flush()
        print('\n'.join(configurations), end='')
        sys.stdout.flush()


class FleetResults:
    """Collects the results of many recordings, without the parts that a fleet does not need."""

    def __init__(self, output: Path | None) -> None:
        self.complaints: list[ImuAllanError] = []
        self._output = output
        self._results: dict[str, Result] = {}
        self._failures: list[tuple[str, str, str]] = []
        self._means: dict[tuple[float, ...], str] = {}

    def add(self, task: Task, result: 'Result') -> None:
        """Add a result; one from the same messages as an earlier one counts as a failure."""
        # Two recordings never have the same means to the last digit, except on dead axes.
        means = tuple(axis.mean for axis in result.axes.values()
                      if axis.mean is not None and not axis.constant)
        if means and (other := self._means.setdefault(means, task.unit)) != task.unit:
            from imu_allan.analysis import same_messages_error

            self._failures.append((task.unit, task.path,
                                   str(same_messages_error(other, task.unit))))
            return
        # Signal and spectrum are most of a result; those of a thousand would fill the memory.
        axes = {name: replace(axis, signal=None, spectrum=None, stationarity=None)
                for name, axis in result.axes.items()}
        self._results[task.unit] = replace(result, axes=axes)

    def fail(self, unit: str, path: str, error: BaseException) -> None:
        """Add a recording that has failed; print the traceback of an unexpected error."""
        if not isinstance(error, ImuAllanError):
            traceback.print_exception(error)
            sys.stderr.flush()
            error = ImuAllanError(f'{path}: an unexpected {type(error).__name__} ({error}); '
                                  'the traceback above shows a bug, please report it')
        self.complaints.append(error)
        self._failures.append((unit, path, str(error)))

    def finish(self) -> None:
        """Print the table of all units, and write the files of the fleet if there is a folder."""
        if len(self._results) + len(self._failures) < 2:
            return
        from imu_allan.writers.fleet import Failure, Fleet, population_table, save_fleet

        fleet = Fleet(self._results, tuple(Failure(*failure) for failure in self._failures),
                      folders=True)
        console = console_of()
        console.print('', population_table(fleet, console.width), sep='\n')
        if self._output is not None:
            paths = save_fleet(fleet, self._output)
            names = ', '.join(path.name for path in reversed(paths))
            print_wrapped(f'Written to {printable(str(self._output))}: {names}; a folder for each '
                          'unit')


def raise_last(complaints: Sequence[ImuAllanError]) -> None:
    """Print why recordings failed, one line each; raise the last error to end the command."""
    sys.stdout.flush()
    for complaint in complaints[:-1]:
        print(f'imu_allan: {printable(complaint)}', file=sys.stderr)
    if complaints:
        raise complaints[-1]
