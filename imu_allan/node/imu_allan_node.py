# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Entry point of `imu_allan_node`, the node that characterizes the IMU on a topic."""

from collections.abc import Sequence

from imu_allan.node.program import run_program


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is asked to stop; save and return the exit status."""
    return run_program(
        'imu_allan_node', 'imu_allan.node.characterization_node.CharacterizationNode', args)


if __name__ == '__main__':
    raise SystemExit(main())
