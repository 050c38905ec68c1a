# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The lines of a CSV file taken apart into cells."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
import re

QUOTES = ' \t\r\n"'
"""What may stand about the text of a cell."""
_QUOTED = re.compile('"[^"]*"?')
_WORD = re.compile(r'[^\s\[(]+(?:\s*[\[(][^\])]{0,40}[\])])?')
"""A name, with its unit, in a header whose names have nothing but blanks between them."""


def cells_of(header: str) -> tuple[str | None, list[str]]:
    """Tell what stands between the cells of a line, and take them apart."""
    plain = header.strip('\r\n').lstrip('# ').removeprefix('//').lstrip(' ')
    marks = [mark for mark in (',', ';', '\t', '|') if mark in plain]
    if len(marks) > 1 and all(map(is_number, filter(str.strip, plain.split(marks[1])))):
        # Numbers with decimal commas.
        del marks[0]
    if marks:
        return marks[0], plain.split(marks[0])
    words = _WORD.findall(plain)
    return (None, words) if len(words) > 1 else (',', [plain])


def whole_cells(line: str, delimiter: str | None) -> list[str]:
    """Take a line apart, but no text in quotes."""
    if delimiter is None:
        return line.split()
    return _QUOTED.sub(lambda quoted: quoted[0].replace(delimiter, ''), line).split(delimiter)


def cell(line: str, delimiter: str | None, column: int) -> str:
    r"""
    Return one cell, without what stands about its text.

    Raises
    ------
    IndexError
        If the line is shorter.

    Examples
    --------
    >>> cell('0.01; "1.5" ;2\r', ';', 1)
    '1.5'

    """
    return line.split(delimiter, column + 1)[column].strip(QUOTES)


def filled_cells(lines: Iterable[str], delimiter: str | None, column: int) -> Iterator[str]:
    """
    Yield the cells of a column that hold anything.

    Examples
    --------
    >>> list(filled_cells(['1,2', '3', '4,""', '5,6'], ',', 1))
    ['2', '6']

    """
    for line in lines:
        with suppress(IndexError):
            if text := cell(line, delimiter, column):
                yield text


def is_number(text: str) -> bool:
    """Whether a cell holds a number, with a decimal point or comma."""
    try:
        float(text.strip(QUOTES).replace(',', '.'))
    except ValueError:
        return False
    return True
