# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Table of verdicts for the terminal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imu_allan.datasheet.verdicts import Verdict
from imu_allan.errors import printable
from imu_allan.sensor.units import unit_of
from imu_allan.writers.datasheet.reasons import figures, reasons
from imu_allan.writers.terminal import bare_table

if TYPE_CHECKING:
    from rich.table import Table


def verdict_table(verdicts: Sequence[Verdict], title: str = '', left_out: Sequence[str] = ()
                  ) -> 'Table':
    """Return the verdicts as a table for a terminal, with the numbers of their `reasons`."""
    from rich.text import Text

    headings = [heading for heading in (
        'axis', 'term', 'measured', '95 % interval', 'limit', 'unit', 'ratio', 'verdict')
        if heading not in left_out]
    table = bare_table(*headings)
    table.title_justify = 'left'
    if title:
        table.title = Text(printable(title), style='bold')
    for column in table.columns:
        if column.header in ('unit', 'verdict'):
            column.justify = 'left'
    styles = {'pass': 'green', 'fail': 'bold red', 'cannot tell': 'yellow'}
    for verdict, number in zip(verdicts, reasons(verdicts)[1], strict=True):
        measured, interval, limit = figures(verdict)
        if 'measured' in left_out:
            interval = interval.replace(' .. ', '..') or measured
        cells: dict[str, str | Text] = {
            'axis': verdict.axis, 'term': verdict.symbol, 'measured': measured,
            '95 % interval': interval, 'limit': limit, 'unit': Text(unit_of(verdict.specified)),
            'ratio': '' if verdict.ratio is None else f'{verdict.ratio:.3g}',
            'verdict': Text(verdict.verdict if number is None else f'{verdict.verdict} ({number})',
                            style=styles[verdict.verdict])}
        table.add_row(*(cells[heading] for heading in headings))
    return table
