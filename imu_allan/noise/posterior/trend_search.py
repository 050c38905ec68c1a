# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Deterministic drift of the mean: regressors that are added to the noise models.

A trend has one column, a cycle two, and a nuisance on a grid. The prior of its amplitude is
uniform in the logarithm. For noise of a given spectrum the integral over it then has a closed
form. With the gain g of the regression beyond the ramp, it is (prior/2) sqrt(2 pi/g) e^(g/2)
for one column, and (prior/g) e^(g/2) for two.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from imu_allan.arrays import Array, Ints
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.likelihood import B, K, N, PROCESS, Rows, Spectra, TIME
from imu_allan.noise.posterior.prepared_spectra import Start
from imu_allan.noise.posterior.search import FAST, Model, of_axis, rows_of
from imu_allan.noise.record.groups import Groups
from imu_allan.noise.trends.leakage import Waveform
from imu_allan.noise.trends.regressors import RecordSpectrum, regressors
from imu_allan.noise.trends.temperature_series import TemperatureSeries
from imu_allan.noise.trends.waveforms import cycle, legendre, step, warming
import numpy as np

_SLOWEST = 128
"""Number of the slowest coefficients of the record that are searched for trends."""


@dataclass(frozen=True)
class TrendKind:
    """
    A kind of deterministic drift of the mean.

    Attributes
    ----------
    key : str
    prior : float
        Prior probability of presence per unit of the logarithm of the amplitude.
    grid : callable
        Equally likely values of the nuisance, given the duration in seconds.
    columns : callable
        Functions of time, given the nuisance and the duration.
    continuous : bool
        Whether the nuisance may lie between the values of the grid.
    most : int
        Most trends of this kind in one model: a die and its housing warm up separately.
    smooth : bool
        Whether the columns change smoothly with the logarithm of the nuisance.

    """

    key: str
    prior: float
    grid: Callable[[float], Array]
    columns: Callable[[float, float], tuple[Waveform, ...]]
    continuous: bool = True
    most: int = 1
    smooth: bool = False

    def slopes(self, value: float, duration_s: float) -> tuple[Waveform, ...]:
        """Return the derivatives of the columns by the log nuisance, if they are smooth in it."""
        # The relative step of the numerical derivative is 0.01.
        def slope(more: Waveform, less: Waveform) -> Waveform:
            return lambda time: np.asarray((more(time) - less(time)) / 0.02)

        return tuple(map(slope, self.columns(1.01 * value, duration_s),
                         self.columns(0.99 * value, duration_s))) if self.smooth else ()


TRENDS = (
    TrendKind('warm_up', 0.10, lambda duration: duration * np.geomspace(0.003, 4.0, 23),
              lambda time, _: (warming(time),), most=2, smooth=True),
    TrendKind('bias_step', 0.02, lambda duration: duration * np.arange(1, 128) / 128,
              lambda time, _: (step(time),), most=2),
    TrendKind('slow_cycle', 0.10, lambda duration: np.arange(1.5, 32.1, 0.25) / duration,
              lambda frequency, _: cycle(frequency), smooth=True),
    TrendKind('bend', 0.05, lambda _: np.array([2.0, 3.0]),
              lambda order, duration: (legendre(int(order), duration),), continuous=False),
)


def lags_of(temperature: TemperatureSeries) -> Array:
    """Return the thermometer lags that a record can resolve, in seconds behind the sensor."""
    # A lag of more than an eighth of the record cannot be distinguished from the ramp.
    longest = temperature.duration_s / 8
    # The thermometer may lag behind the sensor or be ahead. Less than 20 s count as no lag.
    lags = (20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 1280.0)
    return np.sort([0.0, *(sign * lag for lag in lags if lag < longest for sign in (1, -1))])


def kinds_of_trends(temperature: TemperatureSeries | None) -> tuple[TrendKind, ...]:
    """Return `TRENDS`, preceded by the lagged temperature if it is known."""
    if temperature is None:
        return TRENDS
    lags = lags_of(temperature)
    return (TrendKind('temperature', 0.15, lambda _: lags,
                      lambda lag, _: (temperature.of_sensor(lag).trend,)), *TRENDS)


