# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Trends contained in filter numbers but not in coefficients, and why an axis has no numbers."""

from collections.abc import Mapping

from imu_allan.result import AxisResult
from imu_allan.wording import about, duration, listed, named


def trend_notes(axes: Mapping[str, AxisResult]) -> list[str]:
    """Say which trends are in the numbers from the drift model, and the remedy."""
    trends = {name: axis.trend for name, axis in axes.items()
              if axis.drift_model is not None and axis.trend is not None}
    warm = [name for name, trend in trends.items() if trend.warm_up is not None]
    heated = [name for name, trend in trends.items() if trend.temperature is not None]
    cycles = {name: trend.cycle_s for name, trend in trends.items() if trend.cycle_s is not None}
    said = []
    if warm:
        said.append(f'The warm-up of {named(warm)} is in these numbers, unlike in the '
                    'coefficients. Where the recording is long enough, --start auto or '
                    '--start TIME of analyze leaves it out.')
    if cycles:
        periods = list(dict.fromkeys(map(about, sorted(cycles.values()))))
        said.append(f"The slow cycle of {named(list(cycles))}, such as a heater's, of about "
                    f'{listed(periods)} is in these numbers, unlike in the coefficients. That is '
                    'right where the filter will meet it, too; else record without it.')
    if heated:
        said.append(f'What temperature does to {named(heated)} is in these numbers, unlike in the '
                    'coefficients: a recording at one temperature is without it.')
    return said


def why_left_out(axis: AxisResult) -> str:
    """Return why an axis has no numbers for a filter; empty if it measures properly."""
    if axis.high_passed_hz is not None:
        return 'a filter has taken out its slow part'
    if axis.constant:
        return 'every sample is the same'
    if axis.stood_still is not None:
        return f'it stood still for {duration(axis.stood_still.duration_s)}'
    if axis.saturated is not None:
        return f'its output is cut off at {axis.saturated.value:.6g} {axis.unit}'
    if axis.deadband is not None:
        return 'small values are given as zero'
    return '' if axis.copy_of is None else 'it repeats another axis'
