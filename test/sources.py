# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the files of the package and its tests import and hold."""

import ast
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / 'imu_allan'
MODULES = {'.'.join(('imu_allan', *path.relative_to(PACKAGE).with_suffix('').parts)): path
           for path in PACKAGE.rglob('*.py')}
ON_PYPI_ALONE = frozenset((
    'allantools', 'isal', 'lz4', 'mcap', 'rich', 'rosbags', 'zstandard'))
"""A test that needs one of them skips where it is missing."""


@cache
def imported(path: Path) -> frozenset[str]:
    """Give the full names of the modules that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            parts = {f'{node.module}.{alias.name}' for alias in node.names
                     if f'{node.module}.{alias.name}' in MODULES}
            found |= parts
            if len(parts) < len(node.names):
                found.add(node.module)
    return frozenset(found)


def libraries(path: Path) -> set[str]:
    """Give what a file imports by its first name: `scipy` for `scipy.signal`."""
    return {name.partition('.')[0] for name in imported(path)}
