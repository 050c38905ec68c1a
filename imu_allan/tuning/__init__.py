# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From the drift model of an axis to the numbers that a filter wants, and what they are worth."""
