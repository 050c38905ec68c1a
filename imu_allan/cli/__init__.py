# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The command `imu_allan`: one verb, one module."""
