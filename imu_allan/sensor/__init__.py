# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of a sensor beforehand: units, noise model files, and an IMU made from one."""
