# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""An IMU whose gyroscope and accelerometer are published separately, each at its own rate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.block import Half
from imu_allan.finding import finding
from imu_allan.result import Result


@dataclass(frozen=True)
class HalfResult:
    """The result of one of the two sensors, or of both if `half` is None."""

    half: Half | None
    topic: str
    result: Result


def united(parts: Sequence[HalfResult]) -> Result:
    """
    Join the results of gyroscope and accelerometer into that of the IMU.

    `parts`: the gyroscope first. Returns: a result in which each axis has its own rate. Rate, gaps
    and faults of the whole are those of the first part with axes, as its remark `two_rates` says.
    The only result is returned as it is.
    """
    if len(parts) == 1:
        return parts[0].result
    axes = {name: replace(axis, sample_rate_hz=part.result.timeline.sample_rate_hz)
            for part in parts for name, axis in part.result.axes.items()
            if name.startswith(f'{part.half}_')}
    known = [part for part in parts if part.result.axes] or list(parts[:1])
    remarks = [finding('two_rates', sensors=[part.half for part in known],
                       topics=[part.topic for part in known],
                       rates_hz=[part.result.timeline.sample_rate_hz for part in known])]
    for part in parts:
        remarks += [remark for remark in part.result.warnings if remark not in remarks]
    topics = list(dict.fromkeys(part.topic for part in parts))
    spread = {name: found for part in parts for name, found in part.result.turn_on_bias.items()
              if name in axes}
    first = known[0].result
    # With several recordings, each half has the same ones, in the same order.
    recordings = tuple(replace(same[0], means={
        name: mean for part in same for name, mean in part.means.items() if name in axes})
        for same in zip(*(part.result.recordings for part in known), strict=False))
    return replace(first, source=replace(first.source, topic=', '.join(topics)), axes=axes,
                   warnings=tuple(remarks), recordings=recordings, turn_on_bias=spread)
