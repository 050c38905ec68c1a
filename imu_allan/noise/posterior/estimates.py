# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Presence, value, interval and bound of each quantity, from a posterior, in SI units."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from imu_allan.arrays import Array, Bools
from imu_allan.noise.posterior import thresholds_and_priors as thresholds
from imu_allan.noise.posterior.likelihood import (
    ALPHA,
    B,
    fitted_mean,
    GENTLE_FAMILY,
    HIGH,
    K,
    LAW,
    LOW,
    N,
    OUTPUT,
    PLAIN,
    PROCESS,
    Q,
    SLOWER,
    SMOOTH,
    spectrum,
    TIME,
)
from imu_allan.noise.posterior.posterior import Drawn, Posterior
from imu_allan.noise.posterior.shapes import cubic, FREE_SHAPES, TERM_SHAPES, WHITE
from imu_allan.noise.posterior.trend_search import Found, waveforms
from imu_allan.noise.terms import TERMS
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
    models = posterior.models
    weight = np.concatenate([model.weight * model.draws.share for model in models])
    x = np.concatenate([model.draws.x for model in models])
    has = np.repeat(np.concatenate([model.row.has for model in models]),
                    [len(model.draws.share) for model in models], axis=0)
    size = _free_amplitudes(posterior, x, has)
    amplitude, there = _amplitudes(posterior, x, has, size[:, 0])
    # Output noise, added after a filter, is part of the level in its pass band.
    amplitude[:, N] = np.hypot(amplitude[:, N],
                               np.where(there[:, OUTPUT], amplitude[:, OUTPUT], 0.0))
    low, high = quantiles(amplitude[:, N], weight, (_ENDS[0], _ENDS[-1]))
    amplitude[:, N] *= posterior.change.factors(len(x))
    unit = models[0].spectra.unit[int(models[0].row.of[0])]
    found = {shape.key: _estimate(amplitude[:, k], there[:, k], weight,
                                  thresholds.REPORTED if k == Q else thresholds.OBSERVABLE,
                                  float(unit[k]))
             for k, shape in enumerate(TERM_SHAPES) if shape.key in TERMS}
    # Without its change over the record, which widens the interval but hides nothing.
    if low <= 0 or high / low > thresholds.WIDEST:
        found[WHITE] = replace(found[WHITE], observable=False)
    law, process, alpha = has[:, LAW], has[:, PROCESS], x[:, ALPHA]
    for key, values, own in (
            ('sigma', size[:, 1], process),
            ('correlation_time', np.exp(x[:, TIME]) * dt, process),
            ('exponent', alpha, law),
            ('amplitude', size[:, 0] * dt**((1 - alpha) / 2), law),
            ('corner', np.exp(x[:, HIGH]) / dt, has[:, HIGH])):
        found[key] = _estimate(values, own, weight, thresholds.REPORTED)
    return found


def weight_of(posterior: Posterior, which: Callable[[Drawn], bool]) -> float:
    """Return the total weight of the models for which `which` is true."""
    return float(sum(model.weight for model in posterior.models if which(model)))


def bends(model: Drawn) -> bool:
    """Return whether a model has a detectable low-pass, or leaves the top unexplained."""
    gentle = model.row.family[0] == GENTLE_FAMILY \
        and model.row.x[0, LOW] > model.spectra.gentle[model.row.of[0]] - 0.7
    return bool(model.row.edge[0] < model.spectra.dof.shape[1]
                or (model.row.has[0, LOW] and not gentle))


def drifts(model: Drawn) -> bool:
    """Return whether a model has anything slower than flicker."""
    return bool(model.row.has[0, [*SLOWER, LAW]].any() or model.trends)


def _amplitudes(posterior: Posterior, x: Array, has: Bools, size: Array) -> tuple[Array, Bools]:
    """
    Return the amplitudes of the terms in each draw, and whether they are present.

    `size`: amplitudes of slow noise with another exponent than flicker.
    """
    best = posterior.models[0]
    spectra, of = best.spectra, int(best.row.of[0])
    unit = spectra.unit[of]
    amplitude = np.exp(np.minimum(x[:, :PLAIN], 60.0)) * unit
    there = has[:, :PLAIN].copy()
    law = has[:, LAW]
    if law.any():
        # Convert to flicker of equal power at the frequency that halves the information about it.
        beside, x_beside = best.row.has.copy(), best.row.x.copy()
        if not beside[0, B]:
            # Far below the detection limit.
            beside[0, B], x_beside[0, B] = True, -10.0
        lam, slopes, used = spectrum(spectra, replace(best.row, has=beside), x_beside)
        seen = slopes[np.searchsorted(used, B), 0] / lam[0]
        known = np.cumsum(spectra.dof[of] * seen**2)
        pivot = int(np.searchsorted(known, known[-1] / 2))
        table = spectra.tables.terms[0]
        place = table.place(np.zeros(int(law.sum()), np.int64), x[law, ALPHA])
        value = cubic(table.rows[:, [pivot]], *place)[0][:, 0]
        flicker = np.log(spectra.columns[of, B, pivot]) - 2 * np.log(unit[B])
        amplitude[law, B] = size[law] * np.exp(
            0.5 * (value + spectra.like[of, 0, pivot] - flicker))
        there[law, B] = True
    return amplitude, there


