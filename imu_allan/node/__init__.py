# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from imu_allan.process import use_one_thread

use_one_thread()
