# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A single step of the mean, as a knock or a change of the supply makes one, which is no random walk.

The means of the stretches before a border and behind it differ by what the noise leaves, whatever
its colour: by so much nearly everywhere. A step stands out of that at one border alone, and lasts.
Where many do, the walk itself comes in jumps; what is soon over is a bump.
"""

from typing import NamedTuple

from imu_allan.noise.signal_over_time import Columns
import numpy as np
from numpy.typing import NDArray

_WIDTHS = (1, 2, 4, 8, 16)
"""Columns on either side of a border: the wider, the smaller the step that white noise allows."""
_FEWEST = 12
"""Widths that a record is long: from fewer differences nobody knows the usual one."""
_OUTSTANDING = 6.0
"""
Times the usual difference: of 1,400 records of white noise, flicker, walks, processes and ramps
none had a step (docs/statistics.md), while all steps of ten times B were found.
"""
_SIZED = 4
"""Columns on either side that the size is told from."""
_ALONE = 0.6
"""Share of it that the next largest difference elsewhere stays below."""
_LASTING = 32
"""Columns on either side over which it has to last, ..."""
_LEFT = 0.5
"""... by the difference of their medians: share of the size."""


class BiasStep(NamedTuple):
    """
    What `bias_step` returns.

    Attributes
    ----------
    place : int
        Of the first sample behind the step, to a column or a few.
    size : float
        In the unit of a sample.

    """

    place: int
    size: float


def bias_step(columns: Columns, axis: int) -> BiasStep | None:
    """
    Find the only step of the mean of an axis.

    Parameters
    ----------
    columns : Columns
        Of the whole record.
    axis : int
        Its number.

    Returns
    -------
    BiasStep or None
        None where no difference stands out, or more than one, or what does is soon over.

    Examples
    --------
    >>> from imu_allan.noise.signal_over_time import Signal
    >>> signal = Signal(1)
    >>> rows = np.random.default_rng(1).normal(size=(1, 50_000))
    >>> rows[0, 20_000:] += 0.5
    >>> signal.absorb(rows)
    >>> found = bias_step(signal.columns(), 0)
    >>> abs(found.place - 20_000) < 1000, round(found.size, 1)
    (True, 0.5)

    """
    whole = np.flatnonzero(columns.counts == columns.width)
    mean = columns.mean[axis, whole]
    total = np.concatenate(([0.0], np.cumsum(mean)))
    outstanding, found = _OUTSTANDING, None
    for width in _WIDTHS:
        if len(whole) < _FEWEST * width:
            break
        border = np.arange(max(width, 2), len(whole) - max(width, 2) + 1)
        step = _behind_less_before(total, border, width)
        # The median of what is normal, over its standard deviation.
        usual = float(np.median(np.abs(step - np.median(step)))) / 0.6745
        largest = int(np.argmax(np.abs(step)))
        size = abs(float(step[largest]))
        if usual <= 0 or size <= outstanding * usual:
            continue
        elsewhere = np.abs(border - border[largest]) >= 2 * width
        if np.max(np.abs(step[elsewhere])) < _ALONE * size:
            outstanding, at = size / usual, int(border[largest])
            # The step may lie within the column on either side of the border.
            before, behind = mean[:at - 1][-_LASTING:], mean[at + 1:at + 1 + _LASTING]
            step_size = float(np.mean(behind[:_SIZED]) - np.mean(before[-_SIZED:]))
            left = float(np.median(behind) - np.median(before))
            found = (BiasStep(int(whole[at]) * columns.width, step_size)
                     if left * step_size > _LEFT * step_size**2 else None)
    return found


def _behind_less_before(total: NDArray[np.float64], border: NDArray[np.int64], width: int
                        ) -> NDArray[np.float64]:
    """Mean of so many columns behind a border less that of those before, from running sums."""
    return np.asarray((total[border + width] - 2 * total[border] + total[border - width]) / width)
