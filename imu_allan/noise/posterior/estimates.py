# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Presence, value, interval and bound of each quantity, from a posterior, in SI units."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from imu_allan.arrays import Array, Bools
from imu_allan.noise.posterior import likelihood, thresholds_and_priors as thresholds
from imu_allan.noise.posterior.likelihood import (
    ALPHA,
    B,
    HIGH,
    K,
    LAW,
    LOW,
    N,
    OUTPUT,
    PLAIN,
    PROCESS,
    Q,
    SMOOTH,
    TIME,
)
from imu_allan.noise.posterior.posterior import Drawn, Posterior
from imu_allan.noise.posterior.shapes import EXPONENTIAL_AVERAGE, LOW_PASSES, TERM_SHAPES, WHITE
from imu_allan.noise.terms import TERMS
from imu_allan.noise.trends.kinds import Found, waveforms
from imu_allan.noise.trends.leakage import Waveform
from imu_allan.noise.trends.regressors import RecordSpectrum
from imu_allan.result import Interval
import numpy as np
from scipy.special import ndtr, ndtri

_ENDS = (0.025, 0.5, 0.975)
"""Probabilities of the quantiles that are the lower end, the value and the upper end."""


@dataclass(frozen=True)
class Estimate:
    """
    Marginal posterior of one quantity, in SI units.

    Attributes
    ----------
    observable : bool
        Whether a value is reported.
    value, low, high : float
        Median and 95 % interval, given presence.
    upper : float
        Upper bound, for use where no value is reported.
    presence : float
        Probability of presence.

    """

    observable: bool
    value: float
    low: float
    high: float
    upper: float
    presence: float = 1.0

    @property
    def interval(self) -> Interval:
        """Return the 95 % interval."""
        return self.low, self.high


class ReportedTrend(NamedTuple):
    """A trend of the mean that is reported, with size and standard error of each column."""

    trend: Found
    columns: tuple[tuple[float, float], ...]


def marginals(posterior: Posterior, dt: float) -> dict[str, Estimate]:
    """
    Compute the marginal posteriors of one axis from its draws.

    `dt`: sample interval in seconds. Returns: by key of `TERMS`, all but the ramp. Besides, the
    standard deviation and correlation time of a Gauss-Markov process, ``sigma`` and
    ``correlation_time``; ``exponent`` and ``amplitude`` of slow noise whose exponent is not that
    of flicker; and ``corner``, in Hz, of a filter that removes the bias.
    """
    models, best = posterior.models, posterior.models[0]
    weight = np.concatenate([model.weight * model.draws.share for model in models])
    x = np.concatenate([model.draws.x for model in models])
    present = np.repeat(np.concatenate([model.row.present for model in models]),
                        [len(model.draws.share) for model in models], axis=0)
    # That the prior takes flicker for granted beside slower noise is no evidence of flicker.
    shown = weight * np.exp(-likelihood.without_flicker(present))
    law, process = _free_amplitudes(best, x, present)
    amplitude = np.exp(np.minimum(x[:, :PLAIN], 60.0)) * best.limit
    with_law = present[:, LAW]
    if with_law.any():
        amplitude[with_law, B] = _as_flicker(best, law[with_law], x[with_law, ALPHA])
        present[with_law, B] = True
    # Output noise, added after a filter, is part of the level in its pass band.
    amplitude[:, N] = np.hypot(amplitude[:, N],
                               np.where(present[:, OUTPUT], amplitude[:, OUTPUT], 0.0))
    low, high = quantiles(amplitude[:, N], weight, (_ENDS[0], _ENDS[-1]))
    amplitude[:, N] *= posterior.change.factors(len(x))
    found = {shape.key: _estimate(
        amplitude[:, k], present[:, k], shown if k == B else weight,
        thresholds.REPORTED if k == Q else thresholds.OBSERVABLE, float(best.limit[k]))
        for k, shape in enumerate(TERM_SHAPES) if shape.key in TERMS}
    # Without its change over the record, which widens the interval but hides nothing.
    if low <= 0 or high / low > thresholds.WIDEST:
        found[WHITE] = replace(found[WHITE], observable=False)
    alpha = x[:, ALPHA]
    for key, values, slot in (
            ('sigma', process, PROCESS), ('correlation_time', np.exp(x[:, TIME]) * dt, PROCESS),
            ('exponent', alpha, LAW), ('amplitude', law * dt**((1 - alpha) / 2), LAW),
            ('corner', np.exp(x[:, HIGH]) / dt, HIGH)):
        found[key] = _estimate(values, present[:, slot], weight, thresholds.REPORTED)
    return found


