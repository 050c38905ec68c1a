# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Fit noise models to the axes of a finished estimator."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from imu_allan.noise import stationarity
from imu_allan.noise.faults import axis_fault, steps_hide_noise
from imu_allan.noise.posterior.estimates import expected, fitted_trend, leaks_from_ends
from imu_allan.noise.posterior.level_change import Change, change_of, STEADY
from imu_allan.noise.posterior.posterior import Posterior, posteriors
from imu_allan.noise.posterior.report import AxisReport, reported
from imu_allan.noise.posterior.shapes import FEWEST_GROUPS
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import grouped, Groups
from imu_allan.noise.record.part_of_record import Part
from imu_allan.noise.record.periodogram import Periodogram, SpectrumSection
from imu_allan.noise.tones import find_lines, vibrations
from imu_allan.noise.trends.gains import Bank
from imu_allan.noise.trends.kinds import kinds_of_trends, lags_of, waveforms
from imu_allan.noise.trends.leakage import detrended, Waveform
from imu_allan.noise.trends.regressors import RecordSpectrum
from imu_allan.noise.trends.slow_cycle import known_cycle, SlowCycle, strong_cycle, without_lines
from imu_allan.noise.trends.temperature_series import TemperatureSeries
from imu_allan.result import Tone
import numpy as np

SHORTEST_RECORD = 64
"""Fewest samples from which coefficients are estimated."""


@dataclass(frozen=True)
class AxisFit:
    """Fitted noise model of one axis, with the spectra it rests on."""

    fit: AxisReport
    lines: list[Tone]    # lines that were left out of the spectrum, the strongest first
    groups: Groups    # the fitted spectrum, without the lines
    with_lines: Groups    # the spectrum with the lines
    # Comparison of the segments; None if the record is too short to be split
    steadiness: stationarity.Steadiness | None = None
    segments: stationarity.SegmentPowers | None = None    # of all axes
    # The record with the trends of its mean; None for a joint fit of several records
    record: RecordSpectrum | None = None
    # Returns the spectra of quarters of the record; an empty list if they are too short
    quarters: Callable[[], list[Groups]] = list
    change: Change = STEADY    # of the white noise within the record


def fit_axes(finished: Estimator, dt: float, temperature: TemperatureSeries | None = None
             ) -> list[AxisFit | None]:
    """
    Fit the noise models of every axis: equation (7) of docs/statistics.md.

    Parameters
    ----------
    finished : Estimator
        Estimator as returned by `Estimator.finished`.
    dt : float
        Sample interval in seconds.
    temperature : TemperatureSeries, optional
        Temperature over the same record.

    Returns
    -------
    list of AxisFit or None
        None for an axis that is clipped, has a deadband, or is constant for all or part of the
        record. None for all axes if the record is too short.

    Examples
    --------
    >>> from imu_allan.noise.simulate import simulate
    >>> estimator = Estimator()
    >>> estimator.update(simulate({'noise_density': 1e-3}, 20_000, 100.0, 1))
    >>> [axis] = fit_axes(estimator.finished(), 0.01)
    >>> density = axis.fit.estimates['noise_density']
    >>> bool(density.low < 1e-3 < density.high)
    True

    """
    sections = finished.periodogram.sections() if finished.samples >= SHORTEST_RECORD else []
    axes = [axis for axis in range(finished.axes)
            if axis_fault(finished, sections, axis, dt) is None]
    fits: list[AxisFit | None] = [None] * finished.axes
    if not sections or not axes:
        return fits
    sources = _sources(finished, sections, axes, dt)
    bank = Bank(sources[0].record, kinds_of_trends(temperature))
    sources = _without_cycles(sources, finished, temperature, bank)
    fitted = _posteriors(sources, dt, bank)
    # Each fit shows what else must be removed from the spectrum before it is fitted again.
    for improved in (_beside_ends, _without_found_cycle, _without_found_trends):
        before, sources = sources, [improved(source, posterior, finished)
                                    for source, posterior in zip(sources, fitted, strict=True)]
        changed = [number for number, (source, old) in enumerate(zip(sources, before, strict=True))
                   if source is not old and source.differs_from(old)]
        again = _posteriors([sources[number] for number in changed], dt, bank)
        for number, posterior in zip(changed, again, strict=True):
            fitted[number] = posterior
    for source, posterior in zip(sources, fitted, strict=True):
        fits[source.axis] = _reported(source, posterior, dt, temperature)
    return fits


