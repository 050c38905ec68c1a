# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Names of units, and their order."""

from pathlib import Path
import re

from imu_allan.errors import ImuAllanError, printable


def name_pattern(text: str) -> 'str | re.Pattern[str]':
    """
    Parse the option that says what units are named after.

    It is ``folder``, ``file``, or a regular expression whose first group (or whole match, if it
    has none) is the name.
    """
    if text in ('folder', 'file'):
        return text
    try:
        return re.compile(text)
    except (re.error, RecursionError, OverflowError) as error:
        raise ImuAllanError(f'--name-from: {printable(text)} is neither folder nor file nor a '
                            f'regular expression ({error})') from error


def unit_name(path: str, source: 'str | re.Pattern[str]' = 'file') -> str:
    """
    Name a unit after its recording.

    The name is that of the file, of its folder, or what a regular expression from `name_pattern`
    finds in the path.
    """
    if isinstance(source, re.Pattern):
        found = source.search(path)
        name = None if found is None else found[1] if source.groups else found[0]
        if not name:
            raise ImuAllanError(f'{path}: --name-from {source.pattern} finds no name in this path')
        return str(name)
    resolved = Path(path).resolve()
    if source == 'folder':
        return resolved.parent.name or 'recording'
    return (resolved.name if resolved.is_dir() else resolved.stem) or 'recording'


def natural(name: str) -> tuple[tuple[object, ...], str]:
    """Return a key that sorts ``unit2`` before ``unit10``, and ``bag_2`` before ``bag_10``."""
    # Text and numbers alternate, so that compared parts of two names always have the same type.
    return tuple(int(part) if place % 2 else part.casefold()
                 for place, part in enumerate(re.split(r'(\d+)', name))), name
