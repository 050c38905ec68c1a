# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whether an axis measures at all."""
