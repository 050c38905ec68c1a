# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Progress bar for long work: on stderr, only on a terminal, and removed at the end."""

from collections.abc import Iterator
from contextlib import contextmanager
import sys
from typing import TYPE_CHECKING

from imu_allan.errors import printable

if TYPE_CHECKING:
    from rich.progress import Progress


class ProgressBar:
    """A progress bar or none, called with the amount done so far."""

    def __init__(self, bar: 'Progress | None' = None) -> None:
        self._bar = bar

    def __call__(self, done: int) -> None:
        """Show how much is done."""
        if self._bar is not None:
            [task] = self._bar.tasks
            # Topics that are read side by side count apart.
            self._bar.update(task.id, completed=max(done, task.completed))

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Remove the bar from the terminal while something else is written there."""
        if self._bar is not None:
            self._bar.stop()
        try:
            yield
        finally:
            if self._bar is not None:
                self._bar.start()


@contextmanager
def progress_bar(label: object, total: int, *, wanted: bool = True,
                 in_bytes: bool = True) -> Iterator[ProgressBar]:
    """Show progress and remaining time, only if `wanted` and on a terminal."""
    if not wanted or not sys.stderr.isatty():
        yield ProgressBar()
        return
    from rich import progress as rich
    from rich.console import Console

    columns = [rich.TextColumn('{task.description}', markup=False), rich.BarColumn(),
               rich.TaskProgressColumn(), *([rich.DownloadColumn()] if in_bytes else []),
               rich.TimeRemainingColumn()]
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(printable(label), total=total)
        yield ProgressBar(progress)
