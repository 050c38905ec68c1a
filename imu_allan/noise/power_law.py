# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Slow noise that is no flicker: a density of f^-a with an exponent of its own.

Real sensors have exponents other than 1. Over several decades that is no small matter: white noise
has to stand in for what flicker leaves, and the band is cut until too little of it is left. Before
that, the exponent is set free.

References
----------
M. S. Keshner, "1/f noise", Proc. IEEE 70 (1982): exponents that are found in devices.

"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

from imu_allan.noise.bins import Bins
from imu_allan.noise.courses import Calmed, Spectrum
from imu_allan.noise.groups import FLICKER, Groups, QUANTIZATION, Spectra, WALK, WHITE
from imu_allan.noise.intervals import CI95, crossing, Estimate, spread
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.low_passes import likeliest_low_passed
from imu_allan.noise.mean_in_blocks import Course
from imu_allan.noise.minimum import lowest_near
from imu_allan.noise.spectrum import flicker, power_law
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.terms import FLICKER_FLOOR, power_law_avar
from imu_allan.noise.trends import JointSpectrum
from imu_allan.noise.trial import BENT_P, fit_band, fit_columns, OBSERVABLE, start_in_band, Trial
import numpy as np

Columns = TypeVar('Columns', Groups, Bins)

TRIED = (0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8)
"""Exponents; beyond, the noise is hardly told from white noise, or from a random walk."""
_AT_END = 0.01
"""As near to the ends the likeliest exponent lies beyond."""
_OBSERVABLE_EXPONENT = 15.0
"""
Likelihood ratio to a roll-off or a low-pass, which have as many parameters. Of low-passes that
take 2 to 8 % of the power at the edge none reached 2, of an exponent of 0.7 that crosses the white
noise at a thousandth of the sample rate all 50.
"""
_ERROR = 0.02
"""Of an exponent, where the search for the ends of its interval begins."""
_SIDES = 7
"""Exponents over that interval at which the density is asked for."""


@dataclass(frozen=True)
class PowerLaw:
    """
    Noise of the density ``amplitude**2/(2 pi f)**exponent``, two-sided.

    Attributes
    ----------
    exponent : float
    ci95 : (float, float)
        Of the exponent.
    amplitude : float
        That of flicker would be a bias instability.
    density : (float, float)
        95 % interval of the noise density beside it, whatever the exponent may be.
    dt : float
        Sample interval in seconds.

    """

    exponent: float
    ci95: tuple[float, float]
    amplitude: float
    density: tuple[float, float]
    dt: float

    def of(self, groups: Groups) -> Groups:
        """Return the groups with the law in the place of flicker."""
        return with_exponent(groups, self.dt, self.exponent)

    def of_record(self, record: Spectrum) -> Spectrum:
        """Return a spectrum of which all fits have the law in the place of flicker."""
        own = tuple(replace(one, bins=with_exponent(one.bins, self.dt, self.exponent))
                    for one in record.records)
        return JointSpectrum(own) if isinstance(record, JointSpectrum) else own[0]

    def of_parts(self, parts: Spectra) -> Spectra:
        """Return what gives the spectra of parts of the record, with the law in them."""
        return lambda: [self.of(part) for part in parts()]

    def of_calmed(self, calmed: Calmed) -> Calmed:
        """Do the same where the parts are asked for without a course of the mean."""
        def exchanged(course: Course) -> tuple[Steadiness | None, Spectra]:
            steady, parts = calmed(course)
            return steady, self.of_parts(parts)

        return exchanged

    def bound(self, estimates: Mapping[str, Estimate], groups: Groups) -> dict[str, Estimate]:
        """
        Tell the terms beside the law.

        Parameters
        ----------
        estimates : mapping of term key to Estimate
            Of a fit in which it has the place of flicker.
        groups : Groups
            Of the record.

        Returns
        -------
        dict of term key to Estimate
            The noise density with the doubt about the exponent. The bias instability is bounded
            by what a reader of the curve would take for it, its lowest point: more flicker cannot
            be in the noise.

        """
        density, amplitude = estimates['noise_density'], estimates['bias_instability']
        walk = estimates['rate_random_walk']
        if density.observable:
            low, high = self.density
            density = replace(density, low=min(low, density.low), high=max(high, density.high),
                              upper=max(high, density.upper))
        # The averaging times of a curve: octaves, up to half of the record.
        most = np.log2(max(1 / (4 * float(groups.frequency[0]) * self.dt), 1.0))
        tau = self.dt * np.exp2(np.arange(int(most) + 1))
        lowest = np.min(density.upper**2 / tau + (walk.high if walk.observable else 0)**2 * tau / 3
                        + power_law_avar(amplitude.upper, self.exponent, tau))
        return {**estimates, 'noise_density': density, 'bias_instability': Estimate(
            False, 0.0, 0.0, 0.0, float(np.sqrt(lowest)) / FLICKER_FLOOR)}


def with_exponent(spectrum: Columns, dt: float, exponent: float) -> Columns:
    """
    Put f^-exponent of unit amplitude in the place of flicker.

    What gaps and the ends of a record do to noise is taken to be what they do to flicker: of
    exponents from 0.5 to 1.5 the first coefficient differs by 7 %, the third by 2 %.
    """
    nu = np.minimum(spectrum.frequency * dt, 0.5)
    design = spectrum.design.copy()
    design[:, FLICKER] *= power_law(nu, dt, exponent) / flicker(nu, dt)
    return replace(spectrum, design=design)