@dataclass(frozen=True)
class Found:
    """
    A trend at one value of its nuisance.

    Attributes
    ----------
    kind : TrendKind
    value : float
    interval : (float, float)
        95 % interval of the nuisance.
    share : float
        Log of the factor by which the integral over the nuisance changes the evidence.

    """

    kind: TrendKind
    value: float
    interval: tuple[float, float]
    share: float

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return len(self.kind.columns(self.value, 1.0))


def waveforms(trends: Sequence[Found], duration_s: float) -> list[Waveform]:
    """Return trends as functions of time."""
    return [column for trend in trends for column in trend.kind.columns(trend.value, duration_s)]


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


class Bank:
    """Transforms of all candidate trends at the slowest coefficients, shared by all axes."""

    def __init__(self, record: RecordSpectrum, kinds: Sequence[TrendKind] = TRENDS) -> None:
        self.kinds, self.duration_s = kinds, record.duration_s
        self._record = record

    @cached_property
    def grids(self) -> list[Array]:
        """Return the values of the nuisance of every kind."""
        return [kind.grid(self.duration_s) for kind in self.kinds]

    @cached_property
    def columns(self) -> list[Array]:
        """Transform the candidates of every kind; computed on first use."""
        return [self.regressors(kind, grid)
                for kind, grid in zip(self.kinds, self.grids, strict=True)]

    def regressors(self, kind: TrendKind, values: Array, slowest: int = _SLOWEST) -> Array:
        """Transform candidates, shape (values, columns of the kind, coefficients)."""
        trends = [kind.columns(float(value), self.duration_s) for value in values]
        transforms = regressors(self._record.sections, self._record.dt,
                                [column for trend in trends for column in trend], slowest)
        return np.asarray(transforms.T.reshape(len(values), len(trends[0]), -1))


class AxisBank:
    """Candidate trends at the slowest coefficients of one axis, without those of lines."""

    def __init__(self, bank: Bank, record: RecordSpectrum, slowest: int = _SLOWEST) -> None:
        self.shared, self.record, self._slowest, bins = bank, record, slowest, record.bins
        slow = bins.whole & (bins.index <= slowest)
        used = slow if record.keep is None else slow & record.keep
        # Which of the slowest coefficients are not part of a line
        self._used = used[slow]
        self._frequency, self._ramp = bins.frequency[used], bins.of_ramp[used]
        self._coefficient = bins.coefficient[record.axis, used]

    @cached_property
    def _columns(self) -> list[Array]:
        return [columns[:, :, self._used] for columns in self.shared.columns]

    def whitened(self, frequency: Array, power: Array, others: Sequence[Found]) -> 'Whitened':
        """
        Whiten the coefficients and remove the ramp and the trends in `others`.

        `power`, shape (noises, groups): expected power of noise models, at each `frequency`.
        """
        group = np.searchsorted(frequency, self._frequency * 0.99999).clip(0, len(frequency) - 1)
        # The lower limit keeps products with the reciprocal finite.
        scale = 1 / np.sqrt(np.maximum(np.atleast_2d(power)[:, group], 1e-200))
        columns = [self._ramp[:, None]]
        if self.record.in_every_fit or others:
            trends = [*self.record.in_every_fit, *waveforms(others, self.shared.duration_s)]
            columns.append(regressors(
                self.record.sections, self.record.dt, trends, self._slowest)[self._used])
        basis = np.linalg.qr(np.column_stack(columns) * scale[:, :, None])[0]
        residual = (self._coefficient * scale)[:, :, None]
        residual = residual - basis @ (basis.transpose(0, 2, 1) @ residual)
        return Whitened(self, others, scale, basis * scale[:, :, None], residual[:, :, 0] * scale)

    def columns(self, number: int, values: Array | None = None) -> Array:
        """Return the candidates of a kind along its grid, or at `values`."""
        return self._columns[number] if values is None else self.shared.regressors(
            self.shared.kinds[number], values, self._slowest)[:, :, self._used]


