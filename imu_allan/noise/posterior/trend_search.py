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


def waveforms(found: Sequence[Found], duration_s: float) -> list[Waveform]:
    """Return trends as functions of time."""
    return [trend for one in found for trend in one.kind.columns(one.value, duration_s)]


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
    axes : ndarray of int, shape (spectra,)
        Axis of each spectrum.
    trends : sequence of tuple of Found
        Trends of each spectrum.
    groups : sequence of Groups
        From which each spectrum has its regressors.

    """

    spectra: Spectra
    rows: Rows
    axes: Ints
    trends: Sequence[tuple[Found, ...]]
    groups: Sequence[Groups]

    @property
    def axis(self) -> Ints:
        """Return the axis of each row."""
        return self.axes[self.rows.of]

    def joined(self, others: Sequence['Fitted']) -> 'Fitted':
        """Join fits of the same spectra with other trends."""
        every = [self, *others]
        axes = np.concatenate([one.axes for one in every])
        groups = [own for one in every for own in one.groups]
        before = np.cumsum([0, *(len(one.axes) for one in every)])
        rows = [replace(one.rows, of=first + one.rows.of)
                for first, one in zip(before, every, strict=False)]
        return Fitted(self.spectra.with_regressors(groups, axes), Rows.joined(rows), axes,
                      [own for one in every for own in one.trends], groups)


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
        found = regressors(self._record.sections, self._record.dt,
                           [trend for each in trends for trend in each], slowest)
        return np.asarray(found.T.reshape(len(values), len(trends[0]), -1))


class AxisBank:
    """Candidate trends at the slowest coefficients of one axis, without those of lines."""

    def __init__(self, bank: Bank, record: RecordSpectrum, slowest: int = _SLOWEST) -> None:
        self.shared, self.record, self._slowest, bins = bank, record, slowest, record.bins
        slow = bins.whole & (bins.index <= slowest)
        used = slow if record.keep is None else slow & record.keep
        # Which of the slowest coefficients are not part of a line
        self._which = used[slow]
        self._frequency, self._ramp = bins.frequency[used], bins.of_ramp[used]
        self._coefficient = bins.coefficient[record.axis, used]

    @cached_property
    def _columns(self) -> list[Array]:
        return [columns[:, :, self._which] for columns in self.shared.columns]

    def about(self, frequency: Array, lam: Array, beside: Sequence[Found]) -> 'Whitened':
        """Whiten by the spectra `lam` and remove the ramp and the trends in `beside`."""
        place = np.searchsorted(frequency, self._frequency * 0.99999).clip(0, len(frequency) - 1)
        # The lower limit keeps products with the reciprocal finite.
        root = 1 / np.sqrt(np.maximum(np.atleast_2d(lam)[:, place], 1e-200))
        others = [self._ramp[:, None]]
        if self.record.in_every_fit or beside:
            trends = [*self.record.in_every_fit, *waveforms(beside, self.shared.duration_s)]
            others.append(regressors(
                self.record.sections, self.record.dt, trends, self._slowest)[self._which])
        basis = np.linalg.qr(np.column_stack(others) * root[:, :, None])[0]
        value = (self._coefficient * root)[:, :, None]
        value = value - basis @ (basis.transpose(0, 2, 1) @ value)
        return Whitened(self, beside, root, basis * root[:, :, None], value[:, :, 0] * root)

    def columns(self, number: int, values: Array | None = None) -> Array:
        """Return the candidates of a kind along its grid, or at `values`."""
        return self._columns[number] if values is None else self.shared.regressors(
            self.shared.kinds[number], values, self._slowest)[:, :, self._which]


@dataclass(frozen=True)
class Whitened:
    """
    Coefficients of a record, whitened by noise models, without the part that other trends explain.

    Attributes
    ----------
    bank : AxisBank
    others : sequence of Found
        The other trends, besides the ramp.
    root : ndarray, shape (noises, coefficients)
        Reciprocal of the standard deviation.
    basis : ndarray, shape (noises, coefficients, other trends)
        Orthonormal basis of the whitened other trends, times `root`.
    value : ndarray, shape (noises, coefficients)
        Whitened residual, times `root`.

    """

    bank: AxisBank
    others: Sequence[Found]
    root: Array
    basis: Array
    value: Array

    def one(self, number: int) -> 'Whitened':
        """Return the arrays of one of the noise models."""
        return replace(self, **{name: getattr(self, name)[number:number + 1]
                                for name in ('root', 'basis', 'value')})

    def gains(self, number: int, values: Array | None = None) -> Array:
        """Return the chi-square that a kind explains along its grid, or at `values`."""
        columns = self.bank.columns(number, values)
        along = np.tensordot(self.value, columns, (1, 2))
        taken = np.tensordot(self.basis, columns, (1, 2))
        products = np.einsum('vin,vjn->vijn', columns, columns)
        gram = np.tensordot(self.root**2, products, (1, 3))
        # The ridge rejects trends that no coefficient shows, such as a step between two runs, and
        # trends that are almost a combination of the others.
        ridge = (1e-9 * np.trace(gram, axis1=2, axis2=3)
                 + np.finfo(np.float64).tiny)[:, :, None, None]
        gram = gram - np.einsum('abvi,abvj->avij', taken, taken)
        if columns.shape[1] == 1:
            return np.asarray(along[:, :, 0]**2 / np.maximum(gram, ridge)[:, :, 0, 0])
        gram += ridge * np.eye(columns.shape[1])
        return np.asarray((along * np.linalg.solve(gram, along[..., None])[..., 0]).sum(axis=2))

    def likeliest(self, number: int, gains: Array) -> Found:
        """
        Find the best value of a nuisance, and the log of what integrating over it contributes.

        `gains`: along the grid of the kind, for the only noise model.
        """
        kind, grid = self.bank.shared.kinds[number], self.bank.shared.grids[number]
        values, gains = self._profile(number, gains)
        near = np.exp((gains - gains.max()) / 2)
        # The integral runs over the index, because grid values are equally likely.
        place = np.interp(values, grid, np.arange(len(grid)) / max(len(grid) - 1, 1))
        share = (float(((near[1:] + near[:-1]) * np.diff(place)).sum()) / 2
                 if kind.continuous and len(grid) > 1 else float(near.mean()))
        low, high = _interval(values, gains)
        # A lag that is not seen counts as none. During a warm-up it would only scale the slope,
        # whose interval does not include it. No other nuisance can be zero.
        value = 0.0 if low <= 0 <= high else float(values[_largest(gains)])
        return Found(kind, value, (low, high), float(np.log(max(share, 1e-12))))

    def _profile(self, number: int, gains: Array) -> tuple[Array, Array]:
        """Return nuisance values of a kind and their gains, refined around the best value."""
        bank = self.bank.shared
        kind, values = bank.kinds[number], bank.grids[number]

        def gained(at: Array, gains: Array) -> Array:
            # Two nearly equal trends of opposite sign are the derivative of one, not two trends.
            for other in self.others:
                if other.kind.key == kind.key:
                    near = (np.abs(np.log(at / other.value)) < np.log(2) if kind.smooth else
                            np.abs(at - other.value) < bank.duration_s / 64)
                    gains = np.where(near, 0.0, gains)
            return gains

        gains = gained(values, gains)
        if not kind.continuous or len(values) < 3:
            return values, gains
        # Refine the grid around the best value until the gain hardly changes.
        for _ in range(8):
            best = _largest(gains)
            near = values[max(best - 1, 0):best + 2]
            more = np.setdiff1d(np.linspace(near[:-1], near[1:], 5), near)
            if not len(more):
                break
            values = np.append(values, more)
            gains = np.append(gains, gained(more, self.gains(number, more)[0]))
            order = np.argsort(values)
            values, gains = values[order], gains[order]
            if float(np.ptp(np.sort(gains)[-3:])) < 0.02:
                break
        return values, gains


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
    still = maximise_rows(spectra, Rows.joined([search.tried for search in searches]))
    for search in searches:
        search.begin(spectra, of_axis(still, search.axis))
    found: list[Fitted] = []
    # Temperature, a cycle and a warm-up may act at once; a fourth trend would pass for noise.
    while len(found) < 3 and (
            candidates := [(search, one) for search in searches for one in search.candidates()]):
        found.append(_fitted(spectra, candidates))
        for search in searches:
            search.go_on(found[-1])
    return found


class _Search:
    """Greedy search for the trends of one axis."""

    def __init__(self, spectra: Spectra, axis: int, rows: Rows, start: Start, bank: AxisBank
                 ) -> None:
        self.axis, self.bank, self._best = axis, bank, rows.take([0])
        self.tried = rows_of(spectra, axis, _noises(spectra, start, self._best))
        self._top = float(rows.evidence.max())
        self._chosen: tuple[Found, ...] = ()
        self._about: Whitened | None = None
        self._behind = np.zeros(1)    # gain that each noise model must make up for

    def begin(self, spectra: Spectra, still: Rows) -> None:
        """Start from the noise models near the best, as fitted without trends."""
        near = still.take(still.evidence > still.evidence.max() - 30.0)
        self._look(spectra, Rows.joined([self._best, near]))

    def _look(self, spectra: Spectra, rows: Rows) -> None:
        self._about = self.bank.about(
            spectra.frequency, expected_powers(spectra, rows), self._chosen)

    def candidates(self) -> Iterator[tuple[Found, ...]]:
        """Yield the trends that are worth fitting, each added to those already chosen."""
        if self._about is None:
            return
        for number, kind in enumerate(self.bank.shared.kinds):
            if sum(one.kind.key == kind.key for one in self._chosen) >= kind.most:
                continue
            gains = self._about.gains(number)
            net = gains.max(axis=1) - self._behind
            best = int(np.argmax(net))
            # With a gain below 9, a trend is not worth fitting.
            if net[best] >= 9.0:
                yield (*self._chosen, self._about.one(best).likeliest(number, gains[best]))

    def go_on(self, fitted: Fitted) -> None:
        """Choose the best trend, if it clearly improves the evidence."""
        self._about = None
        own = fitted.rows.take(fitted.axis == self.axis)
        if not len(own):
            return
        leader, top = int(own.of[np.argmax(own.evidence)]), float(own.evidence.max())
        # Continue the search only if the trend improves the evidence by two nats.
        if top <= self._top + 2.0:
            return
        self._top = top
        self._chosen, rows = fitted.trends[leader], of_axis(own, leader)
        # Look without the random walk, too, which hides what else the mean does. There, a trend
        # must first make up for what the evidence is behind.
        kinds = [np.flatnonzero(rows.has[:, K] == there) for there in (True, False)]
        near = [int(kind[np.argmax(rows.evidence[kind])]) for kind in kinds if len(kind)]
        if near:
            self._look(fitted.spectra, rows.take(near))
            self._behind = np.maximum(2 * (self._top - rows.evidence[near]), 0.0)


Candidate = tuple[_Search, tuple[Found, ...]]
"""A search, and a set of trends that is worth fitting."""


def _fitted(spectra: Spectra, candidates: Sequence[Candidate]) -> Fitted:
    """Fit the noise models with their candidates, in one batch."""
    tried = Rows.joined([replace(search.tried, of=np.full(len(search.tried), number))
                         for number, (search, _) in enumerate(candidates)])
    # Half a nat is close enough to locate the trend.
    beside, rows, _ = _climbed(spectra, candidates, tried, 0.5)
    # At first, a strong trend passes for noise: refine it after both are fitted together.
    candidates = [_nearer(candidate, beside, of_axis(rows, number))
                  for number, candidate in enumerate(candidates)]
    beside, rows, groups = _climbed(spectra, candidates, rows)
    occam = np.empty(len(rows))
    for number, (_, found) in enumerate(candidates):
        own = of_axis(rows, number)
        sizes = likelihood.fitted_mean(beside, own, own.x)[2][:, 0]
        occam[rows.of == number] = _occam(sizes, found)
    return Fitted(beside, replace(rows, evidence=rows.evidence + occam, prior=rows.prior + occam),
                  np.array([search.axis for search, _ in candidates]),
                  [found for _, found in candidates], groups)


def _climbed(spectra: Spectra, candidates: Sequence[Candidate], rows: Rows,
             tolerance: float = 0.02) -> tuple[Spectra, Rows, list[Groups]]:
    """Fit rows with their candidates; `of` of a row is the candidate's index."""
    groups = [search.bank.record.groups(*waveforms(found, search.bank.shared.duration_s))
              for search, found in candidates]
    beside = spectra.with_regressors(groups, np.array([search.axis for search, _ in candidates]))
    return beside, maximise_rows(beside, rows, hopeless=16.0, tolerance=tolerance), groups


