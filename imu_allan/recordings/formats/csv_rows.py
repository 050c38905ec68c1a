# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the first rows of a CSV file are what its header says, and their numbers plain."""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
import re

from imu_allan.errors import ImuAllanError
from imu_allan.recordings.formats.csv_cells import cell, filled_cells, QUOTES, whole_cells

QUOTED_COMMA = re.compile(r'"\s*(-?\d+),(\d+(?:[eE][-+]?\d+)?)\s*"')
"""A number with a decimal comma in a file whose cells commas part."""
_ROWS = 64
"""In which fields are counted: one with a field too many is a damaged line."""
_GROUPED = re.compile(r'\d{1,3}(?:[.,]\d{3})+')
_SHORT = re.compile(r'\d{1,3}')
_NO_DIGIT = re.compile(r'\D')


def refuse_more_fields_than_names(names: Sequence[str], delimiter: str | None, rows: Sequence[str]
                                  ) -> None:
    """
    Refuse a table most of whose rows have more fields than the header has names.

    Raises
    ------
    ImuAllanError
        With both numbers, and what to do.

    Examples
    --------
    >>> refuse_more_fields_than_names(['t', 'gx'], ',', ['1,0.0,0.1', '2,0.1,0.2'])
    Traceback (most recent call last):
    ...
    imu_allan.errors.ImuAllanError: the rows have 3 fields, the header names 2, so that none can \
be told by its name; name every column, the number of the row, too, as R does with col.names=NA

    """
    named = len(names) - _empty_at_end(names)
    # An unnamed column at the end, of remarks say, has its place.
    counts = Counter(len(cells) - _empty_at_end(cells) if len(cells) > len(names) else named
                     for cells in (whole_cells(row, delimiter)
                                   for row in rows[:_ROWS] if row.strip()))
    if not counts:
        return
    fields, _ = counts.most_common(1)[0]
    if fields <= named:
        return
    advice = ('name every column, the number of the row, too, as R does with col.names=NA'
              if fields < 2 * named else
              'where that comes of decimal commas, write semicolons between the cells')
    raise ImuAllanError(f'the rows have {fields} fields, the header names {named}, so that none '
                        f'can be told by its name; {advice}')


def refuse_grouped_times(rows: Sequence[str], delimiter: str | None, column: int) -> None:
    """
    Refuse whole numbers whose thousands are set apart, which read as fractions.

    Raises
    ------
    ImuAllanError
        With the first of them.

    Examples
    --------
    >>> refuse_grouped_times(['980', '990', '1.000'], ',', 0)
    Traceback (most recent call last):
    ...
    imu_allan.errors.ImuAllanError: the time 1.000 comes after 990: it is written with a mark \
between thousands; write the times without
    >>> refuse_grouped_times(['0', '0.005', '0.010'], ',', 0)

    """
    for before, time in pairwise(filled_cells(rows, delimiter, column)):
        whole = _SHORT.fullmatch(before)
        if not (whole or _GROUPED.fullmatch(before)):
            return
        # As a fraction it would lie before the number that it follows.
        if (whole and _GROUPED.fullmatch(time) and int(_NO_DIGIT.sub('', time)) > int(before)
                and int(before) > int(_NO_DIGIT.split(time)[0]) + 1):
            raise ImuAllanError(f'the time {time} comes after {before}: it is written with a mark '
                                'between thousands; write the times without')


def are_split_seconds(rows: Sequence[str], delimiter: str | None, seconds: int, nanoseconds: int
                      ) -> bool:
    """
    Whether times are whole seconds and the nanoseconds since, in all rows but a damaged one.

    Examples
    --------
    >>> are_split_seconds(['7,990000000', '8,0', '8,10000000'], ',', 0, 1)
    True
    >>> are_split_seconds(['0.99,990000000', '1.00,1000000000', '1.01,1010000000'], ',', 0, 1)
    False

    """
    others = 0
    for row in rows:
        with suppress(ValueError, IndexError):
            whole, part = (float(cell(row, delimiter, column))
                           for column in (seconds, nanoseconds))
            others += not (whole.is_integer() and 0 <= part < 1e9)
    return others < 2


def _empty_at_end(cells: Sequence[str]) -> int:
    filled = [place for place, text in enumerate(cells) if text.strip(QUOTES)]
    return len(cells) - 1 - filled[-1] if filled else len(cells)
