# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Which files a command may overwrite with its outputs."""

import argparse
from pathlib import Path

from imu_allan.errors import ImuAllanError, printable


def require_apart(args: argparse.Namespace) -> None:
    """
    Refuse an output that is an input, or an existing file of another kind.

    The defaults `inputs` and `outputs` of each verb list which of its arguments are which. Outputs
    have a kind (`imu_allan.writers.atomic`), which is empty for a folder.
    """
    from imu_allan.writers.atomic import require_replaceable

    given = [(name.replace('_', ' '), path) for name in getattr(args, 'inputs', ())
             for path in _paths(args, name)]
    written = [(f'--{name}', path, kind) for name, kind in getattr(args, 'outputs', {}).items()
               for path in _paths(args, name)]
    for name, path, *_ in (*given, *written):
        if not path:
            raise ImuAllanError(f"{name} '': names no file; is a variable of the shell empty?")
    for name, path, kind in written:
        is_file = Path(path).is_file()
        if is_file and any(Path(other).exists() and Path(path).samefile(other)
                           for _, other in given):
            raise ImuAllanError(f'{name} {printable(path)}: is an input of this command, which '
                                'would be overwritten; name another file')
        if is_file and kind:
            require_replaceable(path, kind)


def _paths(args: argparse.Namespace, name: str) -> list[str]:
    found = getattr(args, name)
    return [] if found is None else [found] if isinstance(found, str) else list(found)
