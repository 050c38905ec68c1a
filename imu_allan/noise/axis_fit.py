# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From a finished estimator to the fit of every axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from imu_allan.noise.agreement import PARTS
from imu_allan.noise.alike import pairs
from imu_allan.noise.axis_fault import axis_fault, steps_hide_noise
from imu_allan.noise.bins import bins_of
from imu_allan.noise.bridges import Bridges
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Fit, fit
from imu_allan.noise.groups import grouped, Groups, Spectra
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.mean_in_blocks import Course, without_mean
from imu_allan.noise.part_of_record import Part
from imu_allan.noise.periodogram import Periodogram, SpectrumPiece
from imu_allan.noise.stationarity import (
    segment_powers,
    SegmentPowers,
    short_powers,
    Steadiness,
    steadiness,
)
from imu_allan.noise.temperature_course import TemperatureCourse
from imu_allan.noise.tones import find_lines, NAMED, vibrations
from imu_allan.noise.trends import RecordSpectrum
from imu_allan.result import Tone

SHORTEST_RECORD = 64
"""Samples below which no coefficient is estimated."""


@dataclass(frozen=True)
class AxisFit:
    """
    What the spectrum of one axis says.

    Attributes
    ----------
    fit : Fit
        The fitted terms.
    lines : list of Tone
        What was left out of the fit, the strongest first.
    groups : Groups
        What was fitted: the spectrum without the lines.
    whole : Groups
        The spectrum with them.
    steadiness : Steadiness or None
        What parts of the record say of each other; None where it is too short to have parts.
    segments : SegmentPowers or None
        Of all axes.

    """

    fit: Fit
    lines: list[Tone]
    groups: Groups
    whole: Groups
    steadiness: Steadiness | None = None
    segments: SegmentPowers | None = None


def fit_axes(finished: Estimator, dt: float, temperature: TemperatureCourse | None = None
             ) -> list[AxisFit | None]:
    """
    Fit the spectrum of every axis.

    Parameters
    ----------
    finished : Estimator
        As `Estimator.finished` returns it.
    dt : float
        Sample interval in seconds.
    temperature : TemperatureCourse, optional
        Over the same record.

    Returns
    -------
    list of AxisFit or None
        None for an axis that is constant, all the time or for a part of it, is cut off, has a
        deadband, or a record that is too short.

    """
    pieces = finished.periodogram.pieces() if finished.samples >= SHORTEST_RECORD else []
    if not pieces:
        return [None] * finished.axes
    bridges = finished.bridges
    bins = bins_of(pieces, dt, bridges)
    segments = segment_powers(finished.periodogram)
    brief = short_powers(finished.periodogram) if segments is None else None
    coarse = steps_hide_noise(finished)
    quarters = _quarters(finished.periodogram, dt, bridges)
    found: list[AxisFit | None] = []
    asked: dict[int, partial[Fit]] = {}
    for axis in range(finished.axes):
        if axis_fault(finished, axis) is not None:
            found.append(None)
            continue
        whole = grouped(bins, axis)
        first = maximise(whole, ramp=None)
        lines, keep = find_lines(pieces, bins, axis, dt, first)
        lines_hz = [line.frequency_hz for line in lines[:NAMED]]
        steady = steadiness(segments, axis, dt, lines_hz) if segments else None
        own = segments
        if brief is not None and not coarse[axis]:
            # All that a short record can say of its parts is that their noise is not the same.
            said = steadiness(brief, axis, dt, lines_hz, white_alone=True)
            own, steady = (None, None) if said.steady else (brief, said)
        record = RecordSpectrum(pieces, bins, axis, dt, keep)
        groups = whole if keep.all() else record.groups()
        parts, calmed = None, None
        if brief is None:
            parts = partial(_spectra, quarters, axis, lines_hz)
            calmed = partial(_calmed, finished, axis, dt, lines_hz)
        again = partial(fit, groups, dt, first, record, steady, parts, temperature, calmed)
        fitted = again()
        found.append(AxisFit(fitted, lines, groups, whole, fitted.steady, own))
        asked[axis] = again
    return _asked_for_cycles(found, asked, pieces, dt)


def _asked_for_cycles(found: list[AxisFit | None], asked: dict[int, partial[Fit]],
                      pieces: Sequence[SpectrumPiece], dt: float) -> list[AxisFit | None]:
    """Ask every axis for the slow cycles of the others: what heats one heats all."""
    known = {axis: one.fit.cycle_s for axis, one in enumerate(found)
             if one is not None and one.fit.cycle_s is not None}
    for axis, again in asked.items() if known else ():
        one = found[axis]
        assert one is not None
        if axis not in known:
            fitted = again(known_hz=[1 / period_s for period_s in known.values()])
            one = replace(one, fit=fitted, steadiness=fitted.steady)
        found[axis] = replace(one, lines=vibrations(one.lines, one.fit.cycle_s, pieces, dt))
    return found


def copies(finished: Estimator) -> list[tuple[int, int, int]]:
    """
    Find pairs of axes that give the same samples, or those of the other sign.

    Returns
    -------
    list of (int, int, int)
        Two numbers of axes and `imu_allan.noise.alike.SAME` or ``OPPOSITE``. Axes that are
        constant, or steps of which hide the noise, may be the same by nature.

    """
    coarse = steps_hide_noise(finished)
    return [] if finished.samples < SHORTEST_RECORD else [
        pair for pair in pairs(finished.alike) if not coarse[pair[0]]]


def _quarters(periodogram: Periodogram, dt: float, bridges: Bridges) -> list[Part]:
    """Quarters of a record."""
    used = periodogram.segments.used
    ends = [round(part * used / PARTS) for part in range(PARTS + 1)]
    return [Part(periodogram, dt, first, last, bridges)
            for first, last in pairwise(ends) if last > first]


def _calmed(finished: Estimator, axis: int, dt: float, lines_hz: Sequence[float], mean: Course
            ) -> tuple[Steadiness | None, Spectra]:
    """Ask the segments and the quarters of an axis without a mean that moves."""
    calm = without_mean(finished.periodogram, axis, dt, mean)
    segments = segment_powers(calm)
    quarters = _quarters(calm, dt, finished.bridges)
    return (steadiness(segments, 0, dt, lines_hz) if segments else None,
            partial(_spectra, quarters, 0, lines_hz))


def _spectra(parts: Sequence[Part], axis: int, lines_hz: Sequence[float]) -> list[Groups]:
    return [part.groups(axis, lines_hz) for part in parts]
