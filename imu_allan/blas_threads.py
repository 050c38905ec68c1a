# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How many threads numpy's linear algebra may use in the processes of this package."""

import os


def use_one_thread() -> None:
    """
    Keep OpenBLAS to one thread, unless the user says otherwise; before numpy is imported.

    The matrices of a fit have some thousand rows. Threads for them mostly wait for one another,
    which OpenBLAS does at full speed, on cores that a robot needs for other work.
    """
    if 'OMP_NUM_THREADS' not in os.environ:
        os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
