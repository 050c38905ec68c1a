# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics of the samples of a record, kept in constant memory, and its spectrum."""