def _nearer(candidate: Candidate, beside: Spectra, rows: Rows) -> Candidate:
    """Refit the nuisances in turn, the last trend's last, with the best noise model."""
    search, found = candidate
    lam = expected_powers(beside, rows.best())[0]
    # Each nuisance is fitted in turn, with the others held fixed, until none changes.
    turns = 6 if len(found) > 1 else 1
    before: list[float] = []
    for turn in range(turns):
        values = [one.value for one in found]
        last = turn == turns - 1 or values == before
        for _ in found:
            first, *others = found
            about = search.bank.about(beside.frequency, lam, others)
            number = search.bank.shared.kinds.index(first.kind)
            gains = about.gains(number)[0]
            first = about.likeliest(number, gains)
            if last and first.kind.key == 'bias_step' and gains.max() > 30:
                first = _located(search.bank, number, first, others, beside.frequency, lam)
            found = (*others, first)
        if last:
            break
        before = values
    return search, found


def _located(bank: AxisBank, number: int, found: Found, others: Sequence[Found], frequency: Array,
             lam: Array) -> Found:
    """Locate a large step by faster coefficients, too, as it would be seen beside its place."""
    for slowest in (8 * _SLOWEST, 64 * _SLOWEST):
        finer = AxisBank(bank.shared, bank.record, slowest)
        values = found.value + bank.shared.duration_s / slowest * np.arange(-8, 8.1, 0.5)
        gains = finer.about(frequency, lam, others).gains(number, values)[0]
        found = replace(found, value=float(values[_largest(gains)]))
    return found


