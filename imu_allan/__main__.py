# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Entry point of the command `imu_allan`, which is also `python -m imu_allan`."""

from imu_allan.process import interruptible, open_closed_streams, quiet_interrupt, start_quickly


def main() -> int:
    """Run the command; Ctrl-C ends it silently, even during its imports."""
    with quiet_interrupt():
        start_quickly()
        open_closed_streams()
        from imu_allan.cli.main import main as run

    with interruptible():
        return run()


if __name__ == '__main__':
    raise SystemExit(main())
