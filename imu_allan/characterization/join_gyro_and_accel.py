# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Join the results of a gyroscope and an accelerometer that are published separately."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from imu_allan.block import Half
from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.characterization.stream import Characterization
from imu_allan.finding import Finding, finding
from imu_allan.finding_messages import with_words
from imu_allan.result import Result


def fitted(parts: Iterable[tuple[Characterization, Half | None, Sequence[Finding]]]
           ) -> tuple[Result, list[FinishedRecord | None]]:
    """
    Fit what was taken in so far; return the result of the IMU, and the data of each part.

    `parts`: the samples, which sensor they are of, None for both, and findings of their reader.
    """
    results, records = [], []
    for characterization, half, remarks in parts:
        result, record = characterization.fitted(remarks)
        results.append((half, result))
        records.append(record)
    return with_words(united(results)), records


def united(parts: Sequence[tuple[Half | None, Result]]) -> Result:
    """
    Join the results of gyroscope and accelerometer into that of the IMU.

    `parts`: which sensor, None for both, and its result; the gyroscope first. Returns: a result in
    which each axis has its own rate and time at rest. Rate, gaps and faults of the whole are those
    of the first part with axes, as its remark `two_rates` says. The only result is returned as it
    is.
    """
    if len(parts) == 1:
        return parts[0][1]
    axes = {name: replace(axis, sample_rate_hz=result.timeline.sample_rate_hz,
                          rest_s=result.timeline.rest_s)
            for half, result in parts for name, axis in result.axes.items()
            if name.startswith(f'{half}_')}
    results = [result for _, result in parts]
    sensors = [half for half, result in parts if result.axes] or [parts[0][0]]
    known = [result for result in results if result.axes] or results[:1]
    remarks = [finding('two_rates', sensors=sensors,
                       topics=[result.source.topic for result in known],
                       rates_hz=[result.timeline.sample_rate_hz for result in known])]
    for result in results:
        remarks += [remark for remark in result.warnings if remark not in remarks]
    topics = dict.fromkeys(result.source.topic or '' for result in results)
    spread = {name: found for result in results for name, found in result.turn_on_bias.items()
              if name in axes}
    first = known[0]
    # With several recordings, each half has the same ones, in the same order.
    recordings = tuple(replace(same[0], means={
        name: mean for part in same for name, mean in part.means.items() if name in axes})
        for same in zip(*(result.recordings for result in known), strict=False))
    return replace(first, source=replace(first.source, topic=', '.join(topics)), axes=axes,
                   warnings=tuple(remarks), recordings=recordings, turn_on_bias=spread)
