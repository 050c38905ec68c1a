# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The version of the package."""

__version__ = '0.1.0'
# Type checkers take this as true; importing `typing` takes longer than the package itself.
TYPE_CHECKING = False
