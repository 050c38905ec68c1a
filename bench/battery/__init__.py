# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the estimator says of a frozen set of sensors, for any two checkouts: see __main__.py."""