def weight_of(posterior: Posterior, condition: Callable[[Drawn], bool]) -> float:
    """Return the total weight of the models that meet a condition."""
    return float(sum(model.weight for model in posterior.models if condition(model)))


def bends(model: Drawn) -> bool:
    """Return whether a model has a detectable low-pass, or leaves the top unexplained."""
    row, spectra = model.row, model.spectra
    gentle = row.low_pass[0] == EXPONENTIAL_AVERAGE \
        and row.x[0, LOW] > spectra.gentlest_corner[model.spectrum] - 0.7
    return bool(row.edge[0] < spectra.dof.shape[1] or (model.has(LOW) and not gentle))


def drifts(model: Drawn) -> bool:
    """Return whether a model has anything slower than flicker."""
    return bool(model.has(*likelihood.SLOWER, LAW) or model.trends)


def _free_amplitudes(best: Drawn, x: Array, present: Bools) -> list[Array]:
    """Return the amplitudes of each free term in the draws, zero where absent."""
    found = []
    for number, (slot, nuisance) in enumerate(likelihood.FREE_SLOTS):
        amplitude, own = np.zeros(len(x)), present[:, slot]
        limits = best.spectra.free_log_limits[number][best.spectrum]
        log_limit, _ = best.spectra.tables.terms[number].interpolated(
            np.zeros(int(own.sum()), np.int64), x[own, nuisance], rows=limits[:, None])
        amplitude[own] = np.exp(np.minimum(x[own, slot] + log_limit[:, 0], 60.0))
        found.append(amplitude)
    return found


def _as_flicker(best: Drawn, amplitude: Array, alpha: Array) -> Array:
    """
    Return the flicker that stands for slow noise of other exponents.

    Their power is equal at the frequency that halves the information about flicker.
    """
    spectra, of = best.spectra, best.spectrum
    present, x = best.row.present.copy(), best.row.x.copy()
    if not present[0, B]:
        # Far below the detection limit.
        present[0, B], x[0, B] = True, -10.0
    power, slopes, used = likelihood.model_spectrum(spectra, replace(best.row, present=present), x)
    relative = slopes[np.searchsorted(used, B), 0] / power[0]
    information = np.cumsum(spectra.dof[of] * relative**2)
    middle = int(np.searchsorted(information, information[-1] / 2))
    table = spectra.tables.terms[0]
    law, _ = table.interpolated(
        np.zeros(len(alpha), np.int64), alpha, rows=table.rows[:, [middle]])
    flicker = np.log(spectra.design[of, B, middle]) - 2 * np.log(best.limit[B])
    return np.asarray(amplitude * np.exp(
        0.5 * (law[:, 0] + spectra.log_effect[of, 0, middle] - flicker)))


def _estimate(values: Array, present: Bools, weight: Array, least: float,
              limit: float = 0.0) -> Estimate:
    """Estimate presence, and the quantiles given presence; `limit` is the detection limit."""
    presence = min(float(weight[present].sum() / weight.sum()), 1.0)
    low, value, high = (quantiles(values[present], weight[present], _ENDS) if presence > 1e-9
                        else (0.0, 0.0, 0.0))
    # No bound is lower than 1.4 times the detection limit.
    return Estimate(presence > least, value, low, high, max(high, 1.4 * limit), presence)


