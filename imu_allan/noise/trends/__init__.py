# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Trends of the mean as functions of time and as regressors, and removal of strong cycles."""
