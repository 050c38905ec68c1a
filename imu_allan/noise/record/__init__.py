# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is kept of the samples of a record, in constant memory, and the spectrum of it."""