def quantiles(values: Array, weight: Array, shares: tuple[float, ...]) -> tuple[float, ...]:
    """
    Quantiles of weighted draws.

    Examples
    --------
    >>> quantiles(np.array([3.0, 1.0, 2.0]), np.ones(3), (0.5,))
    (2.0,)

    """
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return tuple(np.interp(np.array(shares) * total[-1], total - 0.5 * weight[order],
                           values[order]).tolist())


def _regressed(model: Drawn) -> tuple[Array, Array, Array]:
    """
    Return sizes and standard errors of all regressors in draws of a model, and the weights.

    The ramp is the first, the trends of the model are the last.
    """
    # The 32 draws of the largest weight are enough.
    most = np.argsort(-model.draws.share, kind='stable')[:32]
    share = model.draws.share[most]
    return model.draws.size[most], model.draws.error[most], share / share.sum()


def ramp_of(posterior: Posterior, record: RecordSpectrum | None) -> Estimate:
    """
    Estimate the signed ramp of a single record; several records have no common one.

    `record`: to include the uncertainty of other trends' nuisances.
    """
    none = Estimate(False, 0.0, 0.0, 0.0, np.nan, 0.0)
    if posterior.models[0].spectra.records > 1:
        return none
    found = []
    for model in posterior.models:
        if model.weight <= 0.01:
            continue
        sizes, errors, share = _regressed(model)
        if record is not None and model.trends:
            sizes, errors = (each[None] for each in _with_nuisances(model, record))
            share = np.ones(1)
        found.append((sizes[:, 0], errors[:, 0], model.weight * share,
                      np.full(len(share), model.has(K))))
    size, error, weight, with_walk = map(np.concatenate, zip(*found, strict=True))
    if not np.isfinite([size, error]).all() or not size.any():
        return none
    # Standard normal quantiles of equal weight; the outermost lie beyond a 95 % interval.
    normal = ndtri((np.arange(64) + 0.5) / 64)
    low, median, high = quantiles((size[:, None] + error[:, None] * normal).ravel(),
                                  np.repeat(weight / len(normal), len(normal)), _ENDS)
    # The other sign is a matter of the tails, which a few quantiles do not resolve.
    opposite = ndtr(-size * np.sign(median) / np.maximum(error, np.finfo(float).tiny))
    # A random walk drifts as well: the ramp must be as certain in the models that contain one.
    p_opposite = max(float(weight[own] @ opposite[own] / weight[own].sum())
                     for own in (np.ones(len(with_walk), dtype=bool), with_walk) if own.any())
    return Estimate(p_opposite < thresholds.CERTAIN_RAMP, median, low, high,
                    max(abs(low), abs(high)), max(1 - 2 * p_opposite, 0.0))


def reported_trends(posterior: Posterior, record: RecordSpectrum | None
                    ) -> tuple[ReportedTrend, ...]:
    """
    Return the trends of the mean to report, each from its most probable model.

    `record`: to include the uncertainty of the nuisances in that of the sizes.
    """
    weight: dict[str, float] = defaultdict(float)
    for model in posterior.models:
        for key in {trend.kind.key for trend in model.trends}:
            weight[key] += model.weight
    found: list[ReportedTrend] = []
    for model in posterior.models:
        earlier = {one.trend.kind.key for one in found}
        for number, trend in enumerate(model.trends):
            if trend.kind.key in earlier or weight[trend.kind.key] <= thresholds.REPORTED:
                continue
            # Of the regressors, the trends are the last.
            last = sum(each.width for each in model.trends[number:])
            own = slice(-last, trend.width - last or None)
            sizes, errors, share = _regressed(model)
            size = share @ sizes[:, own]
            error = np.sqrt(share @ (errors**2 + sizes**2)[:, own] - size**2)
            if record is not None:
                error = np.fmax(error, _with_nuisances(model, record)[1][own])
            columns = zip(size.tolist(), error.tolist(), strict=True)
            found.append(ReportedTrend(trend, tuple(columns)))
    return tuple(found)


