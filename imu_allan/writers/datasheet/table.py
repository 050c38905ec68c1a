# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verdicts as a table of the terminal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imu_allan.errors import printable
from imu_allan.sensor.units import unit_of
from imu_allan.writers.datasheet.verdicts import (
    in_written_unit,
    Outcome,
    reasons,
    Verdict,
    with_interval,
)

if TYPE_CHECKING:
    from rich.table import Table

_STYLES: dict[Outcome, str] = {'pass': 'green', 'fail': 'bold red', 'cannot tell': 'yellow'}


def verdict_table(verdicts: Sequence[Verdict], title: str = '') -> 'Table':
    """
    Lay the verdicts out for a terminal.

    Every number stands in the unit that the specification uses, so that the two can be compared
    by eye. Behind what does not pass stands the number of its reason, as of `reasons`.

    Parameters
    ----------
    verdicts : sequence of Verdict
        What to show.
    title : str, optional
        Of the table.

    Returns
    -------
    rich.table.Table

    """
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(printable(title), style='bold') if title else None,
                  title_justify='left', box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for heading in ('axis', 'term', 'measured', '95 % interval', 'limit', 'unit', 'ratio',
                    'verdict'):
        table.add_column(heading, overflow='fold', justify='right' if heading in (
            'measured', '95 % interval', 'limit', 'ratio') else 'left')
    for verdict, number in zip(verdicts, reasons(verdicts)[1], strict=True):
        table.add_row(verdict.axis, verdict.symbol, *figures(verdict),
                      Text(unit_of(verdict.specified)),
                      '' if verdict.ratio is None else f'{verdict.ratio:.3g}',
                      Text(verdict.verdict if number is None else
                           f'{verdict.verdict} ({number})', style=_STYLES[verdict.verdict]))
    return table


def figures(verdict: Verdict) -> tuple[str, str, str]:
    """Return measured value, interval and limit, each in the unit of the specification."""
    limit = in_written_unit(verdict, verdict.limit)
    if verdict.value is not None and verdict.ci95 is not None:
        value, low, high = with_interval(verdict, verdict.value, verdict.ci95)
        return value, f'{low} .. {high}', limit
    value = '' if verdict.value is None else in_written_unit(verdict, verdict.value)
    if verdict.upper95 is not None:
        return '', f'< {in_written_unit(verdict, verdict.upper95)}', limit
    return value, '', limit
