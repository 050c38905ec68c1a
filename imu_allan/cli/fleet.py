# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Several recordings as a fleet: their results as they come in, and their errors."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import sys
import traceback
from typing import TYPE_CHECKING

from imu_allan.cli.workers import Task
from imu_allan.errors import ImuAllanError, printable

if TYPE_CHECKING:
    from imu_allan.result import Result


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
        from imu_allan.writers.terminal import console_of, print_wrapped

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
