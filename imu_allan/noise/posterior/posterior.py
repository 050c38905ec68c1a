# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Posterior over the noise models of each axis: weighted draws from all models that matter.

References
----------
E. B. Wilson and M. M. Hilferty, Proc. Natl. Acad. Sci. 17 (1931): the cube root of a chi-square.
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.draws import Draws, sample
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.level_change import Change, STEADY
from imu_allan.noise.posterior.likelihood import log_low_pass, LOW, Rows, Spectra
from imu_allan.noise.posterior.prepared_spectra import prepared
from imu_allan.noise.posterior.regression import residual_power
from imu_allan.noise.posterior.search import best_of, KEPT, search_models
from imu_allan.noise.posterior.thresholds_and_priors import DESCRIBED, SHAPE_MEDIAN, SHAPE_SPREAD
from imu_allan.noise.posterior.trend_search import fit_trends, Fitted
from imu_allan.noise.record.groups import Groups
from imu_allan.noise.trends.gains import Bank
from imu_allan.noise.trends.kinds import Found
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np


@dataclass(frozen=True)
class Drawn:
    """
    One noise model with its draws.

    Attributes
    ----------
    row : Rows
        The fitted model, a single row.
    spectra : Spectra
        Spectra that it was fitted to.
    trends : tuple of Found
        Trends of the mean that the model contains.
    draws : Draws
    weight : float
        Its share of the evidence of all models.

    """

    row: Rows
    spectra: Spectra
    trends: tuple[Found, ...]
    draws: Draws
    weight: float = 0.0

    @property
    def spectrum(self) -> int:
        """Return the index of the model's own spectrum in `spectra`."""
        return int(self.row.spectrum[0])

    @property
    def limit(self) -> Array:
        """Return the detection limits of the terms in SI units, shape (terms,)."""
        return np.asarray(self.spectra.limit[self.spectrum])

    def has(self, *slots: int) -> bool:
        """Return whether the model has any of some parameters."""
        return bool(self.row.present[0, slots].any())


@dataclass(frozen=True)
class Posterior:
    """
    Posterior of the noise of one axis.

    Attributes
    ----------
    models : tuple of Drawn
        Most probable first; their weights add up to 1.
    p_value, misfit : float
        Chi-square probability of the half-octave residuals of the best model, and their largest
        relative misfit beyond sampling error.
    edge : int or None
        Group from which on the best model leaves the spectrum unexplained, if any.
    change : Change
        How much the level of the noise changes over the record.

    """

    models: tuple[Drawn, ...]
    p_value: float
    misfit: float
    edge: int | None = None
    change: Change = STEADY


def posteriors(groups: Sequence[Groups], dt: float, records: Sequence[RecordSpectrum | None],
               bank: Bank | None = None) -> list[Posterior]:
    """
    Compute the posteriors over the noise models of several axes.

    `groups`: grouped spectrum of each axis, all over the same bands. `dt`: sample interval in
    seconds. `records`: that the groups were made of, to fit trends of the mean; None to fit none,
    as for several records joined. `bank`: trends to consider, of the same records; otherwise
    `TRENDS`.
    """
    spectra, starts = prepared(groups, dt)
    rows = search_models(spectra, starts, dt)
    axes = range(len(starts))
    fitted = Fitted(spectra, rows, np.array(axes), [()] * len(axes), groups)
    if bank is None and (some := next(filter(None, records), None)) is not None:
        bank = Bank(some)
    if bank is not None and (more := fit_trends(spectra, starts, rows, records, bank)):
        fitted = fitted.joined(more)
    judged = [_judged(fitted.spectra, fitted.rows.take(fitted.row_axis == axis).best())
              for axis in axes]
    models = _drawn(_refitted(fitted, [divisors for *_, divisors in judged]), axes)
    return [Posterior(own, p_value, misfit, edge)
            for own, (p_value, misfit, edge, _) in zip(models, judged, strict=True)]


def _judged(spectra: Spectra, row: Rows) -> tuple[float, float, int | None, Array]:
    """
    Test the residuals of the best model of an axis by half-octave.

    Returns: probability, largest misfit and edge, as in `Posterior`. Also divisors for the degrees
    of freedom of groups, from misfit and model uncertainty.
    """
    [expected], _, [weight], size, covariance = likelihood.fitted_mean(spectra, row, row.x)
    residual = residual_power(spectra.power[row.spectrum], spectra.products[row.spectrum], size,
                              covariance)[0]
    # From here on, arrays by half-octave, except those by group: dof, octave and divisors.
    dof = weight * expected
    _, octave = np.unique(likelihood.half_octaves(spectra.frequency), return_inverse=True)
    count: Array = np.bincount(octave, dof).astype(np.float64)
    used = count > 0.5
    count = np.maximum(count, 1e-9)
    level = np.where(used, np.bincount(octave, dof * (residual / expected)) / count, 1.0)
    # Wilson-Hilferty: the cube root of a chi-square is normal even for a few degrees of freedom.
    normal = np.where(used, (np.cbrt(level) - (1 - 2 / (9 * count))) / np.sqrt(2 / (9 * count)), 0)
    free = max(int(used.sum()) - int(row.present.sum()), 1)
    p_value = float(chi_square.survival(float(normal @ normal), free))
    # A deviation counts as sampling error up to a tail probability of 1e-3.
    high = chi_square.upper(1e-3, count) / count
    low = chi_square.lower(1e-3, count) / count
    misfit = np.where(used, np.maximum(level - high, low - level), 0.0)
    divisors = np.ones(len(dof))
    if p_value < DESCRIBED:
        divisors *= _local_chi_square(normal)[octave]
    attenuation = _attenuation(spectra, row)
    if attenuation.any():
        # Averages groups over half-octaves.
        averaging = np.where(
            octave == np.arange(len(count))[:, None], dof / count[octave], 0.0)
        _, slopes, parameters = likelihood.model_spectrum(spectra, row, row.x)
        _, _, prior_information = likelihood.log_prior(spectra, row, row.x)
        error = _shape_error(
            normal * np.sqrt(2 / count), count / 2, averaging @ attenuation,
            averaging @ (slopes[:, 0] / expected).T, prior_information[0, parameters])
        nominal_dof = np.bincount(octave, spectra.nominal_dof[row.spectrum[0]])[octave]
        divisors *= 1 + nominal_dof * (error * attenuation)**2 / 2
    edge = int(row.edge[0]) if row.edge[0] < len(dof) else None
    return p_value, float(max(misfit.max(), 0.0)), edge, divisors


