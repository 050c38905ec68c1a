# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Acceleration in g where m/s^2 is due.

Some drivers publish sensor_msgs/Imu in g (Livox; Hesai in its first versions). Anything that is
subject to gravity and does not fall shows about 9.81 m/s^2: a steady magnitude near 1 is g.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.result import Remark
from imu_allan.sensor.units import STANDARD_GRAVITY
import numpy as np

_ENOUGH = 16
"""Messages from which on the unit is decided."""
_NEAR_ONE = (0.9, 1.1)
"""Median magnitude: ten per cent are bias and scale of the poorest sensors."""
_STEADY = 0.2
"""Spread of the magnitude (5 to 95 %): what moves freely without gravity varies more."""


class AccelerationUnit:
    """
    Turns acceleration that is found to be in g into m/s^2; decides once and keeps to it.

    Parameters
    ----------
    decided : bool, optional
        What was decided before, of a stream that goes on: whether it is in g.

    """

    def __init__(self, decided: bool | None = None) -> None:
        self.in_g = bool(decided)
        self._decided = decided is not None
        self._seen = np.empty(0)

    @property
    def decision(self) -> bool | None:
        """Whether the stream is in g; None as long as that is open."""
        return self.in_g if self._decided else None

    @property
    def remarks(self) -> list[Remark]:
        """Return what the user should know of it; code `unit_g`."""
        return [Remark(
            'unit_g',
            'the magnitude of the acceleration is near 1: taken as g, not m/s^2; --accel-unit g '
            'says so, --accel-unit m/s^2 takes the numbers as they are')] if self.in_g else []

    def __call__(self, block: ImuBlock) -> ImuBlock:
        """Return the block with its acceleration in m/s^2."""
        if not self._decided:
            self._decide(block)
        if not self.in_g:
            return block
        samples = block.samples.copy()
        samples[:, 3:] *= STANDARD_GRAVITY
        return replace(block, samples=samples)

    def each(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Return the blocks with their acceleration in m/s^2."""
        return map(self, blocks)

    def _decide(self, block: ImuBlock) -> None:
        acceleration = block.samples[~block.absent[:, 1], 3:]
        # Damaged messages may hold numbers of any size.
        with np.errstate(over='ignore', invalid='ignore'):
            magnitude = np.sqrt((acceleration**2).sum(axis=1))
        # The blocks of a slow topic have a few messages each.
        magnitude = np.append(self._seen, magnitude[np.isfinite(magnitude)])
        if len(magnitude) == 0:
            return
        self._seen = magnitude
        low, middle, high = np.percentile(magnitude, [5, 50, 95])
        self.in_g = bool(_NEAR_ONE[0] <= middle <= _NEAR_ONE[1] and high - low <= _STEADY)
        self._decided = len(magnitude) >= _ENOUGH
