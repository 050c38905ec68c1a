# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Filter parameters from the drift model of an axis, and how well they perform."""