def expected_powers(spectra: Spectra, rows: Rows) -> Array:
    """Return the expected power of rows of any structure, shape (rows, groups)."""
    found = np.empty((len(rows), len(spectra.frequency)))
    for part in likelihood.batches(rows):
        some = rows.take(part)
        found[part] = likelihood.spectrum(spectra, some, some.x, slopes=False)[0]
    return found


def _occam(sizes: Array, found: Sequence[Found]) -> Array:
    """
    Return the log priors of the trends relative to the flat prior of the regression.

    `sizes`, shape (rows, regressors): of the trends the last.
    """
    total = np.full(len(sizes), sum(one.share for one in found))
    at = sizes.shape[1] - sum(one.width for one in found)
    for one in found:
        square = np.maximum(sizes[:, at:at + one.width]**2, 1e-300)
        if one.kind.key == 'slow_cycle':
            total += np.log(one.kind.prior / square.sum(axis=1))
        else:
            total += (np.log(one.kind.prior / 2) + 0.5 * np.log(2 * np.pi / square)).sum(axis=1)
        at += one.width
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
    has, x, edge, family = best.has[0], best.x[0], int(best.edge[0]), int(best.family[0])
    bent = tuple(slot for slot in FAST if has[slot])
    slow = tuple(slot for slot in np.flatnonzero(has).tolist() if slot not in (N, K, *FAST))
    ends: list[tuple[tuple[int, ...], Array, int]] = [(bent, x, edge)]
    if bent or edge < len(spectra.frequency):
        ends.append(((), start.x, len(spectra.frequency)))
    seen = set()
    for (fast, x, edge), more, random_walk in product(
            ends, ((), (B,), (PROCESS, TIME), (B, PROCESS, TIME), slow), ((), (K,))):
        slots = tuple(sorted({N, *more, *random_walk, *fast}))
        if slots in seen:
            continue
        seen.add(slots)
        begin = x.copy()
        begin[K] = min(max(x[K], 0.3), 2.0) if has[K] else 0.3
        if not has[B]:
            begin[B] = max(start.x[B], 0.3)
        if not has[TIME]:
            begin[TIME], begin[PROCESS] = spectra.tables.terms[1].last[0] - 2.0, 1.5
        yield Model(slots, begin, family, edge)
