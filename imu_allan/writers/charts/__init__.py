# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The charts of the report: what is drawn into the page itself.

`over_time` draws signal and parts, `allan` the Allan deviation, `spectrum` and `drift` theirs;
`chart` is what they have in common.
"""
