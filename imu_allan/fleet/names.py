# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Names of units, and their order."""

from collections.abc import Sequence
import os
from pathlib import Path
import re

from imu_allan.errors import ImuAllanError, printable, shorten


def name_pattern(text: str) -> 'str | re.Pattern[str]':
    """Parse the option that says what units are named after: folder, file or an expression."""
    if text in ('folder', 'file'):
        return text
    try:
        return re.compile(text)
    except (re.error, RecursionError, OverflowError) as error:
        raise ImuAllanError(f'--name-from: {printable(text)} is neither folder nor file nor a '
                            f'regular expression ({error})') from error


def unit_name(path: str, source: 'str | re.Pattern[str]' = 'file') -> str:
    """Name a unit after its file, its folder, or what an expression finds in the path."""
    if isinstance(source, re.Pattern):
        found = source.search(path)
        name = None if found is None else found[1] if source.groups else found[0]
        if not name:
            raise ImuAllanError(f'{path}: --name-from {source.pattern} finds no name in this path')
        return str(name)
    # A link names its unit, whatever the recording is called.
    whole = Path(os.path.abspath(path))  # noqa: PTH100
    if source == 'folder':
        return whole.parent.name or 'recording'
    return (whole.name if whole.is_dir() else whole.stem) or 'recording'


def distinct_labels(names: Sequence[str], longest: int) -> list[str]:
    """
    Shorten names to `longest` characters such that those of two units still differ.

    The middle is left out, or what all names have in common, or all but the place in the list.

    Examples
    --------
    >>> distinct_labels(['imu_bench_a_monday_night', 'imu_bench_b_monday_night'], 14)
    ['imu_bench_a…', 'imu_bench_b…']

    """
    whole = [printable(name) for name in names]
    shared = _shared(whole)
    end = _shared([name[shared:][::-1] for name in whole])
    # As much of the common beginning as there is room for.
    start = max(0, min(shared, max(map(len, whole), default=0) - end - (longest - 2)))
    cut = ['…' * (start > 0) + name[start:len(name) - end] + '…' * (end > 0) for name in whole]
    for shown in (whole, cut):
        short = [shorten(name, longest) for name in shown]
        if len(set(short)) == len(set(whole)):
            return short
    return [str(place) for place, _ in enumerate(whole, 1)]


def _shared(names: Sequence[str]) -> int:
    """Count the characters with which all names begin."""
    return next((place for place, letters in enumerate(zip(*names, strict=False))
                 if len({*letters}) > 1), min(map(len, names), default=0))


def natural(name: str) -> tuple[tuple[object, ...], str]:
    """Return a key that sorts ``unit2`` before ``unit10``, and ``bag_2`` before ``bag_10``."""
    # Text and numbers alternate, so that compared parts of two names always have the same type.
    return tuple(int(part) if place % 2 else part.casefold()
                 for place, part in enumerate(re.split(r'(\d+)', name))), name
