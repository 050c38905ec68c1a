# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Fleets of units of one model: how they differ beyond measurement error, and outliers.

`population` applies the statistics of values with errors to results; `names` gives the names of
units.
"""