def _with_nuisances(model: Drawn, record: RecordSpectrum) -> tuple[Array, Array]:
    """Return sizes and standard errors of all regressors, beside nuisances that are not known."""
    slopes = [slope for trend in model.trends
              for slope in trend.kind.slopes(trend.value, record.duration_s)]
    groups = record.groups(*slopes, *waveforms(model.trends, record.duration_s))
    spectra = model.spectra.with_regressors([groups], model.row.spectrum)
    row = replace(model.row, spectrum=np.zeros(1, np.int64))
    *_, size, covariance = likelihood.fitted_mean(spectra, row, row.x)
    return size[0, 0], np.sqrt(np.diag(covariance[0, 0]))


def fitted_trend(posterior: Posterior, record: RecordSpectrum) -> tuple[Waveform, Array] | None:
    """
    Return the mean of the most probable model, and the power of its noise in the bins.

    None if the model contains no trend but the ramp.
    """
    best = posterior.models[0]
    if best.has(SMOOTH):
        # Smooth drift may be a listed trend that leaks into blocks, so prefer a model with trends.
        best = next((model for model in posterior.models if model.trends), best)
    if not best.trends:
        return None
    sizes, _, share = _regressed(best)
    size, fitted = share @ sizes, record.with_trends(waveforms(best.trends, record.duration_s))
    noise = np.exp(np.interp(np.log(record.bins.frequency), np.log(best.spectra.frequency),
                             np.log(expected(best)[0])))
    return fitted.mean(np.append(size[0], size[-len(fitted.trends):])), noise


def expected(model: Drawn) -> tuple[Array, Array]:
    """Return the expected power of a model by group, and the power of its white noise."""
    power, slopes, used = likelihood.model_spectrum(model.spectra, model.row, model.row.x)
    # The derivative by a log amplitude is twice the power of the term.
    return power[0], slopes[np.isin(used, (N, OUTPUT)), 0].sum(axis=0) / 2


def leaks_from_ends(posterior: Posterior, record: RecordSpectrum) -> bool:
    """Return whether quantization noise at both ends of a record is a tenth of a coefficient."""
    model = next((model for model in posterior.models if model.has(Q)), None)
    parts = sum(section.coefficients is not None for section in record.sections)
    # Each part between long gaps has ends of its own.
    if model is None or parts != 1:
        return False
    leak = np.exp(2 * model.row.x[0, Q]) * model.limit[Q]**2 * record.leak_of_ends
    power = np.interp(record.bins.frequency, model.spectra.frequency, expected(model)[0])
    return bool((leak > 0.1 * power).any())


def filtered(posterior: Posterior) -> Drawn | None:
    """Return the most probable model with a filter, if there probably is one, or with an edge."""
    if posterior.edge is None and weight_of(posterior, bends) <= thresholds.OBSERVABLE:
        return None
    return next((model for model in posterior.models if bends(model)), posterior.models[0])


def passed_by(model: Drawn) -> tuple[Array, Array]:
    """Return frequencies, and the share of white noise that the filter of a model passes."""
    row, spectra, of = model.row, model.spectra, model.spectrum
    white = [slot for slot in (N, OUTPUT) if model.has(slot)]
    in_front = np.exp(2 * row.x[0, white]) @ spectra.design[of, white]
    _, behind = expected(model)
    # No model describes the top above an edge, so it is as measured.
    top = (np.arange(len(behind)) >= row.edge[0]) & (spectra.nominal_dof[of] > 0)
    return spectra.frequency, np.where(top, spectra.power[of], behind) / in_front


def window_of(model: Drawn, edge: int | None, dt: float) -> float:
    """Return the width of the boxcar that attenuates white noise like a model below an edge."""
    below = model.spectra.frequency[:edge]
    if model.has(LOW):
        # Groups of means also lack what folds into them elsewhere.
        passed = LOW_PASSES[int(model.row.low_pass[0])].power(below * dt, model.row.x[0, LOW])
        at = int(np.argmin(np.abs(passed - 0.9)))
        if passed[at] < 1:
            # Samples are averages over dt already: the widths add in quadrature.
            return float(np.hypot(np.sqrt(3 * min(1 - passed[at], 1.0)) / (np.pi * below[at]), dt))
    return float(1 / (2 * below[-1]))
