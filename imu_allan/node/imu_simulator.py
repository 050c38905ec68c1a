# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Entry point of `imu_simulator`, the node that publishes an IMU simulated from a noise model."""

from collections.abc import Sequence

from imu_allan.node.program import run_program


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until its duration is over or it is asked to stop; return the exit status."""
    return run_program('imu_simulator', 'imu_allan.node.simulator_node.SimulatorNode', args)


if __name__ == '__main__':
    raise SystemExit(main())
