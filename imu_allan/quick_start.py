# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a process spares itself that may have done its work within a second."""

import atexit
from collections.abc import Sequence
import gc
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
import sys
from types import ModuleType

_FOR_DEVELOPERS = ('numpy.f2py', 'numpy.testing')


class _OnFirstUse:
    """
    Finder of modules that are executed when they are first used.

    Of the time that `scipy.special` takes to import, a third is that of these two, as scipy takes
    every name that numpy has. Nothing that runs uses them.
    """

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
                  ) -> ModuleSpec | None:
        if name not in _FOR_DEVELOPERS:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def start_quickly() -> None:
    """
    Spare this process imports and searches for garbage; call it before importing numpy.

    Imports make a hundred thousand objects, none of which is garbage. Python would look through
    all of them twice while they are made, and twice more before it ends.
    """
    sys.meta_path.insert(0, _OnFirstUse)
    gc.set_threshold(5_000, 10, 10)
    atexit.register(gc.freeze)