@dataclass(frozen=True)
class Whitened:
    """
    Coefficients of a record, whitened by noise models, without the part that other trends explain.

    Attributes
    ----------
    bank : AxisBank
    others : sequence of Found
        The other trends, besides the ramp.
    scale : ndarray, shape (noises, coefficients)
        Reciprocal of the standard deviation.
    basis : ndarray, shape (noises, coefficients, other trends)
        Orthonormal basis of the whitened other trends, times `scale`.
    residual : ndarray, shape (noises, coefficients)
        Whitened residual, times `scale`.

    """

    bank: AxisBank
    others: Sequence[Found]
    scale: Array
    basis: Array
    residual: Array

    def of_noise(self, noise: int) -> 'Whitened':
        """Return the arrays of one of the noise models."""
        return replace(self, **{name: getattr(self, name)[[noise]]
                                for name in ('scale', 'basis', 'residual')})

    def gains(self, number: int, values: Array | None = None) -> Array:
        """
        Return the chi-square that a kind explains along its grid, or at `values`.

        `number`: of the kind in the bank. Returns shape (noises, values).
        """
        columns = self.bank.columns(number, values)
        target = np.tensordot(self.residual, columns, (1, 2))
        explained = np.tensordot(self.basis, columns, (1, 2))
        products = np.einsum('vin,vjn->vijn', columns, columns)
        gram = np.tensordot(self.scale**2, products, (1, 3))
        # The ridge rejects trends that no coefficient shows, such as a step between two runs, and
        # trends that are almost a combination of the others.
        ridge = (1e-9 * np.trace(gram, axis1=2, axis2=3)
                 + np.finfo(np.float64).tiny)[:, :, None, None]
        gram = gram - np.einsum('abvi,abvj->avij', explained, explained)
        if columns.shape[1] == 1:
            return np.asarray(target[:, :, 0]**2 / np.maximum(gram, ridge)[:, :, 0, 0])
        gram += ridge * np.eye(columns.shape[1])
        return np.asarray((target * np.linalg.solve(gram, target[..., None])[..., 0]).sum(axis=2))

    def likeliest(self, number: int, gains: Array) -> Found:
        """
        Find the best value of a nuisance, and the log of what integrating over it contributes.

        `gains`: along the grid of the kind, for the only noise model.
        """
        kind, grid = self.bank.shared.kinds[number], self.bank.shared.grids[number]
        values, gains = self._profile(number, gains)
        likelihood_ratio = np.exp((gains - gains.max()) / 2)
        # The integral runs over the index, because grid values are equally likely.
        place = np.interp(values, grid, np.arange(len(grid)) / max(len(grid) - 1, 1))
        share = (float(((likelihood_ratio[1:] + likelihood_ratio[:-1]) * np.diff(place)).sum()) / 2
                 if kind.continuous and len(grid) > 1 else float(likelihood_ratio.mean()))
        low, high = _interval(values, gains)
        # A lag that is not seen counts as none. During a warm-up it would only scale the slope,
        # whose interval does not include it. No other nuisance can be zero.
        value = 0.0 if low <= 0 <= high else float(values[_largest(gains)])
        return Found(kind, value, (low, high), float(np.log(max(share, 1e-12))))

    def _profile(self, number: int, gains: Array) -> tuple[Array, Array]:
        """Return nuisance values of a kind and their gains, refined around the best value."""
        kind, values = self.bank.shared.kinds[number], self.bank.shared.grids[number]
        gains = self._apart(kind, values, gains)
        if not kind.continuous or len(values) < 3:
            return values, gains
        # Refine the grid around the best value until the gain hardly changes.
        for _ in range(8):
            best = _largest(gains)
            near = values[max(best - 1, 0):best + 2]
            between = np.setdiff1d(np.linspace(near[:-1], near[1:], 5), near)
            if not len(between):
                break
            more = self._apart(kind, between, self.gains(number, between)[0])
            values, gains = np.append(values, between), np.append(gains, more)
            order = np.argsort(values)
            values, gains = values[order], gains[order]
            if float(np.ptp(np.sort(gains)[-3:])) < 0.02:
                break
        return values, gains

    def _apart(self, kind: TrendKind, values: Array, gains: Array) -> Array:
        """Return gains, zero near another trend of the same kind."""
        # Two nearly equal trends of opposite sign are the derivative of one, not two trends.
        for other in self.others:
            if other.kind.key == kind.key:
                near = (np.abs(np.log(values / other.value)) < np.log(2) if kind.smooth else
                        np.abs(values - other.value) < self.bank.shared.duration_s / 64)
                gains = np.where(near, 0.0, gains)
        return gains


