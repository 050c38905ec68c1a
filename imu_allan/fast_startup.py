# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Faster start and end of a process that may have done its work within a second."""

import atexit
import gc


def start_quickly() -> None:
    """
    Search less for garbage; call it before importing numpy.

    Imports make a hundred thousand objects, none of which is garbage. Python would look through
    all of them twice while they are made, and twice more before it ends.
    """
    gc.set_threshold(5_000, 10, 10)
    atexit.register(gc.freeze)
