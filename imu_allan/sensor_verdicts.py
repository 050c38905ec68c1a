# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Verdict on the numbers of a sensor: whether they can be used, given the findings."""

from collections.abc import Mapping

from imu_allan.finding import Finding
from imu_allan.result import AxisResult, Result, SensorVerdict

SHORTEST_GOOD_S = 60.0
"""With less rest no term slower than N is visible."""
FAULTS = {'constant': 'constant_axis', 'dead': 'stood_still', 'saturated': 'saturated',
          'zeroed': 'deadband'}
"""Codes of findings by `AxisResult.fault`: a file may hold the fault without the finding."""


def sensor_verdicts(result: Result) -> dict[str, SensorVerdict]:
    """Return the verdict on each sensor with axes in a result, with the codes behind it."""
    found = {}
    for sensor in ('gyro', 'accel'):
        axes = {name: axis for name, axis in result.axes.items() if name.startswith(sensor)}
        if axes:
            # As it is shown: a minute by stamps in microseconds may last 59.9999 s.
            found[sensor] = _verdict(axes, [one for one in result.warnings if concerns(
                one, sensor)], round(result.timeline.rest_s, 1))
    return found


def concerns(found: Finding, sensor: str) -> bool:
    """Return whether a finding is about a sensor: by its axes, or as one about the recording."""
    if found.axes:
        return any(axis.startswith(sensor) for axis in found.axes)
    return found.values.get('half') in (None, sensor) and not (
        sensor == 'gyro' and found.code == 'gravity')


def _verdict(axes: Mapping[str, AxisResult], about: list[Finding], rest_s: float) -> SensorVerdict:
    act = list(dict.fromkeys(one.code for one in about if one.severity == 'act'))
    faults = [FAULTS[axis.fault] for axis in axes.values() if axis.fault is not None]
    # Findings after which an axis has no numbers, or those of something else.
    no_sensor = frozenset({'constant_axis', 'deadband', 'high_passed', 'saturated', 'stood_still',
                           'unknown_rate', 'mostly_motion'})
    broken = list(dict.fromkeys([*(code for code in act if code in no_sensor), *faults]))
    unseen = [axis for axis in axes.values() if not axis.coefficients['noise_density'].observable]
    short = ['short_recording']
    # With less rest even N is known to a tenth at best. Chosen by judgment.
    too_short = rest_s < 10.0
    if broken or unseen or too_short:
        return SensorVerdict('not_usable', tuple(
            broken or (short if too_short else act or short)))
    if act or rest_s < SHORTEST_GOOD_S:
        return SensorVerdict('with_care', tuple(act or short))
    return SensorVerdict('good', ())
