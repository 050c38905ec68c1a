# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What recording on would bring, in a sentence."""

from imu_allan.result import Result
from imu_allan.wording import about, listed, named


def outlook_of(result: Result) -> str:
    """Say what a longer recording would bring, by the Fisher information of the fitted model."""
    halves = [c.ci_halves_in_s for axis in result.axes.values()
              for c in axis.coefficients.values() if c.ci_halves_in_s]
    waiting: dict[str, list[tuple[float, str]]] = {}
    for name, axis in result.axes.items():
        for coefficient in axis.coefficients.values():
            if coefficient.observable_in_s:
                waiting.setdefault(coefficient.symbol, []).append(
                    (coefficient.observable_in_s, name))
    parts = [f'all intervals half as wide after another {about(max(halves))}'] if halves else []
    if waiting:
        first = {symbol: min(times) for symbol, times in waiting.items()}
        parts.append(listed([f'{symbol} of {named([name])} after {about(wait)}'
                             for symbol, (wait, name) in first.items()]) + ' at the earliest')
    return f'Recording on: {"; ".join(parts)}.' if parts else ''