def _posteriors(sources: Sequence['_Source'], dt: float, bank: Bank) -> list[Posterior]:
    """Compute the posteriors of some axes in one batch."""
    return posteriors([source.groups for source in sources], dt,
                      [source.record for source in sources], bank) if sources else []


def _reported(source: '_Source', posterior: Posterior, dt: float,
              temperature: TemperatureSeries | None) -> AxisFit:
    """Report one axis, without the harmonics of a cycle among its lines."""
    change = _change_of_white_noise(posterior, source, dt)
    report = reported(replace(posterior, change=change), dt, temperature, source.record,
                      [source.groups_of_quarters])
    if source.cycle is not None:
        report = replace(report, trend=replace(report.trend, cycle_s=source.cycle.period_s))
    lines = vibrations(source.lines, report.trend.cycle_s, source.record.sections, dt)
    with_trends = source.record.with_trends(
        waveforms(posterior.models[0].trends, source.record.duration_s))
    return AxisFit(report, lines, source.without_lines, source.with_lines, source.steadiness,
                   source.segments, with_trends, source.groups_of_quarters, change)


@dataclass(frozen=True)
class _Source:
    """Spectra and statistics of one axis that its models are fitted to."""

    axis: int
    with_lines: Groups    # before anything was removed
    without_lines: Groups
    record: RecordSpectrum    # without all that was removed so far
    lines: list[Tone]
    steadiness: stationarity.Steadiness | None
    segments: stationarity.SegmentPowers | None
    row: int    # of this axis in the segments and the quarters
    quarters: list[Part]
    cycle: SlowCycle | None = None

    @property
    def groups(self) -> Groups:
        """Return the spectrum, with fewer degrees of freedom where the noise changes."""
        return self._capped(self.record.groups())

    def _capped(self, groups: Groups) -> Groups:
        return groups if self.steadiness is None else self.steadiness.capped(groups)

    def differs_from(self, other: '_Source') -> bool:
        """Return whether the log likelihood of a model may differ by a tenth of a nat."""
        new, old = self.groups, other.groups
        if self.record.ends != other.record.ends or len(new.dof) != len(old.dof):
            return True
        # Samples that repeat exactly have powers of zero.
        change = 0.5 * np.abs(new.dof * new.power - old.dof * old.power)
        return bool(change @ (1 / np.maximum(old.power, 1e-200)) > 0.1)

    def groups_of_quarters(self) -> list[Groups]:
        """Return the spectra of quarters of the record; an empty list if they are too short."""
        found = [self._capped(groups) for part in self.quarters if (
            groups := part.groups(self.row, lines_hz(self.lines))) is not None
            and len(groups.frequency) >= FEWEST_GROUPS]
        return found if len(found) == len(self.quarters) else []

    def detrended(self, finished: Estimator, record: RecordSpectrum, *trends: Waveform
                  ) -> '_Source':
        """
        Remove trends and the cycle from the segments and quarters.

        `record`: the spectrum without their leakage. `trends`: those besides the cycle.
        """
        parts = trends if self.cycle is None else (*trends, self.cycle.cycle.trend)
        periodogram = detrended(finished.periodogram, self.axis, record.dt,
                                lambda time: np.sum([part(time) for part in parts], axis=0))
        segments = stationarity.segment_powers(periodogram)
        return replace(
            self, record=record, quarters=_quarters(periodogram, record.dt, finished), row=0,
            steadiness=stationarity.steadiness(segments, 0, record.dt, lines_hz(self.lines))
            if segments else self.steadiness)


def lines_hz(lines: Sequence[Tone]) -> list[float]:
    """Return the frequencies of the strongest lines; the bands of more would be all."""
    return [line.frequency_hz for line in lines[:32]]


def _sources(finished: Estimator, sections: list[SpectrumSection], axes: Sequence[int], dt: float
             ) -> list[_Source]:
    """Prepare every axis: exclude its lines, and compare the segments of the record."""
    bins, periodogram = bins_of(sections, dt, finished.interpolated_share), finished.periodogram
    segments = stationarity.segment_powers(periodogram)
    short = stationarity.short_powers(periodogram) if segments is None else None
    coarse = steps_hide_noise(finished)
    quarters = _quarters(periodogram, dt, finished) if short is None else []
    sources = []
    for axis in axes:
        with_lines = grouped(bins, axis)
        lines, keep = find_lines(sections, bins, axis, dt, with_lines)
        record = RecordSpectrum(sections, bins, axis, dt, keep, bands=with_lines)
        compared = segments if short is None or coarse[axis] else short
        steadiness = None if compared is None else stationarity.steadiness(
            compared, axis, dt, lines_hz(lines), white_alone=compared is short)
        # Parts of a short record can only show that the noise changes, not that it is steady.
        if steadiness and steadiness.steady and compared is short:
            compared, steadiness = None, None
        without_lines = with_lines if keep.all() else replace(record, bands=None).groups()
        sources.append(_Source(axis, with_lines, without_lines, record, lines, steadiness,
                               compared, axis, quarters))
    return sources


