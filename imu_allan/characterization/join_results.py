# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Join the results of a gyroscope and an accelerometer that are published separately."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.characterization.stream import Characterization
from imu_allan.finding import Finding, finding
from imu_allan.finding_messages import with_words
from imu_allan.result import Result
from imu_allan.wording import SENSORS


def fitted(parts: Iterable[tuple[Characterization, Sequence[Finding]]]
           ) -> tuple[Result, list[FinishedRecord | None]]:
    """
    Fit what was taken in so far; return the result of the IMU, and the data of each part.

    `parts`: the samples of the IMU, or of its gyroscope and of its accelerometer, each with the
    findings of their reader.
    """
    results, records = [], []
    for characterization, remarks in parts:
        result, record = characterization.fitted(remarks)
        results.append(result)
        records.append(record)
    return with_words(united(results)), records


def united(results: Sequence[Result]) -> Result:
    """
    Join the results of gyroscope and accelerometer, in this order, into that of the IMU.

    Returns: a result in which each axis has its own rate and time at rest. Rate, gaps and faults
    of the whole are those of the first with axes, as its remark `two_rates` says. The only result
    is returned as it is.
    """
    if len(results) == 1:
        return results[0]
    axes = {name: replace(axis, sample_rate_hz=result.timeline.sample_rate_hz,
                          rest_s=result.timeline.rest_s)
            for result in results for name, axis in result.axes.items()}
    known = [result for result in results if result.axes] or results[:1]
    remarks = [finding('two_rates', sensors=list(SENSORS),
                       topics=[result.source.topic for result in known],
                       rates_hz=[result.timeline.sample_rate_hz for result in known])
               ] if len(known) > 1 else []
    for result in results:
        remarks += [remark for remark in result.warnings if remark not in remarks]
    topics = dict.fromkeys(result.source.topic or '' for result in results)
    spread = {name: found for result in results for name, found in result.turn_on_bias.items()}
    first = known[0]
    # With several recordings, each half has the same ones, in the same order.
    recordings = tuple(
        replace(same[0], means={name: mean for part in same for name, mean in part.means.items()})
        for same in zip(*(result.recordings for result in known), strict=False))
    return replace(first, source=replace(first.source, topic=', '.join(topics)), axes=axes,
                   warnings=tuple(remarks), recordings=recordings, turn_on_bias=spread)
