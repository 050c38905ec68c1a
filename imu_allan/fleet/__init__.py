# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Many units of one model: how they differ beyond measurement error, and which do not belong.

`population` applies the statistics of numbers with errors to results, `names` says what a unit is
called.
"""
