# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How wide what we write is: as wide as the terminal; in a pipe nothing is broken or cut.

The variable COLUMNS holds for both, as it does for ``ls`` and ``ps``.
"""

from collections.abc import Iterable, Iterator
import os
import sys
from typing import TextIO, TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

_UNBROKEN = 10_000
"""Columns of a pipe: more than any line of ours has."""


def console_of(to: TextIO | None = None) -> 'Console':
    """
    Return the console for a terminal, a pipe or a file.

    Standard output by default.
    """
    from rich.console import Console

    console = Console(file=to, highlight=False)
    if not console.is_terminal and _stated() is None:
        console.width = _UNBROKEN
    return console


def bare_table(*headings: 'str | Text', texts: int = 2) -> 'Table':
    """Return a table without lines, to have room at 60 columns; `texts` columns are no numbers."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for place, heading in enumerate(headings):
        table.add_column(heading, justify='left' if place < texts else 'right',
                         overflow='fold')
    return table


def wrapped(texts: Iterable[str], width: int, style: str = 'default') -> 'Iterator[Text]':
    """Yield lines that are whole words, those after the first set in; no number ends one."""
    import re
    from textwrap import wrap

    from rich.text import Text

    for text in texts:
        # Nothing is broken at such a space.
        joined = re.sub(r'(?<=\d) (?=[%A-Za-z])|(?<=\d h) (?=\d)|(?<=\d min) (?=\d)|'
                        r'(?<= [BK]:) (?=\d)', '\xa0', text)
        for line in wrap(joined, width, subsequent_indent='  ', break_on_hyphens=False):
            yield Text(line.replace('\xa0', ' '), style=style)


def columns_of(to: TextIO | None = None) -> int | None:
    """
    Return where lines that are printed without a console have to end.

    None in a pipe, which gets its lines whole.
    """
    stated = _stated()
    if stated is not None:
        return stated
    file = sys.stdout if to is None else to
    try:
        return os.get_terminal_size(file.fileno()).columns or None if file.isatty() else None
    except (OSError, ValueError):
        return None


def _stated() -> int | None:
    text = os.environ.get('COLUMNS', '')
    return int(text) if text.isascii() and text.isdigit() and 0 < int(text) < _UNBROKEN else None
