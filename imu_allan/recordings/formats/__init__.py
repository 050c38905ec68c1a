# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The containers: one module for each kind of file, and what they share."""
