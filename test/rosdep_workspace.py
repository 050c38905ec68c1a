# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a workspace that rosdep filled lacks, and who may ask for it."""

from importlib import import_module
from pathlib import Path
import re
import traceback

ON_PYPI_ALONE = frozenset((
    'allantools', 'isal', 'lz4', 'mcap', 'plotly', 'rich', 'rosbags', 'zstandard'))
"""A test that needs one of them skips where it is missing."""
ROOT = Path(__file__).parents[1]
_MAY_ASK = ('test', 'imu_allan/recordings', 'imu_allan/cli', 'imu_allan/writers')
"""Tests and the offline tool. Where numerics or nodes ask, a missing package is a fault."""


def lacking(error: BaseException | None) -> str | None:
    """Name the package of PyPI for want of which a test ended; None where that is no excuse."""
    while error is not None:
        name = error.name if isinstance(error, ModuleNotFoundError) else None
        if name is not None and name.partition('.')[0] in ON_PYPI_ALONE:
            places = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
            asking = [place for place in places if ROOT in place.parents]
            if asking and asking[-1].relative_to(ROOT).as_posix().startswith(_MAY_ASK):
                return name.partition('.')[0]
        error = error.__cause__
    return None


def said(text: str, path: Path) -> str | None:
    """Name the package of PyPI that a program of a test said it lacks, and that is lacking."""
    # A node has no excuse for a traceback.
    said = 'needs the Python package ' + ('' if 'node' in path.parts else "|No module named '")
    for name in re.findall(rf'(?:{said})(\w+)', text):
        if name in ON_PYPI_ALONE:
            try:
                import_module(name)
            except ModuleNotFoundError:
                return str(name)
    return None
