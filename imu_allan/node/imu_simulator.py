# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Entry point of `imu_simulator`, the node that publishes an IMU simulated from a noise model."""

from collections.abc import Sequence

from imu_allan.interruption import quiet_interrupt


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until its duration is over or it is asked to stop; return the exit status."""
    # End quietly on an interrupt until the node handles signals itself.
    with quiet_interrupt():
        from imu_allan.fast_startup import start_quickly
        start_quickly()
        from imu_allan.node.program import run_program
        return run_program('imu_simulator', 'imu_allan.node.simulator_node.SimulatorNode', args)


if __name__ == '__main__':
    raise SystemExit(main())
