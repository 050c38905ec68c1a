# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""`python -m imu_allan` is the command `imu_allan`."""

from imu_allan.cli.main import main

if __name__ == '__main__':
    raise SystemExit(main())
