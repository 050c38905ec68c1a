# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Accumulated data of one IMU: of all axes together, or of each sensor where one was turned."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import sqrt

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import EvenBlock
from imu_allan.characterization.thermometer import Temperature, Thermometer
from imu_allan.noise.axis_fit import AxisFit, fit_axes
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES
from imu_allan.noise.trends.temperature_series import TemperatureSeries
from imu_allan.state import Record
from imu_allan.timeline import TimelineSummary
import numpy as np

_ACCELEROMETER = np.arange(6) >= 3


@dataclass
class LatestRows(Record):
    """
    The newest rows of all axes without a gap, to compare those after a gap with.

    Attributes
    ----------
    rows : ndarray, shape (n, 6)
        At most 256.
    scatter : ndarray, shape (6,)
        Standard deviation of means of 16 rows; zero while unknown.

    """

    rows: Array = field(default_factory=lambda: np.empty((0, 6)))
    scatter: Array = field(default_factory=lambda: np.zeros(6))

    def add(self, rows: Array, after_gap: bool) -> None:
        """Add the rows of a block."""
        self.rows = np.concatenate([self.rows[:0] if after_gap else self.rows, rows[-256:]])[-256:]

    def moved(self, rows: Array) -> Bools:
        """Return for each axis whether its mean is another one in `rows`, which follow a gap."""
        count = len(self.rows) // 16
        # Fewer means say too little of their scatter: then an earlier one is used.
        if count >= 4:
            self.scatter = self.rows[-16 * count:].reshape(count, 16, 6).mean(axis=1).std(axis=0)
        rows = rows[:256]
        change = np.abs(rows.mean(axis=0) - self.rows.mean(axis=0))
        # Means of 16 rows also vary by slow noise; hardly ever by four sigmas.
        far = change > 4 * max(1.0, sqrt(16 / len(rows))) * self.scatter
        return np.asarray(far & (self.scatter > 0))


@dataclass
class Group(Record):
    """Axes whose runs begin together."""

    columns: Ints    # indices among the six axes
    estimator: Estimator
    thermometer: Thermometer    # with the grid places of the samples of these axes
    end: int = 0    # grid place after the newest sample
    moved: bool = False    # whether their means are others in the next block
    latest: LatestRows = field(default_factory=LatestRows)

    def part(self, some: Bools) -> Group:
        """Return a group of some of the axes, which continue on their own."""
        return replace(self, columns=self.columns[some],
                       estimator=self.estimator.select(np.flatnonzero(some).tolist()),
                       thermometer=self.thermometer.copy(), latest=self.latest.copy())

    def parted(self, block: EvenBlock) -> list[Group]:
        """
        Return the group before a block is added, split if only one sensor begins a run with it.

        The mean of an accelerometer is another one after the IMU was turned while messages were
        lost, and after every motion: 0.01 degree is as much as its flicker. That step is no noise.
        """
        if block.first_index <= self.end or not self.estimator.samples:
            return [self]
        sensor = self.columns // 3
        moved = self.latest.moved(block.samples) | (block.after_motion & _ACCELEROMETER)
        begins = np.isin(sensor, sensor[moved[self.columns]])
        if begins.any() and not begins.all():
            return [replace(self.part(begins), moved=True), self.part(~begins)]
        self.moved = bool(begins.all())
        return [self]

    def add(self, block: EvenBlock, epoch_ns: int | None, interval_ns: float | None) -> None:
        """
        Add a block, whose other axes are ignored.

        `epoch_ns`: stamp of the clock in use at time zero of the block's `start_s`.
        `interval_ns`: sample interval by the clock.
        """
        estimator, skipped = self.estimator, max(block.first_index - self.end, 0)
        self.latest.add(block.samples, block.new_run or skipped > 0)
        if not estimator.samples:
            # Samples left out at the very beginning still take up time.
            estimator.signal.skip(block.first_index)
        elif block.new_run:
            estimator.start_run()
        elif self.moved:
            estimator.start_run()
            estimator.signal.skip(skipped)
        elif skipped:
            estimator.skip(skipped)
        self.moved = False
        if epoch_ns is not None and interval_ns is not None:
            first = epoch_ns + round(block.start_s * 1e9)
            last = first + round((len(block) - 1) * interval_ns)
            self.thermometer.place(*estimator.next_place, len(block), first, last)
        samples = block.samples
        if len(self.columns) < samples.shape[1]:
            samples = samples[:, self.columns]
        estimator.update(samples, block.interpolated)
        self.end = block.first_index + len(block)

    def finish(self, rate_hz: float) -> FinishedGroup:
        """Process all samples, and return what is fitted; then add no more."""
        self.estimator.finish()
        spectrum = self.estimator.periodogram
        return FinishedGroup(
            [list(AXES)[column] for column in self.columns], self.estimator, rate_hz,
            self.thermometer.temperature(spectrum.series, spectrum.cell, 1 / rate_hz))


@dataclass(frozen=True)
class FinishedGroup:
    """Data of axes whose runs begin together."""

    names: list[str]
    estimator: Estimator    # finished, of these axes
    rate_hz: float    # samples per second
    heat: Temperature | None = None    # over the same samples

    @property
    def temperature(self) -> TemperatureSeries | None:
        """Return the series of the temperature, if it is known and changes."""
        return self.heat.series if self.heat is not None and self.heat.changes else None

    @cached_property
    def fits(self) -> list[AxisFit | None]:
        """Return the fits of these axes."""
        return fit_axes(self.estimator, 1 / self.rate_hz, self.temperature)

    def only(self, name: str) -> Estimator:
        """Return the estimator of one axis."""
        return (self.estimator if self.names == [name]
                else self.estimator.select([self.names.index(name)]))


@dataclass(frozen=True)
class FinishedRecord:
    """Accumulated data, ready to be fitted and combined with other records."""

    summary: TimelineSummary
    rate_hz: float    # samples per second
    groups: tuple[FinishedGroup, ...]    # nearly always one

    @property
    def names(self) -> list[str]:
        """Names of all axes, in the order of `AXES`."""
        known = {name for group in self.groups for name in group.names}
        return [name for name in AXES if name in known]

    @property
    def samples(self) -> int:
        """Return the number of samples of the axes that have most."""
        return max(group.estimator.samples for group in self.groups)

    @property
    def fits(self) -> dict[str, AxisFit | None]:
        """Return the fits of all axes."""
        return {name: fit for group in self.groups
                for name, fit in zip(group.names, group.fits, strict=True)}

    def group_of(self, name: str) -> FinishedGroup:
        """Return the group that an axis belongs to."""
        return next(group for group in self.groups if name in group.names)
