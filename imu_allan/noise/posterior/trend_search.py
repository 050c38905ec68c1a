# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Search for deterministic drift of the mean: trends that are added to the noise models.

The prior of an amplitude is uniform in its logarithm. For noise of a given spectrum the integral
over it then has a closed form. With the gain g of the regression beyond the ramp, it is
(prior/2) sqrt(2 pi/g) e^(g/2) for one column, and (prior/g) e^(g/2) for two.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

from imu_allan.arrays import Array, Ints
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.likelihood import B, K, N, PROCESS, Rows, Spectra, TIME
from imu_allan.noise.posterior.prepared_spectra import Start
from imu_allan.noise.posterior.search import FAST, KEPT, Model, of_axis, rows_of
from imu_allan.noise.record.groups import Groups
from imu_allan.noise.trends.gains import AxisBank, Bank, largest, SLOWEST, Whitened
from imu_allan.noise.trends.kinds import Found, waveforms
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np


@dataclass(frozen=True)
class Fitted:
    """
    Noise models of all axes that were fitted together, each with trends of its spectrum.

    Attributes
    ----------
    spectra : Spectra
        Spectra with the trends as regressors.
    rows : Rows
        Fitted models; prior and evidence include the amplitudes and nuisances of the trends.
    spectrum_axis : ndarray of int, shape (spectra,)
        Axis of each spectrum.
    trends : sequence of tuple of Found
        Trends of each spectrum.
    groups : sequence of Groups
        From which each spectrum has its regressors.

    """

    spectra: Spectra
    rows: Rows
    spectrum_axis: Ints
    trends: Sequence[tuple[Found, ...]]
    groups: Sequence[Groups]

    @property
    def row_axis(self) -> Ints:
        """Return the axis of each row."""
        return self.spectrum_axis[self.rows.spectrum]

    def near_best(self) -> 'Fitted':
        """Return the models of each axis near its best."""
        evidence, axis = self.rows.evidence, self.row_axis
        best = np.full(int(axis.max()) + 1, -np.inf)
        np.maximum.at(best, axis, evidence)
        return replace(self, rows=self.rows.take(evidence > best[axis] - KEPT))

    def joined(self, others: Sequence['Fitted']) -> 'Fitted':
        """Join fits of the same spectra with other trends."""
        fits = [self, *others]
        axes = np.concatenate([fit.spectrum_axis for fit in fits])
        groups = [own for fit in fits for own in fit.groups]
        first = np.cumsum([0, *(len(fit.groups) for fit in fits)])
        rows = [replace(fit.rows, spectrum=number + fit.rows.spectrum)
                for number, fit in zip(first, fits, strict=False)]
        return Fitted(self.spectra.with_regressors(groups, axes), Rows.joined(rows), axes,
                      [trends for fit in fits for trends in fit.trends], groups)


def fit_trends(spectra: Spectra, starts: Sequence[Start], rows: Rows,
               records: Sequence[RecordSpectrum], bank: Bank) -> list[Fitted]:
    """
    Fit the models of each axis with every promising trend, then greedily with two and three.

    `rows`: models without trends, for each axis the best first. `records`: of each axis. Returns:
    a fit for each number of trends.
    """
    noises = {axis: rows_of(spectra, axis, _noises(
        spectra, starts[axis], of_axis(rows, axis).take([0])))
        for axis, record in enumerate(records) if record.duration_s > 0}
    if not noises:
        return []
    without = maximise_rows(spectra, Rows.joined([*noises.values()]))
    searches = [_Search(spectra, axis, AxisBank(bank, records[axis]), own, of_axis(without, axis),
                        of_axis(rows, axis)) for axis, own in noises.items()]
    fits: list[Fitted] = []
    # Temperature, a cycle and a warm-up may act at once; a fourth trend would pass for noise.
    while len(fits) < 3 and (candidates := [
            (search, trends) for search in searches for trends in search.candidates()]):
        fits.append(_fitted(spectra, candidates))
        for search in searches:
            search.go_on(fits[-1])
    return fits


