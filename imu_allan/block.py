# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Blocks of samples, passed from topics and recordings to the timeline and on to the estimator.

Topics and recordings yield `ImuBlock`; the timeline converts them to `EvenBlock`.
Columns of `samples` are always the six of `imu_allan.noise.terms.AXES`, in SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from imu_allan.arrays import Array, Bools, Ints
import numpy as np

Half = Literal['gyro', 'accel']
"""The sensors of an IMU, each of which may have its own topic and rate."""
HALVES: dict[Half, slice] = {'gyro': slice(0, 3), 'accel': slice(3, 6)}
"""Their columns of the samples."""
NEIGHBOURS = 8
"""A short gap is filled with the mean of this many samples on each side."""


@dataclass(frozen=True)
class ImuBlock:
    """
    Consecutive Imu messages as received, faults included.

    Attributes
    ----------
    header_ns : ndarray of int64, shape (n,)
        header.stamp in nanoseconds.
    receive_ns : ndarray of int64, shape (n,)
        When the recorder or the subscription received the message, in nanoseconds.
    samples : ndarray of float64, shape (n, 6)
        Angular velocity x, y, z in rad/s, linear acceleration x, y, z in m/s^2.
    absent : ndarray of bool, shape (n, 2)
        Whether the message declares its angular velocity or its linear acceleration as not
        provided (first covariance element -1, REP-145).
    frame_id : str
        header.frame_id of every message of the block; another frame_id starts another block.

    """

    header_ns: Ints
    receive_ns: Ints
    samples: Array
    absent: Bools
    frame_id: str

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.samples)

    def part(self, rows: slice | Bools | Ints) -> ImuBlock:
        """Return some of the messages; a slice is not copied."""
        return ImuBlock(self.header_ns[rows], self.receive_ns[rows], self.samples[rows],
                        self.absent[rows], self.frame_id)

    @property
    def provided(self) -> Bools:
        """Whether each message has values of the gyroscope and of the accelerometer, (n, 2)."""
        values = [np.isfinite(self.samples[:, axes]).any(axis=1) for axes in HALVES.values()]
        return ~self.absent & np.stack(values, axis=1)

    def only(self, half: Half) -> ImuBlock:
        """Return the messages of one sensor, with the other one declared as not provided."""
        own, other = (0, 1) if half == 'gyro' else (1, 0)
        provided = self.provided
        of_other = provided[:, other] & ~provided[:, own]
        block = self.part(~of_other) if of_other.any() else self
        absent = block.absent.copy()
        absent[:, other] = True
        return replace(block, absent=absent)


def joined(blocks: Sequence[ImuBlock]) -> ImuBlock:
    """Join messages of one frame_id into one block, each axis contiguous, which numpy prefers."""
    samples = np.empty((6, sum(map(len, blocks)))).T
    return ImuBlock(
        np.concatenate([block.header_ns for block in blocks]),
        np.concatenate([block.receive_ns for block in blocks]),
        np.concatenate([block.samples for block in blocks], out=samples),
        np.concatenate([block.absent for block in blocks]), blocks[0].frame_id)


@dataclass(frozen=True)
class EvenBlock:
    """
    Samples on the uniform grid of the sensor's own rate.

    Attributes
    ----------
    samples : ndarray of float64, shape (n, 6)
        An absent axis is NaN in every row of the block; no other NaN occurs.
    first_index : int
        Position of the first row on the grid. If it is beyond the end of the previous block, the
        samples between are missing and no difference is taken across them.
    interpolated : ndarray of int64, shape (b,)
        Rows interpolated for missing samples, in increasing order.
    new_run : bool
        The length of the gap before this block is unknown (clock jump, restart, resume). Its
        position on the grid is then unrelated to the previous block.
    restart : bool
        All previous blocks are void: they were motion, before the first rest.
    after_motion : bool
        The samples just before this block were cut out as motion.
    start_s : float
        Time of the first row since the first sample, by the clock in use.

    """

    samples: Array
    first_index: int
    interpolated: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    new_run: bool = False
    restart: bool = False
    after_motion: bool = False
    start_s: float = 0.0

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.samples)

    @property
    def end(self) -> int:
        """Position on the grid after the last row."""
        return self.first_index + len(self.samples)

    def part(self, first: int, last: int, start_s: float) -> EvenBlock:
        """Return the rows from `first` to before `last`, the first of which is at `start_s`."""
        low, high = np.searchsorted(self.interpolated, (first, last))
        return replace(self, samples=self.samples[first:last], start_s=start_s,
                       first_index=self.first_index + first,
                       interpolated=self.interpolated[low:high] - first)
