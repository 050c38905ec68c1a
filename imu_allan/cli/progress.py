# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The progress bar of long work: on a terminal only, on stderr, gone when the work is done."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys


@contextmanager
def progress_bar(label: str, total: int, *, wanted: bool = True,
                 in_bytes: bool = True) -> Iterator[Callable[[int], None]]:
    """
    Show how far the work is and when it will be done.

    Parameters
    ----------
    label : str
        What is being worked on; anything a terminal would obey must have been escaped.
    total : int
        Amount of work.
    wanted : bool, optional
        False never shows a bar.
    in_bytes : bool, optional
        Whether the amounts are bytes.

    Yields
    ------
    callable
        To be called with the amount done so far.

    """
    if not wanted or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = [TextColumn('{task.description}', markup=False), BarColumn(), TaskProgressColumn()]
    if in_bytes:
        columns.append(DownloadColumn())
    columns.append(TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(label, total=total)
        yield lambda done: progress.update(task, completed=done)
