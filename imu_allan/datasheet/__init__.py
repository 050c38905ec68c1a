# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Comparison of a measured sensor with its datasheet.

`verdicts` decides and `measured` gives the measured value of each limited quantity. `live` ends a
check once it is certain. The verdicts are written by `imu_allan.writers.datasheet`.
"""

from imu_allan.datasheet.verdicts import check, overall, Verdict

__all__ = ['Verdict', 'check', 'overall']