def free_exponent(groups: Groups, dt: float, other: Trial) -> PowerLaw | None:
    """
    Fit the whole band with an exponent of its own in the place of flicker.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    dt : float
        Sample interval in seconds.
    other : Trial
        How the terms manage otherwise: in part of the band, by a roll-off, or with a process.

    Returns
    -------
    PowerLaw or None
        None where the exponent leaves the whole band undescribed, lies at an end of what is
        tried, or explains the band hardly better than a roll-off or a low-pass over all terms
        does, or not as well as that process.

    """
    start = start_in_band(other, rolling=False)
    rolling = fit_band(groups, None, rolling=True, start=start_in_band(other, rolling=True))
    limit = rolling.solution.loss - _OBSERVABLE_EXPONENT / 2
    search = _Search(groups, dt, start)
    if search.is_hopeless(limit):
        return None
    best = search.likeliest()
    if not TRIED[0] + _AT_END < best < TRIED[-1] - _AT_END:
        return None
    trial = fit_columns(with_exponent(groups, dt, best), None, False, search.near)
    if trial.p_value < BENT_P or trial.solution.loss > limit:
        return None
    if not other.bent and other.solution.loss < trial.solution.loss:
        return None
    low_passed = likeliest_low_passed(groups, dt, start)
    if 2 * (low_passed - trial.solution.loss) < _OBSERVABLE_EXPONENT:
        return None
    return search.interval(best, trial.dispersion)


def likeliest_exponent(groups: Groups, dt: float, start: Solution) -> float:
    """
    Fit white noise and slow noise of the likeliest exponent.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    dt : float
        Sample interval in seconds.
    start : Solution
        A fit of the terms.

    Returns
    -------
    float
        The loss: the negative logarithm of the likelihood.

    """
    search = _Search(groups, dt, start)
    return search.at(search.likeliest()).loss


class _Search:
    """The likelihood as a function of the exponent, without quantization noise."""

    def __init__(self, groups: Groups, dt: float, start: Solution) -> None:
        self._groups, self._dt = groups, dt
        self._fixed: dict[int, float] = {QUANTIZATION: 0.0}
        self.near = start

    def at(self, exponent: float, limit: float = np.inf) -> Solution:
        """Fit the other terms beside an exponent."""
        self.near = maximise(with_exponent(self._groups, self._dt, exponent), self.near,
                             fixed=self._fixed, trend='restricted', tolerance=1e-3, limit=limit)
        return self.near

    def is_hopeless(self, limit: float) -> bool:
        """
        Whether no exponent comes below a loss, with quantization noise or without.

        Refining the best of those tried gains an eighth of what one beside it has lost if the
        loss is a parabola; here it may gain all of it.
        """
        losses = [self.at(one, limit).loss for one in TRIED]
        best = int(np.argmin(losses))
        lost = max(losses[max(best - 1, 0):best + 2]) - losses[best]
        every = maximise(with_exponent(self._groups, self._dt, TRIED[best]), self.near,
                         trend='restricted', tolerance=1e-3, limit=limit)
        return every.loss - lost > limit

    def likeliest(self) -> float:
        """Return the likeliest exponent, without a walk that hardly explains more."""
        free, loss = self._lowest()
        self._fixed[WALK] = 0.0
        still, more = self._lowest()
        if 2 * (more - loss) < OBSERVABLE:
            return still
        del self._fixed[WALK]
        return free

    def _lowest(self) -> tuple[float, float]:
        """Exponent of the lowest loss, and that loss."""
        def loss(exponent: float) -> float:
            return self.at(float(exponent)).loss

        return lowest_near(loss, TRIED, int(np.argmin([loss(one) for one in TRIED])), 1e-3)

    def interval(self, best: float, dispersion: float) -> PowerLaw:
        """Return the law with the intervals of the exponent, and of the density beside it."""
        loss = self.at(best).loss
        amplitude = float(np.sqrt(self.near.theta[FLICKER]))

        def rise(distance: float, side: int = 1) -> float:
            # Where the noise passes for white or for a walk nothing changes any more.
            exponent = min(max(best + side * distance, 0.0), 2.0)
            return 2 * max(self.at(exponent).loss - loss, 0.0) / dispersion

        low, high = (best + side * crossing(partial(rise, side=side), 0.0, _ERROR, CI95)
                     for side in (-1, 1))
        low, high = max(low, 0.0), min(high, 2.0)
        ends: list[float] = []
        for exponent in np.linspace(low, high, _SIDES):
            # What the ratio leaves to the density at this exponent.
            left = float(np.sqrt(max(CI95 - rise(float(exponent) - best), 0.0)))
            value = float(np.sqrt(self.near.theta[WHITE]))
            beside = Trial(with_exponent(self._groups, self._dt, float(exponent)), self.near,
                           self._fixed, None, False, 1.0, 0.0, dispersion)
            error = left * spread(beside, self.near, WHITE)
            ends += [value - error, value + error]
        return PowerLaw(best, (low, high), amplitude, (max(min(ends), 0.0), max(ends)), self._dt)
