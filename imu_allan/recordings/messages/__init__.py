# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Decoding of messages that hold IMU samples, from type definitions to blocks."""