class _Search:
    """
    Greedy search for the trends of one axis.

    `noises`: models to be fitted with every candidate; `without`: the same, fitted without trends.
    `rows`: all models without trends, the best first.
    """

    def __init__(self, spectra: Spectra, axis: int, bank: AxisBank, noises: Rows, without: Rows,
                 rows: Rows) -> None:
        self.axis, self.bank, self.noises = axis, bank, noises
        self._evidence = float(rows.evidence.max())
        self._chosen: tuple[Found, ...] = ()
        self._whitened: Whitened | None = None    # by the noise models to look with
        self._lag = np.zeros(1)    # gain that each of these must make up for
        # Begin with the noise models near the best.
        near = without.take(without.evidence > without.evidence.max() - 30.0)
        self._look_with(spectra, Rows.joined([rows.take([0]), near]))

    def _look_with(self, spectra: Spectra, noises: Rows) -> None:
        self._whitened = self.bank.whitened(
            spectra.frequency, expected_powers(spectra, noises), self._chosen)

    def candidates(self) -> Iterator[tuple[Found, ...]]:
        """Yield the trends that are worth fitting, each added to those already chosen."""
        if self._whitened is None:
            return
        for number, kind in enumerate(self.bank.shared.kinds):
            if sum(trend.kind.key == kind.key for trend in self._chosen) >= kind.most:
                continue
            gains = self._whitened.gains(number)
            net = gains.max(axis=1) - self._lag
            best = int(np.argmax(net))
            # With a gain below 9, a trend is not worth fitting.
            if net[best] >= 9.0:
                trend = self._whitened.of_noise(best).likeliest(number, gains[best])
                yield (*self._chosen, trend)

    def go_on(self, fitted: Fitted) -> None:
        """Choose the best trend, if it clearly improves the evidence."""
        self._whitened = None
        rows = fitted.rows.take(fitted.row_axis == self.axis)
        # Continue the search only if the trend improves the evidence by two nats.
        if not len(rows) or rows.evidence.max() <= self._evidence + 2.0:
            return
        best = rows.best()
        self._evidence = float(best.evidence[0])
        self._chosen, rows = fitted.trends[int(best.spectrum[0])], of_axis(
            rows, int(best.spectrum[0]))
        # Look without the random walk, too, which hides what else the mean does. There, a trend
        # must first make up for what the evidence is behind.
        walks = [np.flatnonzero(rows.present[:, K] == walk) for walk in (True, False)]
        best_of = [int(own[np.argmax(rows.evidence[own])]) for own in walks if len(own)]
        self._look_with(fitted.spectra, rows.take(best_of))
        self._lag = np.maximum(2 * (self._evidence - rows.evidence[best_of]), 0.0)


Candidate = tuple[_Search, tuple[Found, ...]]
"""A search, and a set of trends that is worth fitting."""


def _fitted(spectra: Spectra, candidates: Sequence[Candidate]) -> Fitted:
    """Fit the noise models with their candidates, in one batch."""
    rows = Rows.joined([replace(search.noises, spectrum=np.full(len(search.noises), number))
                        for number, (search, _) in enumerate(candidates)])
    # Half a nat is close enough to locate the trend.
    rough = _maximised(spectra, candidates, rows, 0.5)
    # At first, a strong trend passes for noise: refine it after both are fitted together.
    candidates = [_refined(candidate, rough.spectra, of_axis(rough.rows, number))
                  for number, candidate in enumerate(candidates)]
    fitted = _maximised(spectra, candidates, rough.rows)
    rows, occam = fitted.rows, np.empty(len(fitted.rows))
    for number, trends in enumerate(fitted.trends):
        own = of_axis(rows, number)
        *_, sizes, _ = likelihood.fitted_mean(fitted.spectra, own, own.x)
        occam[rows.spectrum == number] = _occam(sizes[:, 0], trends)
    return replace(fitted, rows=replace(rows, evidence=rows.evidence + occam,
                                        prior=rows.prior + occam))


def _maximised(spectra: Spectra, candidates: Sequence[Candidate], rows: Rows,
               tolerance: float = 0.02) -> Fitted:
    """Fit rows with their candidates; `spectrum` of a row is the candidate's index."""
    axes = np.array([search.axis for search, _ in candidates])
    groups = [search.bank.record.groups(*waveforms(trends, search.bank.shared.duration_s))
              for search, trends in candidates]
    spectra = spectra.with_regressors(groups, axes)
    rows = maximise_rows(spectra, rows, hopeless=16.0, tolerance=tolerance)
    return Fitted(spectra, rows, axes, [trends for _, trends in candidates], groups)


