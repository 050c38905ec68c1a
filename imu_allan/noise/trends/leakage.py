# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Leakage of a trend into blocks, which are too short for regressors and keep only power.

What a smooth trend leaks depends on its slopes at both ends of a block. They are those of the
trend fitted to the whole record. The leakage is subtracted; bins where it is not small compared
with the noise are not used.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.bins import Bins
from imu_allan.noise.record.cells import end_to_end
from imu_allan.noise.record.periodogram import Periodogram, SpectrumSection
from imu_allan.noise.record.segments import layout, TRANSFORMS
import numpy as np

Waveform = Callable[[Array], Array]
"""Maps times, in seconds from the beginning of the record, to values."""

LARGEST_LEAK = 0.2
"""Leakage up to this share of the noise is subtracted; beyond, bins are left out. By judgment."""


def leaks(sections: Sequence[SpectrumSection], bins: Bins, dt: float, duration_s: float,
          trend: Waveform) -> Array:
    """
    Return the power that a trend leaks into the bins of blocks.

    `sections`: of a record. `bins`: of these sections. `dt`: sample interval in seconds.
    `duration_s`: from the beginning of the record to its end. `trend`: over the record. Returns
    shape (bins,): zero for the coefficients of the whole record.
    """
    found = np.zeros(len(bins.index))
    for number, section in enumerate(sections):
        if section.coefficients is None:
            here = bins.section == number
            found[here] = _of_slopes(trend, 0.0, duration_s, section.length, section.step * dt,
                                     bins.index[here])
    return found


def detrended(periodogram: Periodogram, axis: int, dt: float, trend: Waveform) -> Periodogram:
    """
    Remove a trend from the series and the segments of one axis.

    `periodogram`: finished; it is not changed. `axis`: index of the axis. `dt`: sample interval in
    seconds. `trend`: over the record. Returns: a copy with this axis only. Bands of segments with
    too much leakage are empty.
    """
    calm = periodogram.select([axis])
    series, segments = calm.series, calm.segments
    middle = (end_to_end(series.keys) + 0.5) * calm.cell
    moved = trend(np.asarray(middle * dt, dtype=np.float64))
    calm.series = replace(series, sums=series.sums - moved * series.counts)
    for number in range(segments.used):
        # Missing samples do not count towards a segment, but take time.
        ends = np.minimum(np.array([number, number + 1]) * segments.width, segments.samples)
        begin, end = np.interp(ends, calm.ends, middle + calm.cell / 2, left=0.0) * dt
        if end <= begin:
            continue
        # Slopes do not show a step within the segment. Only a step is far off a straight line
        # through so many points.
        jump = np.abs(np.diff(trend(np.linspace(begin, end, 4097)), 2)).max()
        for length, step in TRANSFORMS:
            place = layout(length, step)
            index = np.arange(place.first, place.last)
            block_s = length * step * dt
            # Mean over the places of a unit step
            of_step = 1 / (4 * length * np.sin(np.pi * index / (2 * length))**2)
            leak = place.means(_of_slopes(trend, begin, end, length, step * dt, index)
                               + jump**2 * of_step * block_s / (end - begin))
            power, dof = segments.power[0, number], segments.dof[number]
            leak = leak * dof[place.bands]
            left = power[place.bands] - leak
            little = leak < LARGEST_LEAK * left
            power[place.bands] = np.where(little, left, 0.0)
            dof[place.bands] = np.where(little, dof[place.bands], 0)
    return calm


def _of_slopes(trend: Waveform, begin_s: float, end_s: float, length: int, step_s: float,
               index: Ints) -> Array:
    """
    Return the mean power of coefficients over blocks of a smooth trend, by its slopes at the ends.

    Odd coefficients are those of a ramp of the mean slope, even ones of half the difference.
    """
    blocks = max(round((end_s - begin_s) / (length * step_s)), 1)
    edges, near = np.linspace(begin_s, end_s, blocks + 1), 1e-3 * length * step_s
    slopes = (trend(edges + near) - trend(edges - near)) / (2 * near)
    first, last = slopes[:-1], slopes[1:]
    square = np.where(index % 2, np.mean((last + first)**2), np.mean((last - first)**2)) / 4
    half = np.pi * index / (2 * length)
    return np.asarray(square * (step_s * np.cos(half))**2 / (2 * length * np.sin(half)**4))
