# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The spectrum and the means of part of a record, read off a finished periodogram."""

from collections.abc import Sequence
from dataclasses import fields

from imu_allan.noise.cells import Cells
from imu_allan.noise.likelihood import bins_of, grouped, Groups
from imu_allan.noise.periodogram import BLOCK, Periodogram, Piece, unbroken
from imu_allan.noise.segments import Layout, layout, MEANS, OCTAVES, PER_OCTAVE, SHORTEST_SEGMENT
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

_HIGHEST_OF_MEANS = 0.25
"""As in the spectrum: means fold what is faster than a quarter of their rate."""
_ENOUGH = 0.5
"""Share of the samples that the slower transform has to have seen, to stand for all."""


def part_cells(periodogram: Periodogram, first: int, last: int) -> Cells:
    """
    Cells of the whole-record series that fall into some segments.

    Parameters
    ----------
    periodogram : Periodogram
        Finished.
    first, last : int
        The segments, `first` up to and without `last`.

    Returns
    -------
    Cells

    """
    series, segments = periodogram.series, periodogram.segments
    end = np.cumsum(series.counts)
    # The samples that an endless record of tiny runs has dropped came first.
    middle = end - series.counts / 2 + (segments.samples - (end[-1] if len(end) else 0))
    number = middle // segments.width
    return series.take((first <= number) & (number < last))


def part_groups(periodogram: Periodogram, axis: int, dt: float, first: int, last: int,
                lines_hz: Sequence[float] = (), bridged_share: float = 0.0) -> Groups:
    """
    Spectrum of some neighbouring segments of one axis.

    Parameters
    ----------
    periodogram : Periodogram
        Finished.
    axis : int
        Column of the axis.
    dt : float
        Sample interval in seconds.
    first, last : int
        The segments, `first` up to and without `last`.
    lines_hz : sequence of float, optional
        Frequencies of lines, whose bands and those beside them are left out.
    bridged_share : float, optional
        Share of the samples that stand in for missing ones.

    Returns
    -------
    Groups
        From the slowest to the fastest, as `grouped` gives them for the whole record; without any
        where the part is too short.

    """
    found = []
    cells = part_cells(periodogram, first, last)
    border = _border(periodogram, first, last)
    pieces = []
    for points, gaps, start in unbroken(cells, periodogram.cell):
        length = points.shape[1]
        end = min(length, int(np.ceil(2 * length * periodogram.cell * border)))
        if end > 1:
            coefficients = dct(points, norm='ortho')
            pieces.append(Piece(periodogram.cell, length, 1, 1, end, coefficients**2,
                                coefficients, gaps, start))
    if pieces:
        found.append(grouped(bins_of(pieces, dt, bridged_share), axis))
    if periodogram.cell > 1:
        found.append(_banded(periodogram, axis, dt, first, last, border, bridged_share))
    groups = Groups(*(np.concatenate([getattr(part, field.name) for part in found])
                      for field in fields(Groups)))
    keep = np.ones(len(groups.frequency), dtype=bool)
    for line in lines_hz:
        keep &= np.abs(np.log2(groups.frequency / line)) > 1.5 / PER_OCTAVE
    return groups.taken(keep)


def _border(periodogram: Periodogram, first: int, last: int) -> float:
    """Cycles per sample up to which the series speaks, and above which the bands do."""
    if periodogram.cell == 1:
        return 0.5
    highest = _HIGHEST_OF_MEANS / periodogram.cell
    slow = layout(SHORTEST_SEGMENT // MEANS, MEANS)
    seen = periodogram.segments.dof[first:last, slow.bands].sum() / slow.counts.sum()
    samples = min(last * periodogram.segments.width, periodogram.segments.samples) \
        - first * periodogram.segments.width
    whole = seen * SHORTEST_SEGMENT > _ENOUGH * samples
    return float(min(highest, 2.0**-OCTAVES if whole else 1 / 256))


def _banded(periodogram: Periodogram, axis: int, dt: float, first: int, last: int,
            border: float, bridged_share: float) -> Groups:
    """Spectrum of the bands above `border`, in cycles per sample."""
    segments = periodogram.segments
    dof = segments.dof[first:last].sum(axis=0)
    power = segments.power[axis, first:last].sum(axis=0)
    parts = []
    for length, step in ((SHORTEST_SEGMENT // MEANS, MEANS), (BLOCK, 1)):
        place = layout(length, step)
        nothing = Piece(step, length, 1, place.first, place.last, np.zeros((1, length)))
        bins = bins_of([nothing], dt, bridged_share)
        frequency = _by_band(bins.frequency, place)
        keep = (dof[place.bands] > 0) & (frequency * dt >= border)
        bands = place.bands[keep]
        parts.append((frequency[keep], dof[bands].astype(np.float64), power[bands] / dof[bands],
                      _by_band(bins.design, place)[keep], np.zeros(len(bands)),
                      _by_band(bins.ramp, place)[keep], np.zeros((len(bands), 1)),
                      np.zeros((len(bands), 1, 1))))
    return Groups(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _by_band(values: Array, place: Layout) -> Array:
    """Mean over the coefficients of each band; the first axis is that of the coefficients."""
    sums = np.add.reduceat(values, place.starts, axis=0)
    return np.asarray(sums / place.counts.reshape(-1, *[1] * (values.ndim - 1)))
