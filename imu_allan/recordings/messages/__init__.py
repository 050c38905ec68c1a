# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that hold samples of an IMU, whatever their type: from definitions to blocks."""
