# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The file formats: one module for each, and what they share."""