def _local_chi_square(normal: Array) -> Array:
    """Return the mean square of residuals around each half-octave, and at least 1."""
    place = np.arange(len(normal))
    # Smoothed by a Gaussian of 1.5 half-octaves, with one more residual of 1.
    weight = np.exp(-0.5 * ((place[:, None] - place) / 1.5)**2)
    return np.asarray(np.maximum((weight @ normal**2 + 1) / (weight.sum(axis=1) + 1), 1.0))


def _attenuation(spectra: Spectra, row: Rows) -> Array:
    """Return how much the filter of a row attenuates each group, as a power of e."""
    attenuation, edge = np.zeros(len(spectra.frequency)), int(row.edge[0])
    if edge < len(attenuation):
        # What attenuates the unexplained groups begins below them.
        attenuation = np.minimum((spectra.frequency / spectra.frequency[edge])**2, 1.0)
    if row.present[0, LOW]:
        attenuation = np.maximum(attenuation, -log_low_pass(spectra, row))
    return attenuation


def _shape_error(residual: Array, weight: Array, attenuation: Array, slopes: Array,
                 prior_information: Array) -> float:
    """
    Estimate the relative error of a filter's power, for each factor e that it attenuates.

    By restricted likelihood, since the fit of the parameters hides a part of the error. Shapes are
    (half-octaves,), of `slopes` by the parameters (half-octaves, parameters), of
    `prior_information` (parameters,). `weight`: inverse variance of the relative residuals.
    """
    errors = np.geomspace(1e-4, 1, 81)
    weights = weight / (1 + weight * (errors[:, None] * attenuation)**2)
    information = np.einsum('eh,hi,hj->eij', weights, slopes, slopes) + np.diag(
        prior_information + 1e-9)
    along = (weights * residual) @ slopes
    fitted = np.linalg.solve(information, along[:, :, None])[..., 0]
    log_density = 0.5 * (
        np.log(weights).sum(axis=1) - weights @ residual**2 + (along * fitted).sum(axis=1)
        - np.linalg.slogdet(information)[1] - (np.log(errors / SHAPE_MEDIAN) / SHAPE_SPREAD)**2)
    return float(np.sqrt(np.average(errors**2, weights=np.exp(log_density - log_density.max()))))


def _refitted(fitted: Fitted, divisors: Sequence[Array]) -> Fitted:
    """
    Fit the models again with fewer degrees of freedom, given divisors for the groups of each axis.

    Axes where no group counts less by a tenth or more stay as they are.
    """
    again = np.array([bool((own > 1.1).any()) for own in divisors])
    if not again.any():
        return fitted
    by_axis = np.where(again[:, None], divisors, 1.0)
    spectra = fitted.spectra.with_dof(fitted.spectra.dof / by_axis[fitted.spectrum_axis])
    own = again[fitted.row_axis]
    rows = Rows.joined([fitted.rows.take(~own), maximise_rows(spectra, fitted.rows.take(own))])
    return replace(fitted, spectra=spectra, rows=rows)


def _drawn(fitted: Fitted, axes: Sequence[int]) -> list[tuple[Drawn, ...]]:
    """Draw from all models of each axis near its best, in one batch."""
    spectra, evidence = fitted.spectra, fitted.rows.evidence
    best, total = (np.array([measure(evidence[fitted.row_axis == axis]) for axis in axes])
                   for measure in (np.max, np.logaddexp.reduce))
    rows = best_of(spectra, fitted.rows.take(evidence > best[fitted.row_axis] - KEPT), KEPT, 10)
    row_axis = fitted.spectrum_axis[rows.spectrum]
    # Draw most from the models of the largest weight, which set the interval ends.
    weights = np.exp(rows.evidence - total[row_axis])
    counts = np.where(weights >= 0.2, 512, np.where(weights >= 0.03, 192, 48))
    found: list[list[Drawn]] = [[] for _ in axes]
    for i, draws in enumerate(sample(spectra, rows, counts)):
        found[row_axis[i]].append(
            Drawn(rows.take([i]), spectra, fitted.trends[rows.spectrum[i]], draws))
    return [_weighted(models) for models in found]


def _weighted(models: Sequence[Drawn]) -> tuple[Drawn, ...]:
    """Weigh models by their evidence and sort them, the most probable first."""
    evidence = np.array([model.draws.evidence for model in models])
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    return tuple(replace(models[i], weight=float(weight[i]))
                 for i in np.argsort(-weight, kind='stable').tolist())