def _refined(candidate: Candidate, spectra: Spectra, rows: Rows) -> Candidate:
    """Refit the nuisances in turn, the last trend's last, with the best noise model."""
    search, trends = candidate
    power = expected_powers(spectra, rows.best())[0]
    # Each nuisance is fitted in turn, with the others held fixed, until none changes.
    turns = 6 if len(trends) > 1 else 1
    before: list[float] = []
    for turn in range(turns):
        values = [trend.value for trend in trends]
        last = turn == turns - 1 or values == before
        for _ in trends:
            trend, *others = trends
            whitened = search.bank.whitened(spectra.frequency, power, others)
            number = search.bank.shared.kinds.index(trend.kind)
            gains = whitened.gains(number)[0]
            trend = whitened.likeliest(number, gains)
            if last and trend.kind.key == 'bias_step' and gains.max() > 30:
                trend = _located(search.bank, number, trend, others, spectra.frequency, power)
            trends = (*others, trend)
        if last:
            break
        before = values
    return search, trends


def _located(bank: AxisBank, number: int, step: Found, others: Sequence[Found], frequency: Array,
             power: Array) -> Found:
    """Locate a large step by faster coefficients, too, as it would be seen beside its place."""
    for slowest in (8 * SLOWEST, 64 * SLOWEST):
        finer = AxisBank(bank.shared, bank.record, slowest)
        values = step.value + bank.shared.duration_s / slowest * np.arange(-8, 8.1, 0.5)
        gains = finer.whitened(frequency, power, others).gains(number, values)[0]
        step = replace(step, value=float(values[largest(gains)]))
    return step


def expected_powers(spectra: Spectra, rows: Rows) -> Array:
    """Return the expected power of rows of any structure, shape (rows, groups)."""
    found = np.empty((len(rows), len(spectra.frequency)))
    for part in likelihood.batches(rows):
        some = rows.take(part)
        found[part] = likelihood.model_spectrum(spectra, some, some.x, slopes=False)[0]
    return found


def _occam(sizes: Array, trends: Sequence[Found]) -> Array:
    """
    Return the log priors of the trends relative to the flat prior of the regression.

    `sizes`, shape (rows, regressors): of the trends the last.
    """
    total = np.full(len(sizes), sum(trend.share for trend in trends))
    column = sizes.shape[1] - sum(trend.width for trend in trends)
    for trend in trends:
        square = np.maximum(sizes[:, column:column + trend.width]**2, 1e-300)
        if trend.width == 2:
            total += np.log(trend.kind.prior / square.sum(axis=1))
        else:
            factor = 0.5 * np.log(2 * np.pi / square)
            total += (np.log(trend.kind.prior / 2) + factor).sum(axis=1)
        column += trend.width
    return total


def _noises(spectra: Spectra, start: Start, best: Rows) -> Iterator[Model]:
    """
    Propose noise models for the search for trends, each with and without a random walk.

    They are combinations of the terms, and the slow noise of the best model. Each is tried with
    the fast end of the best model and a plain one, since a trend can pass for a filter.
    """
    has = best.present[0]
    best_fast = tuple(slot for slot in FAST if has[slot])
    best_slow = tuple(slot for slot in np.flatnonzero(has).tolist() if slot not in (N, K, *FAST))
    best_edge, no_edge = int(best.edge[0]), len(spectra.frequency)
    ends: list[tuple[tuple[int, ...], Array, int]] = [(best_fast, best.x[0], best_edge)]
    if best_fast or best_edge < no_edge:
        ends.append(((), start.x, no_edge))
    proposed = set()
    for (fast, x, edge), slow, random_walk in product(
            ends, ((), (B,), (PROCESS, TIME), (B, PROCESS, TIME), best_slow), ((), (K,))):
        slots = tuple(sorted({N, *slow, *random_walk, *fast}))
        if slots in proposed:
            continue
        proposed.add(slots)
        begin = x.copy()
        begin[K] = min(max(x[K], 0.3), 2.0) if has[K] else 0.3
        if not has[B]:
            begin[B] = max(start.x[B], 0.3)
        if not has[TIME]:
            begin[TIME], begin[PROCESS] = spectra.tables.terms[1].last[0] - 2.0, 1.5
        yield Model(slots, begin, int(best.low_pass[0]), edge)
