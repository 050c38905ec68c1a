# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reading ahead of the estimator, in a thread or, for large recordings, in a process."""
