# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From a finished estimator to the posterior of every axis, and what is reported of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from imu_allan.noise.agreement import PARTS
from imu_allan.noise.axis_fault import axis_fault, steps_hide_noise
from imu_allan.noise.axis_fit import SHORTEST_RECORD
from imu_allan.noise.bins import bins_of
from imu_allan.noise.bridges import Bridges
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.groups import grouped, Groups
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.mean_in_blocks import without_mean
from imu_allan.noise.part_of_record import Part
from imu_allan.noise.periodogram import Periodogram, SpectrumPiece
from imu_allan.noise.posterior.answer import expected, Mean, moved_mean
from imu_allan.noise.posterior.change import Change, change_of, STEADY
from imu_allan.noise.posterior.courses import COURSES, with_temperature
from imu_allan.noise.posterior.posterior import Posterior, posteriors
from imu_allan.noise.posterior.report import AxisReport, reported
from imu_allan.noise.posterior.shapes import FEWEST_GROUPS
from imu_allan.noise.stationarity import (
    segment_powers,
    SegmentPowers,
    short_powers,
    Steadiness,
    steadiness,
    white_ratio,
)
from imu_allan.noise.temperature_course import TemperatureCourse
from imu_allan.noise.tones import find_lines, NAMED
from imu_allan.noise.trends import RecordSpectrum
from imu_allan.result import Tone
import numpy as np


def reports(finished: Estimator, dt: float, temperature: TemperatureCourse | None = None
            ) -> list[AxisReport | None]:
    """
    Weigh the noise models of every axis.

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
    list of AxisReport or None
        None for an axis that is constant, all the time or for a part of it, is cut off, has a
        deadband, or a record that is too short.

    """
    pieces = finished.periodogram.pieces() if finished.samples >= SHORTEST_RECORD else []
    axes = [axis for axis in range(finished.axes) if axis_fault(finished, axis) is None]
    found: list[AxisReport | None] = [None] * finished.axes
    if not pieces or not axes:
        return found
    sources = _sources(finished, pieces, axes, dt)
    kinds = COURSES if temperature is None else with_temperature(temperature)
    groups = [source.groups() for source in sources]
    posterior = posteriors(groups, dt, [source.record for source in sources], kinds)
    for number, (axis, source) in enumerate(zip(axes, sources, strict=True)):
        own = posterior[number]
        mean = moved_mean(own, source.record)
        if mean is not None:
            # What moves the mean is no change of the noise, and leaks into blocks.
            source = source.without(finished, mean)
            [own] = posteriors([source.groups()], dt, [source.record], kinds)
        own = replace(own, change=_change(own, source, dt))
        found[axis] = replace(reported(own, dt, source.parts, temperature),
                              steady=source.steady, record=source.record)
    return found


@dataclass(frozen=True)
class _Source:
    """What an axis is fitted to."""

    axis: int
    dt: float
    record: RecordSpectrum
    lines: list[Tone]
    steady: Steadiness | None
    segments: SegmentPowers | None
    of_segments: int
    quarters: list[Part]
    of_quarters: int

    def groups(self) -> Groups:
        """Return the spectrum, worth less where the noise changes."""
        own = self.record.groups()
        return own if self.steady is None or not self.steady.differs else self.steady.capped(own)

    def parts(self) -> list[Groups]:
        """Return the spectra of quarters of the record, none where they are too short."""
        found = [part.groups(self.of_quarters, self.lines_hz) for part in self.quarters]
        if len(found) < PARTS or min(len(one.frequency) for one in found) < FEWEST_GROUPS:
            return []
        return found if self.steady is None or not self.steady.differs else [
            self.steady.capped(one) for one in found]

    @property
    def lines_hz(self) -> list[float]:
        """Return the frequencies of the strongest lines."""
        return [line.frequency_hz for line in self.lines[:NAMED]]

    def without(self, finished: Estimator, mean: Mean) -> '_Source':
        """Take a mean that moves out of the blocks, the segments and the quarters."""
        bins = self.record.bins
        noise = np.exp(np.interp(np.log(bins.frequency), np.log(mean.frequency),
                                 np.log(mean.noise)))
        settled = self.record.without_leak(mean.course, noise)
        calm = without_mean(finished.periodogram, self.axis, self.dt, mean.course)
        segments = segment_powers(calm)
        return replace(
            self, record=settled, quarters=_quarters(calm, self.dt, finished.bridges),
            of_quarters=0,
            steady=steadiness(segments, 0, self.dt, self.lines_hz) if segments else self.steady)


def _sources(finished: Estimator, pieces: list[SpectrumPiece], axes: Sequence[int], dt: float
             ) -> list[_Source]:
    """Leave lines out of every axis, and compare the parts of the record."""
    bins = bins_of(pieces, dt, finished.bridges)
    segments = segment_powers(finished.periodogram)
    brief = short_powers(finished.periodogram) if segments is None else None
    coarse = steps_hide_noise(finished)
    quarters = _quarters(finished.periodogram, dt, finished.bridges) if brief is None else []
    found = []
    for axis in axes:
        whole = grouped(bins, axis)
        lines, keep = find_lines(pieces, bins, axis, dt, maximise(whole, ramp=None))
        lines_hz = [line.frequency_hz for line in lines[:NAMED]]
        steady = steadiness(segments, axis, dt, lines_hz) if segments else None
        own = segments
        if brief is not None and not coarse[axis]:
            # All that a short record can say of its parts is that their noise is not the same.
            said = steadiness(brief, axis, dt, lines_hz, white_alone=True)
            own, steady = (None, None) if said.steady else (brief, said)
        record = RecordSpectrum(pieces, bins, axis, dt, keep, aligned=True)
        found.append(_Source(axis, dt, record, lines, steady, own, axis, quarters, axis))
    return found


def _change(posterior: Posterior, source: _Source, dt: float) -> Change:
    """Weigh how much the level of the white noise changes between segments."""
    if source.segments is None or source.steady is None:
        return STEADY
    best = posterior.models[0]
    lam, white = expected(best)
    frequency = source.segments.frequency / dt
    share = np.exp(np.interp(np.log(frequency), np.log(best.spectra.frequency),
                             np.log(np.maximum(white, 1e-300) / lam)))
    edge = int(best.row.edge[0])
    top = best.spectra.frequency[edge - 1]
    ratio = white_ratio(source.segments, source.of_segments, 1.0, 1 / share, frequency <= top)
    return STEADY if ratio is None else change_of(2 * np.log(ratio[0]), 2 * ratio[1])


def _quarters(periodogram: Periodogram, dt: float, bridges: Bridges) -> list[Part]:
    """Quarters of a record."""
    used = periodogram.segments.used
    ends = [round(part * used / PARTS) for part in range(PARTS + 1)]
    return [Part(periodogram, dt, first, last, bridges)
            for first, last in pairwise(ends) if last > first]
