# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Printed output: its width and tables, and the progress bar of long work.

The width is that of the terminal; output to a pipe is not wrapped or cut. The variable COLUMNS
overrides both, as it does for ``ls`` and ``ps``. The bar is on stderr, and removed at the end.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import os
import sys
from typing import Any, TextIO, TYPE_CHECKING

from imu_allan.errors import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table
    from rich.text import Text

_UNBROKEN = 10_000
"""Columns of a pipe, more than any printed line has."""


def console_of(to: TextIO | None = None) -> 'Console':
    """Return the console for a terminal, a pipe or a file; by default of standard output."""
    from rich.console import Console

    class Quiet(Console):
        def on_broken_pipe(self) -> None:
            # That of rich ends the program with status 1, which is that of an error.
            raise BrokenPipeError

        def print(self, *objects: Any, crop: bool = False,  # noqa: A003
                  **options: Any) -> None:
            # A table that is too wide is broken by the terminal, not cut.
            super().print(*objects, crop=crop, **options)

    console = Quiet(file=to, highlight=False)
    if not console.is_terminal and not os.environ.get('COLUMNS', '').isdigit():
        console.width = _UNBROKEN
    return console


def bare_table(*headings: 'str | Text', texts: int = 2) -> 'Table':
    """Return a borderless table that breaks no number; the first `texts` columns hold text."""
    from rich.table import Table

    class Whole(Table):
        def add_row(self, *cells: Any, **options: Any) -> None:
            # Half of a number is another number. Names, which may be long, are not strings here.
            super().add_row(*cells, **options)
            for column, cell in zip(self.columns, cells, strict=True):
                column.min_width = max([column.min_width or 0, *(
                    len(word) for text in (column.header, cell) if isinstance(text, str)
                    for word in text.split())])

    table = Whole(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for place, heading in enumerate(headings):
        table.add_column(heading, justify='left' if place < texts else 'right', overflow='fold')
    return table


def wrapped(texts: Iterable[str], width: int, style: str = 'default', indent: int = 2
            ) -> 'list[Text]':
    """Wrap texts at words, indent continuation lines, and keep intervals and units whole."""
    import re
    from textwrap import wrap

    from rich.text import Text

    whole = (r'(?<=\d) (?=[%A-Za-z])|(?<=\d h) (?=\d)|(?<=\d min) (?=\d)|'
             r'(?<= [BK]:) (?=\d)|(?<=\d) (?=\.\. )|(?<=\d \.\.) ')
    # Lines are not broken at a no-break space.
    return [Text(line.replace('\xa0', ' '), style=style) for text in texts for line in wrap(
        re.sub(whole, '\xa0', text), width, subsequent_indent=' ' * indent,
        break_on_hyphens=False)]


def print_wrapped(text: str) -> None:
    """Print a text on standard output, wrapped to the terminal."""
    console = console_of()
    console.print(*wrapped([text], console.width), sep='\n')


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
