# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every part of the estimator has in common."""

from dataclasses import dataclass

from imu_allan.state import Record

_MOST = 1024
"""Far beyond what a sensor has: bounds what a damaged state may claim."""


@dataclass(eq=False)
class SideBySide(Record):
    """What is kept of several axes."""

    axes: int    # how many they are

    def __post_init__(self) -> None:
        """Begin with nothing, also where a state is about to be put in its place."""
        if not 1 <= self.axes <= _MOST:
            raise ValueError(f'axes must be 1 to {_MOST}, not {self.axes}')
        self.begin()

    def begin(self) -> None:
        """Set what is not given."""
        raise NotImplementedError

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes."""
        raise NotImplementedError
