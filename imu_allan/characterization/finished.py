# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What was taken in of one IMU, ready to be fitted and put together with other records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.noise.courses.temperature import TemperatureCourse
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES
from imu_allan.timeline import TimelineSummary


@dataclass(frozen=True)
class FinishedGroup:
    """
    Axes that were always there together.

    Attributes
    ----------
    names : list of str
    estimator : Estimator
        Finished, of these axes.
    temperature : TemperatureCourse or None
        Over the same samples.

    """

    names: list[str]
    estimator: Estimator
    temperature: TemperatureCourse | None = None

    def taken(self, names: Sequence[str]) -> FinishedGroup:
        """Return it with some of its axes."""
        if list(names) == self.names:
            return self
        places = [self.names.index(name) for name in names]
        return FinishedGroup(list(names), self.estimator.taken(places), self.temperature)


@dataclass(frozen=True)
class FinishedRecord:
    """
    What was taken in, ready to be put together with other records.

    Attributes
    ----------
    summary : TimelineSummary
    rate_hz : float
        Samples per second.
    groups : tuple of FinishedGroup
        All but always one.

    """

    summary: TimelineSummary
    rate_hz: float
    groups: tuple[FinishedGroup, ...]

    @property
    def names(self) -> list[str]:
        """Of all axes, in the order of `AXES`."""
        known = {name for group in self.groups for name in group.names}
        return [name for name in AXES if name in known]

    @property
    def samples(self) -> int:
        """How many samples the axes have that have most."""
        return max(group.estimator.samples for group in self.groups)

    def group_of(self, name: str) -> FinishedGroup:
        """Return the group that an axis belongs to."""
        return next(group for group in self.groups if name in group.names)
