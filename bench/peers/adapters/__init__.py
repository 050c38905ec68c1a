# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
One small adapter for each tool.

Each module has NAME, ORIGIN (where tool or recipe comes from) and `answer`, a function from a
recording to coefficients by axis, which raises RefusedError where the tool gives none.
"""

from importlib import import_module

KEYS = ('ours', 'wavelets', 'readings', 'relative_nnls', 'dedrunk', 'tangents', 'line_means')


def adapter(key: str):
    """Return the module of a tool."""
    return import_module(f'adapters.{key}')
