# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How a mean may move, as functions of time and as regressors; strong cycles are taken out."""
