# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The command `imu_allan`, with one module for each verb."""

from imu_allan.process import use_one_thread

use_one_thread()
