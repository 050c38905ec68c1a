# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
matplotlib under its own defaults, whatever lies in the current folder.

When it is imported, matplotlib reads a file ``matplotlibrc`` of the current folder before any
other. There it may be part of a recording that somebody else made, and have text run through
LaTeX, be no text at all, or be a pipe that nobody writes to.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
import os
import sys
from threading import Lock
from types import ModuleType
from typing import Any

_IMPORTING = Lock()


def matplotlib_alone() -> ModuleType:
    """Import matplotlib without the settings of the current folder."""
    with _IMPORTING:
        if 'matplotlib' in sys.modules:
            return sys.modules['matplotlib']
        # What matplotlib asks for, word for word.
        with _hidden('matplotlibrc'):
            return import_module('matplotlib')


@contextmanager
def own_style(settings: Mapping[str, Any]) -> Iterator[None]:
    """Draw with matplotlib's defaults and `settings`, for as long as the context lasts."""
    matplotlib = matplotlib_alone()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(settings)
        yield


@contextmanager
def _hidden(name: str) -> Iterator[None]:
    # To change the current folder instead would mislead other threads, which open files; none of
    # them asks for this name.
    exists = os.path.exists
    os.path.exists = lambda path: path != name and exists(path)
    try:
        yield
    finally:
        os.path.exists = exists