def _free_amplitudes(posterior: Posterior, x: Array, has: Bools) -> Array:
    """Return the amplitudes of the free terms in each draw, zero where absent."""
    best = posterior.models[0]
    spectra, of = best.spectra, int(best.row.of[0])
    size = np.zeros((len(x), len(FREE_SHAPES)))
    for k, table in enumerate(spectra.tables.terms):
        slot = PLAIN + 2 * k
        own = has[:, slot]
        place = table.place(np.zeros(int(own.sum()), np.int64), x[own, slot + 1])
        unit = cubic(spectra.sizes[k][of][:, None], *place)[0][:, 0]
        size[own, k] = np.exp(np.minimum(x[own, slot] + unit, 60.0))
    return size


def _estimate(values: Array, there: Bools, weight: Array, least: float,
              seen: float = 0.0) -> Estimate:
    """Estimate presence, and the quantiles given presence; `seen` is the detection limit."""
    presence = min(float(weight[there].sum() / weight.sum()), 1.0)
    low, value, high = (quantiles(values[there], weight[there], _ENDS) if presence > 1e-9
                        else (0.0, 0.0, 0.0))
    # No bound is lower than 1.4 times the detection limit.
    return Estimate(presence > least, value, low, high, max(high, 1.4 * seen), presence)


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
        size, error, share = _regressed(model)
        if record is not None and model.trends:
            size, error = (each[None] for each in _with_nuisances(model, record))
            share = np.ones(1)
        found.append((size[:, 0], error[:, 0], model.weight * share,
                      np.full(len(share), model.row.has[0, K])))
    size, error, weight, wandering = map(np.concatenate, zip(*found, strict=True))
    if not np.isfinite([size, error]).all() or not size.any():
        return none
    # Standard normal quantiles of equal weight; the outermost lie beyond a 95 % interval.
    normal = ndtri((np.arange(64) + 0.5) / 64)
    low, middle, high = quantiles((size[:, None] + error[:, None] * normal).ravel(),
                                  np.repeat(weight / len(normal), len(normal)), _ENDS)
    # The other sign is a matter of the tails, which a few quantiles do not resolve.
    otherwise = ndtr(-size * np.sign(middle) / np.maximum(error, np.finfo(float).tiny))
    # A random walk drifts as well: the ramp must be as certain in the models that contain one.
    other = max(float(weight[own] @ otherwise[own] / weight[own].sum())
                for own in (np.ones(len(wandering), dtype=bool), wandering) if own.any())
    bound = max(abs(low), abs(high))
    return Estimate(other < thresholds.CERTAIN_RAMP, middle, low, high, bound,
                    max(1 - 2 * other, 0.0))


def reported_trends(posterior: Posterior, record: RecordSpectrum | None
                    ) -> tuple[ReportedTrend, ...]:
    """
    Return the trends of the mean to report, each from its most probable model.

    `record`: to include the uncertainty of the nuisances in that of the sizes.
    """
    weight: dict[str, float] = defaultdict(float)
    for model in posterior.models:
        for key in {one.kind.key for one in model.trends}:
            weight[key] += model.weight
    found: list[ReportedTrend] = []
    for model in posterior.models:
        known = {one.trend.kind.key for one in found}
        for number, one in enumerate(model.trends):
            if one.kind.key in known or weight[one.kind.key] <= thresholds.REPORTED:
                continue
            size, error, share = _regressed(model)
            # Of the regressors, the trends are the last.
            left = sum(each.width for each in model.trends[number:])
            columns = tuple((float(share @ size[:, k]), float(np.sqrt(
                share @ (error[:, k]**2 + size[:, k]**2) - (share @ size[:, k])**2)))
                for k in range(-left, one.width - left))
            if record is not None:
                _, beside = _with_nuisances(model, record)
                columns = tuple((value, max(within, float(whole))) for (value, within), whole
                                in zip(columns, beside[-left:], strict=False))
            found.append(ReportedTrend(one, columns))
    return tuple(found)


