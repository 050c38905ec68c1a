# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Times that are written out: ``2024-04-21T15:54:46.333Z``, or the time of day alone.

Where the order of day and month is not known (``4/5/2024``) the date is left out, and a day begins
where the time of day falls back. Behind a third colon (``15:54:46:007``) stand milli-, micro- or
nanoseconds with all their digits: what ``:7`` means is not known.
"""

from collections.abc import Sequence
from datetime import date
from functools import lru_cache
import re

_WRITTEN = re.compile(
    r'\s*"?\s*(?:(?:(\d{4}[-/.]\d{1,2}[-/.]\d{1,2})|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4})'
    r'(?:[Tt_]|,? +))?'
    r'(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9})\d*|:((?:\d{3}){1,3}))?'
    r'\s*([AaPp][Mm])?\s*(?:[Zz]|UTC|GMT|([+-]\d{2}):?(\d{2}))?\s*"?\s*', re.ASCII)
_LONGEST = 64
"""Characters of a time; the rest of a longer one is something else."""
_DAY_S = 86_400     # a leap second is not told from the next
_UNIX_DAY = date(1970, 1, 1).toordinal()


class WrittenTimes:
    """
    Reads the written times of one file, in order.

    Parameters
    ----------
    delimiter : str or None
        What stands between the cells of a line; None for blanks.
    column : int
        Number of the column with the time.

    """

    def __init__(self, delimiter: str | None, column: int) -> None:
        self._delimiter, self._column = delimiter, column
        self._day, self._before = 0, -1

    def counted(self, lines: Sequence[str]) -> list[str]:
        """Return lines whose times are nanoseconds; a time that is none stays as it is."""
        return [self._line(line) for line in lines]

    def _line(self, line: str) -> str:
        cells = line.split(self._delimiter, self._column + 1)
        if len(cells) <= self._column:
            return line
        time = written_time(cells[self._column])
        if time is None:
            return line
        nanoseconds, dated = time
        if not dated:
            if nanoseconds < self._before - _DAY_S * 10**9 // 2:
                self._day += 1
            self._before = nanoseconds
            nanoseconds += self._day * _DAY_S * 10**9
        cells[self._column] = str(nanoseconds)
        return (self._delimiter or ' ').join(cells)


def written_time(text: str) -> tuple[int, bool] | None:
    """
    Read a time that is written out.

    Returns
    -------
    (int, bool) or None
        Nanoseconds, since 1970 if the bool says that the day is known, else of the day; None if
        the text is no time.

    Examples
    --------
    >>> written_time('1970-01-02T00:00:01.5Z'), written_time('12:00:00 AM'), written_time('1.5')
    ((86401500000000, True), (0, False), None)

    """
    match = _WRITTEN.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None:
        return None
    day, hour, minute, second, decimals, counted, half, zone, zone_minutes = match.groups()
    hours = int(hour)
    if half is not None:
        hours = hours % 12 + (12 if half.lower() == 'pm' else 0)
    seconds = (hours * 60 + int(minute)) * 60 + int(second)
    if hours > 23 or int(minute) > 59 or int(second) > 60:
        return None
    if day is not None:
        days = _days(day)
        if days is None:
            return None
        seconds += days * _DAY_S
        if zone is not None:
            sign = -1 if zone[0] == '-' else 1
            seconds -= sign * (abs(int(zone)) * 60 + int(zone_minutes)) * 60
    return seconds * 10**9 + int((decimals or counted or '0').ljust(9, '0')), day is not None


@lru_cache(maxsize=4)
def _days(text: str) -> int | None:
    """Days since 1970; None where there is no such day."""
    try:
        return date(*map(int, re.split('[-/.]', text))).toordinal() - _UNIX_DAY
    except ValueError:
        return None
