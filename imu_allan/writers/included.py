# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is in the drift model, and so in the numbers for a filter, but not in the coefficients."""

from collections.abc import Mapping

from imu_allan.result import AxisResult
from imu_allan.wording import about, listed, named


def included(axes: Mapping[str, AxisResult]) -> list[str]:
    """
    Say which courses of the mean are part of numbers from the drift model, and the remedy.

    A sentence for each course; empty where nothing moves the mean.
    """
    trends = {name: axis.trend for name, axis in axes.items()
              if axis.drift_model is not None and axis.trend is not None}
    warm = [name for name, trend in trends.items() if trend.warm_up is not None]
    heated = [name for name, trend in trends.items() if trend.temperature is not None]
    cycles = {name: trend.cycle_s for name, trend in trends.items() if trend.cycle_s is not None}
    said = []
    if warm:
        said.append(f'The warm-up of {named(warm)} is in these numbers, unlike in the '
                    'coefficients: --start auto or --start TIME of analyze leaves it out, where '
                    'the recording is long enough.')
    if cycles:
        periods = list(dict.fromkeys(map(about, sorted(cycles.values()))))
        said.append(f"The slow cycle of {named(list(cycles))}, such as a heater's, of about "
                    f'{listed(periods)} is in these numbers, unlike in the coefficients: right '
                    'where the filter will meet it, too; else record without it.')
    if heated:
        said.append(f'What temperature does to {named(heated)} is in these numbers, unlike in the '
                    'coefficients: a recording at one temperature is without it.')
    return said
