# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Posterior over the noise models of each axis: weighted draws from all models that matter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.arrays import Array
from imu_allan.noise.posterior.draws import Draws, sample
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.goodness_of_fit import Goodness, goodness_of_fit
from imu_allan.noise.posterior.level_change import Change, STEADY
from imu_allan.noise.posterior.likelihood import Rows, Spectra
from imu_allan.noise.posterior.prepared_spectra import prepared
from imu_allan.noise.posterior.search import best_of, KEPT, search_models
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
    goodness : Goodness
        Of the best model.
    edge : int or None
        Group from which on the best model leaves the spectrum unexplained, if any.
    change : Change
        How much the level of the noise changes over the record.

    """

    models: tuple[Drawn, ...]
    goodness: Goodness
    edge: int | None = None
    change: Change = STEADY


def posteriors(groups: Sequence[Groups], dt: float, records: Sequence[RecordSpectrum] = (),
               bank: Bank | None = None) -> list[Posterior]:
    """
    Compute the posteriors over the noise models of several axes.

    `groups`: grouped spectrum of each axis, all over the same bands. `dt`: sample interval in
    seconds. `records`: that the groups were made of, to fit trends of the mean; without them, none
    are fitted, as for several records joined. `bank`: trends to consider; otherwise `TRENDS`.
    """
    spectra, starts = prepared(groups, dt)
    rows = search_models(spectra, starts)
    axes = range(len(starts))
    fitted = Fitted(spectra, rows, np.array(axes), [()] * len(axes), groups)
    if records and (more := fit_trends(spectra, starts, rows, records, bank or Bank(records[0]))):
        fitted = fitted.joined(more)
    # What the whole spectrum refutes must not return when a part of it counts less.
    fitted = fitted.near_best()
    best = [fitted.rows.take(fitted.row_axis == axis).best() for axis in axes]
    goodness = [goodness_of_fit(fitted.spectra, row) for row in best]
    models = _drawn(_refitted(fitted, [own.divisors for own in goodness]), axes)
    return [Posterior(own, fit, int(row.edge[0]) if row.edge[0] < len(spectra.frequency) else None)
            for own, fit, row in zip(models, goodness, best, strict=True)]


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
    """Draw from all models of each axis near its best, in one batch; weigh and sort them."""
    near, spectra = fitted.near_best(), fitted.spectra
    total = np.array([np.logaddexp.reduce(near.rows.evidence[near.row_axis == axis])
                      for axis in axes])
    rows = best_of(spectra, near.rows, KEPT, 10)
    row_axis = fitted.spectrum_axis[rows.spectrum]
    # Draw most from the models of the largest weight, which set the interval ends.
    weights = np.exp(rows.evidence - total[row_axis])
    counts = np.where(weights >= 0.2, 512, np.where(weights >= 0.03, 192, 48))
    found: list[list[Drawn]] = [[] for _ in axes]
    for i, draws in enumerate(sample(spectra, rows, counts)):
        found[row_axis[i]].append(
            Drawn(rows.take([i]), spectra, fitted.trends[rows.spectrum[i]], draws))
    weighted = []
    for models in found:
        evidence = np.array([model.draws.evidence for model in models])
        weight = np.exp(evidence - evidence.max())
        weight /= weight.sum()
        weighted.append(tuple(replace(models[i], weight=float(weight[i]))
                              for i in np.argsort(-weight, kind='stable').tolist()))
    return weighted
