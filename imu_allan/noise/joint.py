# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
One set of coefficients from several records of one sensor, by their joint likelihood.

The records are independent given the coefficients, so their likelihoods multiply: the spectra
stand side by side and what is equal in frequency is averaged. Every record keeps its own slowest
part, its own mean and its own ramp. The ramps are taken out by restricted likelihood: with the
ramp t_j among the coefficients c_j of a record, I = sum t_j^2 / lambda_j and b = sum c_j t_j /
lambda_j, the power becomes (c_j - t_j b / I)^2 + t_j^2 / I, which is expected to be lambda_j.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

from imu_allan.noise.axis_fit import AxisFit, SHORTEST_RECORD
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import fit
from imu_allan.noise.intervals import Estimate
from imu_allan.noise.likelihood import Bins, bins_of, grouped, maximise
from imu_allan.noise.tones import find_lines, Line
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 3
"""Fits in which ramps and coefficients settle: the second changes the third digit of K."""
_SAME_LINE = 2e-3
"""Relative distance below which lines of two records are one: a sensor's lines drift that much."""


def joint_fits(records: Sequence[Estimator], dt: float) -> list[AxisFit | None]:
    """
    Fit every axis to all records at once: equation (7) of docs/statistics.md, summed over them.

    Parameters
    ----------
    records : sequence of Estimator
        As `Estimator.finished` returns them, of the same axes and the same sample interval.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    list of AxisFit or None
        None for an axis that is constant in every record, or records that are all too short. There
        is no joint ramp.

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
    usable = [record for record in records if record.samples >= SHORTEST_RECORD]
    found: list[AxisFit | None] = []
    for axis in range(records[0].axes):
        live = [record for record in usable if record.lowest[axis] < record.highest[axis]]
        spectra = [spectrum for record in live
                   if (spectrum := _spectrum(record, axis, dt)) is not None]
        found.append(fit_spectra(spectra, axis, dt) if spectra else None)
    return found


@dataclass(frozen=True)
class RecordedSpectrum:
    """
    The spectrum of one record.

    Attributes
    ----------
    bins : Bins
    keep : ndarray of bool, shape (bins,)
        False where a line is left out.
    lines : list of Line
    theta : ndarray, shape (columns,)
        Squared coefficients to begin at.
    samples : int

    """

    bins: Bins
    keep: NDArray[np.bool_]
    lines: list[Line]
    theta: Array
    samples: int


def _spectrum(record: Estimator, axis: int, dt: float) -> RecordedSpectrum | None:
    pieces = record.periodogram.pieces()
    if not pieces:
        return None
    bins = bins_of(pieces, dt, record.bridged / record.samples)
    first = maximise(grouped(bins, axis), ramp=None)
    lines, keep = find_lines(pieces, bins, axis, dt, first)
    return RecordedSpectrum(bins, keep, lines, first.theta, record.samples)


def fit_spectra(spectra: Sequence[RecordedSpectrum], axis: int, dt: float) -> AxisFit:
    """
    Fit one axis to several spectra at once.

    Parameters
    ----------
    spectra : sequence of RecordedSpectrum
        At least one.
    axis : int
        Column of the axis.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    AxisFit

    """
    samples = sum(spectrum.samples for spectrum in spectra)
    theta = sum((spectrum.theta * spectrum.samples for spectrum in spectra),
                np.zeros(len(spectra[0].theta))) / samples
    keep = np.concatenate([spectrum.keep for spectrum in spectra])
    for _ in range(_ROUNDS):
        bins = _joined([without_ramp(spectrum.bins, axis, theta, spectrum.keep)
                        for spectrum in spectra])
        groups = grouped(bins, axis, keep)
        solution = maximise(groups)
        theta = solution.theta
    fitted = fit(groups, dt, solution)
    estimates = {**fitted.estimates, 'rate_ramp': Estimate(False, 0.0, 0.0, 0.0, np.nan)}
    return AxisFit(replace(fitted, estimates=estimates),
                   _lines_of(spectra), groups, grouped(bins, axis))


def without_ramp(bins: Bins, axis: int, theta: Array, keep: NDArray[np.bool_]) -> Bins:
    """
    Take a ramp of its own out of every whole-record part of a spectrum.

    Parameters
    ----------
    bins : Bins
        The spectrum of a record.
    axis : int
        Column of the axis; the others stay as they are.
    theta : ndarray, shape (columns,)
        Squared coefficients of the noise that the ramp stands in.
    keep : ndarray of bool, shape (bins,)
        What the ramp is fitted to.

    Returns
    -------
    Bins
        Without any ramp left to fit.

    """
    expected = np.maximum(bins.design @ theta, 1e-300)
    power = bins.power.copy()
    for piece in np.unique(bins.piece[bins.whole]):
        part = bins.whole & (bins.piece == piece)
        used = part & keep
        weight = bins.dof[used] / expected[used]
        information = float(weight @ bins.ramp[used])
        if information <= 0:
            continue
        slope = float(weight @ bins.cross[axis, used]) / information
        # Of the power that the fitted ramp has taken away its expectation is given back.
        left = bins.power[axis, part] - 2 * slope * bins.cross[axis, part] \
            + (slope**2 + 1 / information) * bins.ramp[part]
        power[axis, part] = np.maximum(left, 1e-12 * bins.power[axis, part])
    nothing = {name: np.zeros_like(getattr(bins, name)) for name in ('cross', 'ramp')}
    return replace(bins, power=power, **nothing)


def _joined(spectra: Sequence[Bins]) -> Bins:
    """Bins of several records, pieces numbered on."""
    first = 0
    numbered = []
    for bins in spectra:
        numbered.append(replace(bins, piece=bins.piece + first))
        first += int(bins.piece.max()) + 1
    return Bins(*(np.concatenate([getattr(bins, field.name) for bins in numbered],
                                 axis=0 if field.name == 'design' else -1)
                  for field in fields(Bins)))


def _lines_of(spectra: Sequence[RecordedSpectrum]) -> list[Line]:
    """Lines of all records, each once at its largest, the strongest first."""
    kept: list[Line] = []
    for line in sorted((line for spectrum in spectra for line in spectrum.lines),
                       key=lambda line: -line.amplitude):
        if all(abs(line.frequency_hz - other.frequency_hz) > _SAME_LINE * other.frequency_hz
               for other in kept):
            kept.append(line)
    return kept