def _without_cycles(sources: Sequence[_Source], finished: Estimator,
                    temperature: TemperatureSeries | None, bank: Bank) -> list[_Source]:
    """Remove strong cycles, including those found on other axes, and slow lines."""
    # A cycle that the temperature explains is none.
    heat = [] if temperature is None else [
        temperature.of_sensor(float(lag)).trend for lag in lags_of(temperature)]
    records = [source.record.with_trends(heat) for source in sources]
    own = [strong_cycle(record, lines_hz(source.lines), bank)
           for source, record in zip(sources, records, strict=True)]
    known_hz = [1 / cycle.period_s for cycle in own if cycle is not None]
    found = []
    for source, record, cycle in zip(sources, records, own, strict=True):
        cycle = cycle or known_cycle(record, known_hz)
        if cycle is not None:
            source = _without_cycle(source, cycle, finished)
        lines = vibrations(source.lines, cycle.period_s if cycle else None,
                           source.record.sections, source.record.dt)
        found.append(replace(source, record=without_lines(source.record, lines_hz(lines))))
    return found


def _without_cycle(source: _Source, cycle: SlowCycle, finished: Estimator) -> _Source:
    """Remove a strong cycle from the record, its segments and its quarters."""
    return replace(source, cycle=cycle).detrended(finished, replace(cycle.record, trends=()))


def _beside_ends(source: _Source, posterior: Posterior, _: Estimator) -> _Source:
    """Allow for both ends of a record, where strong quantization noise does not average out."""
    return replace(source, record=source.record.beside_ends()) \
        if leaks_from_ends(posterior, source.record) else source


def _without_found_cycle(source: _Source, posterior: Posterior, finished: Estimator) -> _Source:
    """
    Remove a cycle that was found beside other trends, if it has harmonics.

    Without those trends, `_without_cycles` may have missed it, or seen it as one wave.
    """
    trends = posterior.models[0].trends
    frequencies_hz = [trend.value for trend in trends if trend.kind.key == 'slow_cycle']
    if source.cycle is not None or not frequencies_hz:
        return source
    others = waveforms([trend for trend in trends if trend.kind.key != 'slow_cycle'],
                       source.record.duration_s)
    cycle = known_cycle(source.record.with_trends(others), frequencies_hz)
    if cycle is None or len(cycle.cycle.sizes) <= 2:
        return source
    return _without_cycle(source, cycle, finished)


def _without_found_trends(source: _Source, posterior: Posterior, finished: Estimator) -> _Source:
    """Remove trends, which would pass for changing noise."""
    found = fitted_trend(posterior, source.record)
    if found is None:
        return source
    trend, noise = found
    return source.detrended(finished, source.record.without_leak(trend, noise), trend)


def _change_of_white_noise(posterior: Posterior, source: _Source, dt: float) -> Change:
    """Estimate how much the level of the white noise changes between segments."""
    segments = source.segments
    if segments is None:
        return STEADY
    best = posterior.models[0]
    power, white = expected(best)
    model_hz, band_hz = best.spectra.frequency, segments.frequency / dt
    white_share = np.exp(np.interp(np.log(band_hz), np.log(model_hz),
                                   np.log(np.maximum(white, 1e-300) / power)))
    # Drift leaks into the bands with less than half of the white noise.
    usable = (band_hz <= model_hz[:posterior.edge][-1]) & (
        segments.level(source.axis) > white.max() / 2)
    ratio = stationarity.white_ratio(segments, source.axis, 1.0, 1 / white_share, usable)
    if ratio is None or not ratio[0].all():
        return STEADY
    amplitude, relative_error = ratio
    return change_of(2 * np.log(amplitude), 2 * relative_error)


def _quarters(periodogram: Periodogram, dt: float, finished: Estimator) -> list[Part]:
    """Return the quarters of a record; an empty list if it has fewer segments."""
    used = periodogram.segments.used
    if used < 4:
        return []
    # More parts would each be too short to estimate a random walk; fewer would seldom disagree.
    return [Part(periodogram, dt, first, last, finished.interpolated_share)
            for first, last in pairwise(round(part * used / 4) for part in range(5))]
