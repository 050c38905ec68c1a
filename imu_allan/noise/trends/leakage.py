# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Leakage of a trend into blocks, which are too short for regressors and keep only power.

For a trend that is smooth over a block, the transform depends only on its slopes at the two ends.
The leakage is computed from the trend fitted to the whole record, and subtracted. Bins where it is
not small compared with the noise are not used.
"""

from collections.abc import Callable, Sequence

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise import spectrum
from imu_allan.noise.record.cells import end_to_end
from imu_allan.noise.record.periodogram import longest_blocks, Periodogram, SpectrumSection
from imu_allan.noise.record.segments import layout, TRANSFORMS
import numpy as np

Waveform = Callable[[Array], Array]
"""Maps times, in seconds from the beginning of the record, to values."""

_MOST = 0.2
"""Leakage up to this share of the noise is subtracted; beyond, bins are left out. By judgment."""


def leaks(sections: Sequence[SpectrumSection], dt: float, duration_s: float, trend: Waveform
          ) -> tuple[Array, Array]:
    """
    Return the power that a trend leaks into the bins of blocks, or an upper bound of it.

    The longest blocks of a stage are consecutive. The positions of shorter ones, from the ends of
    segments, are unknown, so only a bound can be given.

    `sections`: of a record. `dt`: sample interval in seconds. `duration_s`: from the beginning of
    the record to its end. `trend`: over the record. Returns `leak`, `bound`, shape (bins,): zero
    for the coefficients of the whole record.
    """
    longest = longest_blocks(sections)
    found = []
    for section in sections:
        leak, bound = np.zeros((2, section.last - section.first))
        if section.coefficients is None:
            step = section.step * dt
            ends = _slopes(trend, 0.0, duration_s, section.length * step)
            index = np.arange(section.first, section.last)
            if section.length == longest[section.step]:
                leak = _of_slopes(section.length, step, index, *ends)
            else:
                steepest = np.array([np.abs(ends).max()])
                bound = _of_slopes(section.length, step, index | 1, steepest, steepest)
        found.append((leak, bound))
    every, bounds = zip(*found, strict=True)
    return np.concatenate(every), np.concatenate(bounds)


def is_negligible(leak: Array, bound: Array, noise: Array) -> Bools:
    """Mark the bins whose leakage is small compared with their noise."""
    # Leakage with only a bound is not subtracted, so it must be much smaller.
    return np.asarray((leak < _MOST * noise) & (bound < 0.01 * noise))


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
    calm.shift_cells(-trend(np.asarray(middle * dt, dtype=np.float64)))
    seen = np.cumsum(series.counts)
    seen = seen + (segments.samples - (seen[-1] if len(seen) else 0))
    for number in range(segments.used):
        # Missing samples do not count towards a segment, but take time.
        ends = np.minimum(np.array([number, number + 1]) * segments.width, segments.samples)
        begin, end = np.interp(ends, seen, middle + calm.cell / 2, left=0.0) * dt
        if end <= begin:
            continue
        # Slopes do not show a step within the segment. Only a step is far off a straight line
        # through so many points.
        jump = np.abs(np.diff(trend(np.linspace(begin, end, 4097)), 2)).max()
        for length, step in TRANSFORMS:
            place = layout(length, step)
            index = np.arange(place.first, place.last)
            slopes = _slopes(trend, begin, end, length * step * dt)
            leak = place.means(_of_slopes(length, step * dt, index, *slopes)
                               + jump**2 * _of_step(length, index) / len(slopes[0]))
            power, dof = segments.power[0, number], segments.dof[number]
            leak = leak * dof[place.bands]
            left = power[place.bands] - leak
            little = leak < _MOST * left
            power[place.bands] = np.where(little, left, 0.0)
            dof[place.bands] = np.where(little, dof[place.bands], 0)
    return calm


def _slopes(trend: Waveform, begin_s: float, end_s: float, block_s: float) -> tuple[Array, Array]:
    """Return the slopes of a trend at the beginning and at the end of each block."""
    count = max(round((end_s - begin_s) / block_s), 1)
    edges = np.linspace(begin_s, end_s, count + 1)
    near = 1e-3 * block_s
    slope = (trend(edges + near) - trend(edges - near)) / (2 * near)
    return slope[:-1], slope[1:]


def _of_step(length: int, index: Ints) -> Array:
    """Return the power of coefficients over a block with a unit step, the mean over its places."""
    return np.asarray(1 / (4 * length * np.sin(np.pi * index / (2 * length))**2))


def _of_slopes(length: int, step: float, index: Ints, before: Array, after: Array) -> Array:
    """Return the mean power of coefficients over blocks with given slopes at their ends."""
    sign = np.where(index % 2, -1.0, 1.0)
    square, both = float(np.mean(before**2 + after**2)), float(np.mean(2 * before * after))
    return np.asarray(spectrum.end_dct(length, step, index)**2 * (square - sign * both))