def fit_trends(spectra: Spectra, starts: Sequence[Start], rows: Rows,
               records: Sequence[RecordSpectrum | None], bank: Bank) -> list[Fitted]:
    """
    Fit the models of each axis with every promising trend, then greedily with two and three.

    `rows`: models without trends, for each axis the best first. `records`: of each axis; None
    where no trend is to be searched for. Returns: a fit for each number of trends.
    """
    searches = [_Search(spectra, axis, of_axis(rows, axis), starts[axis], AxisBank(bank, record))
                for axis, record in enumerate(records)
                if record is not None and record.duration_s > 0]
    if not searches:
        return []
    without = maximise_rows(spectra, Rows.joined([search.noises for search in searches]))
    for search in searches:
        search.begin(spectra, of_axis(without, search.axis))
    fits: list[Fitted] = []
    # Temperature, a cycle and a warm-up may act at once; a fourth trend would pass for noise.
    while len(fits) < 3 and (candidates := [
            (search, trends) for search in searches for trends in search.candidates()]):
        fits.append(_fitted(spectra, candidates))
        for search in searches:
            search.go_on(fits[-1])
    return fits


class _Search:
    """Greedy search for the trends of one axis."""

    def __init__(self, spectra: Spectra, axis: int, rows: Rows, start: Start, bank: AxisBank
                 ) -> None:
        self.axis, self.bank, self._best = axis, bank, rows.take([0])
        # Noise models to be fitted with every candidate
        self.noises = rows_of(spectra, axis, _noises(spectra, start, self._best))
        self._evidence = float(rows.evidence.max())
        self._chosen: tuple[Found, ...] = ()
        self._whitened: Whitened | None = None    # by the noise models to look with
        self._lag = np.zeros(1)    # gain that each of these must make up for

    def begin(self, spectra: Spectra, without: Rows) -> None:
        """Start from the noise models near the best, as fitted without trends."""
        near = without.take(without.evidence > without.evidence.max() - 30.0)
        self._look_with(spectra, Rows.joined([self._best, near]))

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
    for slowest in (8 * _SLOWEST, 64 * _SLOWEST):
        finer = AxisBank(bank.shared, bank.record, slowest)
        values = step.value + bank.shared.duration_s / slowest * np.arange(-8, 8.1, 0.5)
        gains = finer.whitened(frequency, power, others).gains(number, values)[0]
        step = replace(step, value=float(values[_largest(gains)]))
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
        if trend.kind.key == 'slow_cycle':
            total += np.log(trend.kind.prior / square.sum(axis=1))
        else:
            factor = 0.5 * np.log(2 * np.pi / square)
            total += (np.log(trend.kind.prior / 2) + factor).sum(axis=1)
        column += trend.width
    return total


def _largest(gains: Array) -> int:
    """Return the first of the largest gains; those of a step within one block are equal."""
    # Which of equal gains is the largest would depend on rounding.
    return int(np.argmax(gains > gains.max() - 1e-6))


def _interval(values: Array, gains: Array) -> tuple[float, float]:
    """Return the 95 % interval of the nuisance from the profile of the likelihood ratio."""
    # Twice the log likelihood ratio at the ends of the interval (Wilks).
    near = np.flatnonzero(gains > gains.max() - 3.841)
    return (float(values[max(near[0] - 1, 0)]), float(values[min(near[-1] + 1, len(values) - 1)]))


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
