# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Prior knowledge of a sensor: units, noise model files, and an IMU simulated from one."""
