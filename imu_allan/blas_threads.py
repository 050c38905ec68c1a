# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Limit of the threads that numpy's linear algebra uses in the processes of this package."""

import os


def use_one_thread() -> None:
    """
    Limit OpenBLAS to one thread unless the user sets a number; call it before importing numpy.

    The matrices of a fit have some thousand rows. Threads for them mostly wait for one another,
    and OpenBLAS waits by spinning, on cores that a robot needs for other work.
    """
    if 'OMP_NUM_THREADS' not in os.environ:
        os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