def _with_nuisances(model: Drawn, record: RecordSpectrum) -> tuple[Array, Array]:
    """Return sizes and standard errors of all regressors, beside nuisances that are not known."""
    slopes = [slope for one in model.trends
              for slope in one.kind.slopes(one.value, record.duration_s)]
    groups = record.groups(*slopes, *waveforms(model.trends, record.duration_s))
    row = replace(model.row, of=np.zeros(1, np.int64))
    spectra = model.spectra.with_regressors([groups], model.row.of)
    _, _, size, covariance = fitted_mean(spectra, row, row.x)
    return size[0, 0], np.sqrt(np.diag(covariance[0, 0]))


def fitted_trend(posterior: Posterior, record: RecordSpectrum) -> tuple[Waveform, Array] | None:
    """
    Return the mean of the most probable model, and the power of its noise in the bins.

    None if the model contains no trend but the ramp.
    """
    best = posterior.models[0]
    if best.row.has[0, SMOOTH]:
        # Smooth drift may be a listed trend that leaks into blocks, so prefer a model with trends.
        best = next((model for model in posterior.models if model.trends), best)
    if not best.trends:
        return None
    trends = waveforms(best.trends, record.duration_s)
    size, _, share = _regressed(best)
    noise = np.exp(np.interp(np.log(record.bins.frequency), np.log(best.spectra.frequency),
                             np.log(expected(best)[0])))
    sizes, own = share @ size, record.with_trends(trends)
    return own.mean(np.append(sizes[0], sizes[-len(own.trends):])), noise


def expected(model: Drawn) -> tuple[Array, Array]:
    """Return the expected power of a model by group, and the power of its white noise."""
    lam, slopes, used = spectrum(model.spectra, model.row, model.row.x)
    return lam[0], slopes[np.isin(used, (N, OUTPUT)), 0].sum(axis=0) / 2


def leaks_from_ends(posterior: Posterior, record: RecordSpectrum) -> bool:
    """Return whether quantization noise at both ends of a record is a tenth of a coefficient."""
    model = next((one for one in posterior.models if one.row.has[0, Q]), None)
    parts = sum(section.coefficients is not None for section in record.sections)
    # Each part between long gaps has ends of its own.
    if model is None or parts != 1:
        return False
    unit = model.spectra.unit[int(model.row.of[0]), Q]
    leak = np.exp(2 * model.row.x[0, Q]) * unit**2 * record.leak_of_ends
    lam = np.interp(record.bins.frequency, model.spectra.frequency, expected(model)[0])
    return bool((leak > 0.1 * lam).any())


def filtered(posterior: Posterior) -> Drawn | None:
    """Return the most probable model with a filter, if there probably is one, or with an edge."""
    if posterior.edge is None and weight_of(posterior, bends) <= thresholds.OBSERVABLE:
        return None
    return next((model for model in posterior.models if bends(model)), posterior.models[0])


def passed_by(model: Drawn) -> tuple[Array, Array]:
    """Return frequencies, and the share of white noise that the filter of a model passes."""
    row, spectra, of = model.row, model.spectra, int(model.row.of[0])
    white = [slot for slot in (N, OUTPUT) if row.has[0, slot]]
    whole = np.exp(2 * row.x[0, white]) @ spectra.columns[of, white]
    _, behind = expected(model)
    # No model describes the top above an edge, so it is as measured.
    top = (np.arange(len(whole)) >= row.edge[0]) & (spectra.whole[of] > 0)
    return spectra.frequency, np.where(top, spectra.power[of], behind) / whole


def window_of(model: Drawn, edge: int | None, dt: float) -> float:
    """Return the width of the boxcar that attenuates white noise like a model below an edge."""
    spectra = model.spectra
    below = spectra.frequency[:edge]
    if model.row.has[0, LOW]:
        table = spectra.tables.low_pass
        value, _ = cubic(table.rows, *table.place(model.row.family, model.row.x[:, LOW]))
        passed = np.exp(value[0, :len(below)])
        at = int(np.argmin(np.abs(passed - 0.9)))
        if passed[at] < 1:
            # Samples are averages over dt already: the widths add in quadrature.
            return float(np.hypot(np.sqrt(3 * min(1 - passed[at], 1.0)) / (np.pi * below[at]), dt))
    return float(1 / (2 * below[-1]))
