# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Names of units, and their order."""

from collections.abc import Iterable, Sequence
import os
from pathlib import Path
import re


def unit_names(paths: Sequence[str | os.PathLike[str]], *, by_folder: bool = False) -> list[str]:
    """
    Name units after their files, or the folders of these, below the folder that they share.

    Examples
    --------
    >>> unit_names(['bench/sn1.mcap', 'bench/sn2.mcap'])
    ['sn1', 'sn2']
    >>> unit_names(['monday/sn1/result.json', 'tuesday/sn1/result.json'])
    ['monday_sn1', 'tuesday_sn1']

    """
    # A link names its unit, whatever the recording is called.
    whole = [Path(os.path.abspath(path)) for path in paths]  # noqa: PTH100
    whole = [path.parent if by_folder or path.name == 'result.json' else
             path if path.is_dir() else path.with_suffix('') for path in whole]
    shared = os.path.commonpath([path.parent for path in whole]) if whole else ''
    return distinct_names(str(path.relative_to(shared)) for path in whole)


def distinct_names(names: Iterable[str]) -> list[str]:
    """
    Turn names into names of folders, and number those that occur again.

    No name leads out of the parent folder, and no name is too long for a file system.
    """
    taken: dict[str, str] = {}
    for name in names:
        safe = re.sub(r'[^\w.-]+', '_', name).lstrip('.')
        # In bytes: file systems allow 255, and a number may have to be added.
        own = first = safe.encode()[:200].decode(errors='ignore') or 'recording'
        number = 1
        # On a file system that ignores case, names that differ only in case are one folder.
        while own.casefold() in taken:
            number += 1
            own = f'{first}-{number}'
        taken[own.casefold()] = own
    return list(taken.values())


def natural(name: str) -> tuple[tuple[object, ...], str]:
    """Return a key that sorts ``unit2`` before ``unit10``, and ``bag_2`` before ``bag_10``."""
    # Text and numbers alternate, so that compared parts of two names always have the same type.
    return tuple(int(part) if place % 2 else part.casefold()
                 for place, part in enumerate(re.split(r'(\d+)', name))), name
