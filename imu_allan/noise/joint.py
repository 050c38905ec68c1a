# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise coefficients from several records of one sensor, by their joint likelihood.

The records are independent given the coefficients, so their likelihoods multiply: the spectra
stand side by side. Every record keeps its own slowest part, its own mean, and regressors of its
own: a ramp, and whatever else moves the mean. They are taken out by restricted likelihood.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.noise.axis_fault import axis_fault
from imu_allan.noise.axis_fit import AxisFit, SHORTEST_RECORD
from imu_allan.noise.bins import bins_of
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import fit
from imu_allan.noise.groups import grouped, joined_groups
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.temperature_course import JointTemperature, TemperatureCourse
from imu_allan.noise.tones import find_lines, vibrations
from imu_allan.noise.trends import JointSpectrum, RecordSpectrum
from imu_allan.result import Tone
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAME_LINE = 2e-3
"""Relative distance below which lines of two records are one: a sensor's lines drift that much."""


def joint_fits(records: Sequence[Estimator], dt: float,
               temperatures: Sequence[TemperatureCourse | None] | None = None
               ) -> list[AxisFit | None]:
    """
    Fit every axis to all records at once: equation (7) of docs/statistics.md, summed over them.

    Parameters
    ----------
    records : sequence of Estimator
        As `Estimator.finished` returns them, of the same axes and the same sample interval.
    dt : float
        Sample interval in seconds.
    temperatures : sequence of TemperatureCourse or None, optional
        Over each record; they are used where every record has one.

    Returns
    -------
    list of AxisFit or None
        None for an axis that is constant in every record, or records that are all too short; a
        record in which it stands still is left out. There is no joint ramp.

    Examples
    --------
    >>> from imu_allan.noise.simulate import simulate
    >>> records = []
    >>> for seed in range(2):
    ...     estimator = Estimator()
    ...     estimator.update(simulate({'noise_density': 1e-3}, 20_000, 100.0, seed))
    ...     records.append(estimator.finished())
    >>> [axis] = joint_fits(records, 0.01)
    >>> density = axis.fit.trial.solution.theta[1] ** 0.5
    >>> bool(0.98e-3 < density < 1.02e-3)
    True

    """
    courses = temperatures or [None] * len(records)
    found: list[AxisFit | None] = []
    for axis in range(records[0].axes):
        spectra, heat = [], []
        for record, course in zip(records, courses, strict=True):
            if record.samples < SHORTEST_RECORD or axis_fault(record, axis) is not None:
                continue
            spectrum = _spectrum(record, axis, dt)
            if spectrum is not None:
                spectra.append(spectrum)
                heat += [course] if course is not None else []
        known = JointTemperature(tuple(heat)) if len(heat) == len(spectra) else None
        found.append(fit_spectra(spectra, dt, known) if spectra else None)
    return found


@dataclass(frozen=True)
class RecordedSpectrum:
    """
    The spectrum of one axis in one record.

    Attributes
    ----------
    spectrum : RecordSpectrum
    lines : list of Tone
        What is left out of it.
    theta : ndarray, shape (columns,)
        Squared coefficients to begin at.
    samples : int

    """

    spectrum: RecordSpectrum
    lines: list[Tone]
    theta: Array
    samples: int


def _spectrum(record: Estimator, axis: int, dt: float) -> RecordedSpectrum | None:
    pieces = record.periodogram.pieces()
    if not pieces:
        return None
    bins = bins_of(pieces, dt, record.bridges)
    first = maximise(grouped(bins, axis), ramp=None)
    lines, keep = find_lines(pieces, bins, axis, dt, first)
    return RecordedSpectrum(RecordSpectrum(pieces, bins, axis, dt, keep), lines, first.theta,
                            record.samples)


def fit_spectra(spectra: Sequence[RecordedSpectrum], dt: float,
                temperature: JointTemperature | None = None) -> AxisFit:
    """
    Fit one axis to several spectra at once.

    Parameters
    ----------
    spectra : sequence of RecordedSpectrum
        At least one.
    dt : float
        Sample interval in seconds.
    temperature : JointTemperature, optional
        Over these records.

    Returns
    -------
    AxisFit

    """
    joint = JointSpectrum(tuple(one.spectrum for one in spectra))
    theta = np.average([one.theta for one in spectra], axis=0,
                       weights=[one.samples for one in spectra])
    groups = joint.groups()
    solution = maximise(groups, Solution(theta, 0.0, np.inf), trend='restricted')
    fitted = fit(groups, dt, solution, joint, temperature=temperature)
    whole = joined_groups([grouped(one.bins, one.axis) for one in joint.records])
    return AxisFit(fitted, _lines_of(spectra, fitted.cycle_s, dt), groups, whole)


def _lines_of(spectra: Sequence[RecordedSpectrum], cycle_s: float | None, dt: float
              ) -> list[Tone]:
    """Lines of all records but those of a slow cycle, each once at its largest, by size."""
    kept: list[Tone] = []
    for line in sorted((line for one in spectra
                        for line in vibrations(one.lines, cycle_s, one.spectrum.pieces, dt)),
                       key=lambda line: -line.amplitude):
        if all(abs(line.frequency_hz - other.frequency_hz) > _SAME_LINE * other.frequency_hz
               for other in kept):
            kept.append(line)
    return kept
