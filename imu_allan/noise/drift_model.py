# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Drift model of one axis, which predicts the sensor and therefore suits filters.

The five noise coefficients serve to compare a sensor with its datasheet. They predict poorly:
flicker has no state in a filter, and real sensors drift in ways that no power law describes. The
drift model is the sum of white noise, a random walk and at most four first-order Gauss-Markov
processes. It is fitted to the part of the same spectrum that the terms describe well.

Where the record is not informative, two measures keep the model safe. The weight of a half-octave
is limited to what a misfit of 10 % allows. Also, its power is shrunk towards a fit of white noise,
flicker and random walk. That fit is the mean of the best one and one whose random walk is a
standard error larger. No trend is fitted: it does not improve predictions reliably, and ruins
those from short records.

References
----------
C. W. Granger and R. Joyeux, J. Time Ser. Anal. 1 (1980), and M. S. Keshner, "1/f noise", Proc.
IEEE 70 (1982): flicker as a sum of relaxation processes.

"""

from dataclasses import replace
from functools import cache, partial

from imu_allan.arrays import Array
from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.posterior.maximum import maximise, Solution
from imu_allan.noise.record.groups import FLICKER, Groups, QUANTIZATION, RANDOM_WALK, WHITE
from imu_allan.noise.spectrum import gauss_markov
from imu_allan.result import DriftModel, GaussMarkov, Tone
import numpy as np
from numpy.typing import ArrayLike

_MISFIT = 0.1
"""Misfit that limits the weight of a half-octave; else one at the fast end would dominate."""
_FEWEST_GROUPS = 8
"""Fewest groups, eight to an octave, that separate a process from white noise (by judgment)."""


def fit_drift_model(groups: Groups, dt: float, correlation_time_s: float | None = None
                    ) -> DriftModel | None:
    """
    Fit the drift model of one axis: equation (8) of docs/statistics.md.

    Parameters
    ----------
    groups : Groups
        Spectrum of the axis without lines.
    dt : float
        Sample interval in seconds.
    correlation_time_s : float, optional
        Correlation time of a Gauss-Markov process that was found beside the terms.

    Returns
    -------
    DriftModel or None
        None if the spectrum has too few bands. The model holds for horizons from the reciprocal
        of the band edge to a third of the record.

    Examples
    --------
    >>> from imu_allan import characterize, simulate
    >>> axis = characterize(simulate({'noise_density': 1e-3}, 60_000, 100.0), 100.0)
    >>> bool(0.98e-3 < axis.drift_model.noise_density < 1.02e-3)
    True

    """
    if len(groups.dof) < _FEWEST_GROUPS:
        return None
    # Processes slower than a third of the record look like a random walk.
    longest = 1 / (2 * float(groups.frequency[0])) / 3
    expected = groups
    if correlation_time_s is not None:
        expected = replace(groups, design=np.column_stack(
            (groups.design, _process(groups, dt, correlation_time_s))))
    edge, band, terms = _edge(expected, dt)
    smooth = _shrunk(band, terms)
    # Try two correlation times per decade.
    count = max(int(np.floor(2 * np.log10(longest * edge))) + 1, 1)
    shortest = max(1 / edge, 2 * dt)
    times = shortest * 10 ** (np.arange(count) / 2)
    times, solution = _pruned(smooth, dt, times[times <= longest])
    variances = solution.theta[2:]
    processes = tuple(GaussMarkov(float(np.sqrt(variance)), float(time))
                      for variance, time in zip(variances, times, strict=True))
    return DriftModel(float(np.sqrt(solution.theta[0])), float(np.sqrt(solution.theta[1])),
                      processes, shortest, max(longest, shortest))


def drift_avar(model: DriftModel, tones: tuple[Tone, ...], tau_s: ArrayLike) -> Array:
    """
    Allan variance of a drift model, including the lines that were left out of its fit.

    Parameters
    ----------
    model : DriftModel
        Drift model of one axis.
    tones : tuple of Tone
        Lines of the same axis.
    tau_s : array_like, shape (n,)
        Averaging times in seconds.

    Returns
    -------
    ndarray, shape (n,)
        In the squared unit of a sample: (2) of docs/statistics.md for the spectrum (8).

    Examples
    --------
    >>> from imu_allan.result import GaussMarkov
    >>> model = DriftModel(1e-3, 0.0, (GaussMarkov(1e-4, 100.0),), 0.1, 1e4)
    >>> np.sqrt(drift_avar(model, (), [1.0, 189.0]))
    array([1.00003308e-03, 9.54064436e-05])

    """
    # A cluster of one sample of that length: without a low-pass, only the length matters.
    return FittedModel({'noise_density': model.noise_density,
                        'rate_random_walk': model.rate_random_walk},
                       processes=model.processes, lines=tones).allan_variance(tau_s, 1.0)


def _process(groups: Groups, dt: float, time: float) -> Array:
    """Return the power of a process of unit sigma, shape (groups,)."""
    nu = np.minimum(groups.frequency * dt, 0.5)
    return np.asarray(groups.design[:, WHITE] * dt * gauss_markov(nu, dt, time))


def _edge(groups: Groups, dt: float) -> tuple[float, Groups, Solution]:
    """Return the highest edge below which N, B and K fit, the spectrum up to it, and the fit."""
    # For sample rates below 20 Hz, the edges scale with the rate.
    scale = min(1.0, 1 / (dt * 20))
    edge, band, terms = 0.0, groups, None
    # Vibration, low-passes and tones of quantizers lie above.
    for hz in (10.0, 5.0, 2.5, 1.25, 0.625):
        below = groups.below(hz * scale)
        if len(below.dof) < _FEWEST_GROUPS and terms is not None:
            break
        edge = hz * scale
        band = (below if len(below.dof) >= _FEWEST_GROUPS else groups).capped(_MISFIT)
        terms = maximise(band, fixed={QUANTIZATION: 0.0})
        octave, dof = below.half_octaves()
        ratio = below.power / np.maximum(below.design @ terms.theta, 1e-300)
        mean = np.bincount(octave, below.dof * ratio) / dof
        # Allow 20 % of the power in addition to sampling error at a level of 1 %.
        allowed = 0.2 + 2.6 * np.sqrt(2 / dof)
        # The mean is zero in a spectrum without noise.
        off = np.abs(np.log(np.maximum(mean, 1e-300)))
        # The fit must describe the six half-octaves below the edge.
        if np.all(off < allowed, where=np.arange(len(dof)) >= len(dof) - 6):
            break
    assert terms is not None
    return edge, band, terms


def _shrunk(band: Groups, terms: Solution) -> Groups:
    """Shrink the power of each half-octave towards a fit of white noise, flicker, random walk."""
    most = _most_random_walk(band, terms)
    prior = band.design @ (terms.theta + most.theta) / 2
    octave, dof = band.half_octaves()
    # Four pseudo-observations per half-octave: with fewer, short records give spurious drift.
    pseudo = 4.0 * band.dof / dof[octave]
    counted = band.dof + pseudo
    return replace(band, dof=counted, power=(band.dof * band.power + pseudo * prior) / counted)


def _most_random_walk(band: Groups, best: Solution) -> Solution:
    """Fit the terms with the random walk one standard error above its best value."""
    columns = band.design[:, [WHITE, FLICKER, RANDOM_WALK]] / (band.design @ best.theta)[:, None]
    scale = np.sqrt(np.sum(band.dof[:, None] * columns**2 / 2, axis=0))
    columns /= scale
    inverse = np.linalg.pinv(columns.T @ (band.dof[:, None] * columns / 2))
    most = best.theta[RANDOM_WALK] + float(np.sqrt(inverse[2, 2])) / scale[2]
    return maximise(band, best.theta, fixed={QUANTIZATION: 0.0, RANDOM_WALK: most}, tolerance=1e-3)


def _pruned(band: Groups, dt: float, times: Array) -> tuple[Array, Solution]:
    """Fit processes of given correlation times, and keep the at most four that matter most."""
    power = cache(partial(_process, band, dt))

    def fitted(of: Array, start: Array | None = None, tolerance: float = 1e-7) -> Solution:
        columns = (band.design[:, WHITE], band.design[:, RANDOM_WALK], *map(power, of.tolist()))
        return maximise(replace(band, design=np.stack(columns, axis=1)), start,
                        tolerance=tolerance)

    def there(of: Array, found: Solution) -> tuple[Array, Solution]:
        seen = found.theta > 0
        seen[:2] = True
        return of[seen[2:]], found._replace(theta=found.theta[seen])

    times, solution = there(times, fitted(times))
    # Each process is a filter state and costs time; a fifth one improved no recording tried.
    while len(times) > 4:
        theta = solution.theta
        fewer = [(np.delete(times, i), np.delete(theta, 2 + i)) for i in range(len(times))]
        fewer += [_joined(times, theta, i) for i in range(len(times) - 1)]
        # Fit all candidate sets roughly, then the best ones fully.
        rough = [fitted(*some, tolerance=0.01) for some in fewer]
        near = min(found.loss for found in rough) + 0.02
        times, solution = min((there(of, fitted(of, found.theta))
                               for (of, _), found in zip(fewer, rough, strict=True)
                               if found.loss <= near), key=lambda found: found[1].loss)
    return times, solution


def _joined(times: Array, theta: Array, at: int) -> tuple[Array, Array]:
    """Merge two neighbouring processes into one, at the weighted mean of their log times."""
    pair, variances = slice(at, at + 2), slice(at + 2, at + 4)
    mean = np.exp(np.average(np.log(times[pair]), weights=theta[variances]))
    return (np.concatenate((times[:at], [mean], times[at + 2:])),
            np.concatenate((theta[:at + 2], [theta[variances].sum()], theta[at + 4:])))
