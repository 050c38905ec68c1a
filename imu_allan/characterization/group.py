# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Axes that come and go together, with what they have taken in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from imu_allan.block import EvenBlock
from imu_allan.characterization.thermometer import Temperature, Thermometer
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES
import numpy as np
from numpy.typing import NDArray


@dataclass
class Group:
    """
    Axes that have always been there together.

    Attributes
    ----------
    columns : ndarray of int64
        Their numbers among the six.
    estimator : Estimator
    thermometer : Thermometer
        With the places of the samples of these axes.
    end : int
        Place on the grid behind the newest sample.
    new_run : bool
        A run has begun since.
    away : bool
        The newest block did not have these axes.

    """

    columns: NDArray[np.int64]
    estimator: Estimator
    thermometer: Thermometer
    end: int = 0
    new_run: bool = False
    away: bool = False

    @property
    def names(self) -> list[str]:
        """Keys of `AXES`."""
        return [list(AXES)[column] for column in self.columns]

    def copy(self) -> Group:
        """Give an independent copy."""
        return replace(self, estimator=self.estimator.copy(), thermometer=self.thermometer.copy())

    def to_plain(self) -> dict[str, Any]:
        """Give what is no array, for JSON."""
        return {'columns': self.columns.tolist(), 'next': self.end, 'new_run': self.new_run,
                'away': self.away}

    def part(self, some: NDArray[np.bool_]) -> Group:
        """Give some of the axes, which go on alone."""
        return replace(self, columns=self.columns[some],
                       estimator=self.estimator.taken(np.flatnonzero(some).tolist()),
                       thermometer=self.thermometer.copy())

    def add(self, block: EvenBlock, epoch_ns: int | None, interval_ns: float | None) -> None:
        """
        Add a block that has these axes.

        Parameters
        ----------
        block : EvenBlock
            Of which other axes are left aside.
        epoch_ns : int or None
            Stamp of the clock in use at time zero of the block's `start_s`.
        interval_ns : float or None
            From one sample to the next, by the clock.

        """
        estimator, skipped = self.estimator, 0
        if not estimator.samples:
            # What was left out at the very beginning is time, too.
            estimator.signal.skip(block.first_index)
            skipped = block.first_index
        elif block.new_run or self.new_run:
            estimator.start_run()
        elif block.first_index > self.end:
            skipped = block.first_index - self.end
            estimator.skip(skipped)
        self.new_run = self.away = False
        first = last = None
        if epoch_ns is not None and interval_ns is not None:
            first = epoch_ns + round(block.start_s * 1e9)
            last = first + round((len(block) - 1) * interval_ns)
        self.thermometer.place(*estimator.next_place, len(block), skipped, first, last)
        samples = block.samples
        if len(self.columns) < samples.shape[1]:
            samples = samples[:, self.columns]
        estimator.update(samples, block.bridged)
        self.end = block.first_index + len(block)

    def temperature(self, finished: Estimator, rate_hz: float) -> Temperature | None:
        """Return the temperature over the samples, `finished`, where there is any."""
        series = finished.periodogram
        return self.thermometer.temperature(series.series, series.cell, 1 / rate_hz)
