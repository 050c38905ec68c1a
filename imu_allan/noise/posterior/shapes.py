# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What a spectrum may be made of: one small object a shape, and the one table of them.

An additive shape comes with an amplitude; a response multiplies all that lies before it. Either
has at most one nuisance parameter, on a uniform grid: an exponent, or the logarithm of a time or
corner. All of it is relative to the sample rate and the length of the record.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from imu_allan.block import NEIGHBOURS
from imu_allan.noise import spectrum
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Power = Callable[[Array, float], Array]
"""Power at frequencies in cycles per sample, for a value of the nuisance, up to a constant."""

_ROUNDING = 1e-15
"""Share of the pass band that is left of the deepest stop band."""
LOWEST_CORNER = 1e-3
"""Of a low-pass, in cycles per sample: below, slow drift looks like noise that one lets pass."""
FEWEST_GROUPS = 24
"""Bands that a model has to describe: three octaves distinguish the terms."""
# Points and weights over a band (Gauss-Legendre).
_POINTS = np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.6)
_GAUSS = np.array([5.0, 8.0, 5.0]) / 18  # see above
_SLOWEST = LOWEST_CORNER / 4
"""In cycles per sample: of what is slower, nothing leaks."""
_EVERY = (np.arange(128) + 0.5) / 256
"""Frequencies from zero to half the sample rate."""
_FOLDS = 4
"""How often a frequency is folded, at most: beyond lie 2 % of the power."""


@dataclass(frozen=True)
class Grid:
    """A uniform grid of a nuisance parameter."""

    first: float
    last: float
    step: float


@dataclass(frozen=True)
class Band:
    """What a grid may depend on: the slowest band and the first that can be an edge."""

    slowest: float
    shortest_edge: float


@dataclass(frozen=True)
class Shape:
    """
    One thing that a spectrum may be made of.

    Attributes
    ----------
    key : str
    density : float
        Prior probability of presence per unit of the logarithm of its amplitude, or in all for a
        response.
    power : callable
        Power at frequencies per sample, given the nuisance.
    grid : callable, optional
        Range of the nuisance, given the band of a record.
    at_output : bool
        Whether it is added behind every filter.
    like : str
        Key of the term whose share in gaps and at the ends of a record it has.

    """

    key: str
    density: float
    power: Power
    grid: Callable[[Band], Grid] | None = None
    at_output: bool = False
    like: str = ''


def _of_corner(highest: float, step: float = 0.1) -> Callable[[Band], Grid]:
    """Corners from where the band below is just wide enough, up to a last one."""
    def grid(band: Band) -> Grid:
        lowest = max(band.shortest_edge, LOWEST_CORNER)
        return Grid(np.log(min(lowest, highest / 2)), np.log(highest), step)
    return grid


def _butterworth(order: int) -> Power:
    return lambda nu, corner: 1 / (1 + (np.tan(np.pi * nu) / np.exp(corner)) ** (2 * order))


def _high_pass(nu: Array, corner: float) -> Array:
    """First-order high-pass; the ends of a finite record leak what it has taken out."""
    falls = 1 / (1 + (np.sin(np.pi * nu) / np.pi)**2 * np.exp(-2 * corner))
    leak = min(float(nu[0]) / (np.pi * np.exp(corner)), 1.0)
    return np.asarray(1 - falls * (1 - leak))


WHITE, FLICKER, WALK, QUANTIZATION = 'noise_density', 'bias_instability', 'rate_random_walk', \
    'quantization_noise'
OUTPUT_NOISE, SMOOTH_DRIFT = 'output_noise', 'smooth_drift'
PROCESS, POWER_LAW, HIGH_PASS = 'gauss_markov', 'power_law', 'high_pass'
GENTLE = 'recursive_mean'

TERMS = (
    Shape(QUANTIZATION, 0.2, lambda nu, _: spectrum.quantization(nu, 1.0), at_output=True),
    Shape(WHITE, 1.0, lambda nu, _: spectrum.white(nu, 1.0)),
    Shape(FLICKER, 0.15, lambda nu, _: spectrum.flicker(nu, 1.0)),
    Shape(WALK, 0.15, lambda nu, _: spectrum.random_walk(nu, 1.0)),
    Shape(OUTPUT_NOISE, 0.02, lambda nu, _: spectrum.white(nu, 1.0), at_output=True, like=WHITE),
    Shape(SMOOTH_DRIFT, 0.03, lambda nu, _: spectrum.random_walk(nu, 1.0)**2, like=WALK),
)
"""
Terms without a nuisance; white noise is in every model, that of the output behind a filter.

A mean that moves smoothly in a way that no trend of the list describes has a spectrum of f^-4,
like the integral of a random walk.
"""

FREE_TERMS = (
    Shape(POWER_LAW, 0.15, lambda nu, alpha: spectrum.power_law(nu, 1.0, alpha),
          lambda _: Grid(0.1, 1.9, 0.1), like=FLICKER),
    Shape(PROCESS, 0.05, lambda nu, time: spectrum.gauss_markov(nu, 1.0, float(np.exp(time))),
          lambda band: Grid(np.log(50.0), max(-np.log(2 * np.pi * band.slowest),
                                              np.log(50.0) + 1.4), 0.25), like=WHITE),
)
"""Terms with one: flicker of another exponent, and a Gauss-Markov process of any time."""

LOW_PASSES = (
    Shape(GENTLE, 3.0, lambda nu, corner: 1 / (1 + (np.sin(np.pi * nu) / np.exp(corner)) ** 2),
          _of_corner(60.0)),
    Shape('moving_mean', 0.05,
          lambda nu, corner: (np.sinc(nu / np.exp(corner)) / np.sinc(nu)) ** 2,
          # Its notches are narrower than the steps of the others.
          _of_corner(0.9, 0.04)),
    Shape('butterworth_1', 0.05, _butterworth(1), _of_corner(20.0)),
    Shape('butterworth_2', 0.05, _butterworth(2), _of_corner(4.0)),
    Shape('butterworth_3', 0.05, _butterworth(3), _of_corner(4.0)),
    Shape('butterworth_4', 0.05, _butterworth(4), _of_corner(4.0)),
    Shape('gauss', 0.05, lambda nu, corner: np.exp(-np.log(2) * (nu / np.exp(corner)) ** 2),
          _of_corner(0.8)),
)
"""Responses of which a sensor has one at most; the first may be too gentle to be seen."""

HIGH_PASSES = (Shape(HIGH_PASS, 0.1, _high_pass, lambda band: Grid(
    np.log(band.slowest / 2), np.log(max(0.2, 2 * band.slowest)), 0.25)),)
"""What follows a bias is slower than a fifth of the sample rate."""


@dataclass(frozen=True)
class Table:
    """
    Logarithm of the power of shapes on their grids, cubic in between.

    Attributes
    ----------
    first, last, step : ndarray, shape (shapes,)
    rows : ndarray, shape (points, groups)
        Of all shapes, one after the other.
    start, count : ndarray of int, shape (shapes,)
        Where each begins in `rows`, and how many points it has.

    """

    first: Array
    last: Array
    step: Array
    rows: Array
    start: NDArray[np.int64]
    count: NDArray[np.int64]

    def place(self, shape: NDArray[np.int64], x: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """Row and position of values between grid points, and the scale of a derivative."""
        u = np.clip((x - self.first[shape]) / self.step[shape], 0, self.count[shape] - 1)
        i = np.clip(u.astype(np.int64), 1, self.count[shape] - 3)
        return self.start[shape] + i, u - i, 1 / self.step[shape]

    def taken(self, shapes: NDArray[np.int64]) -> 'Table':
        """Return some of the shapes; the rows stay where they are."""
        return replace(self, **{key: getattr(self, key)[shapes] for key in (
            'first', 'last', 'step', 'start', 'count')})


def cubic(rows: Array, at: NDArray[np.int64], t: Array, per: Array, slopes: bool = True
          ) -> tuple[Array, Array]:
    """Interpolate rows (Catmull-Rom), shape (n, groups), and the derivative by the nuisance."""
    powers = np.zeros((len(t), 2 if slopes else 1, 4))
    powers[:, 0] = t[:, None] ** np.arange(4)
    powers[:, 1:, 1:] = (per[:, None] * powers[:, 0, :3] * np.arange(1, 4))[:, None]
    found = np.matmul(powers @ _CATMULL_ROM, rows[at[:, None] + np.arange(-1, 3)])
    return found[:, 0], found[:, -1]


# Of the four values about a place: E. Catmull and R. Rom, 1974.
_CATMULL_ROM = 0.5 * np.array([[0.0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]])


def tables(nu: Array, step: Array, length: Array, interpolated: Array) -> 'Tables':
    """Tables of all shapes with a nuisance at the groups' frequencies, in blocks of means."""
    return _tables(np.stack((nu, step, length, interpolated)).tobytes())


@dataclass(frozen=True)
class Tables:
    """Tables of the free terms, each its own, of the low-passes and of the high-passes."""

    terms: tuple[Table, ...]
    low_pass: Table
    high_pass: Table

    def ranges(self, family: NDArray[np.int64]) -> tuple[Array, Array]:
        """First and last value of every nuisance beside low-passes, shape (n, nuisances)."""
        return self._ranges[0, family], self._ranges[1, family]

    @cached_property
    def _ranges(self) -> Array:
        own = [*self.terms, self.low_pass, self.high_pass]
        shape = (len(self.low_pass.first), len(own))
        return np.stack([np.stack([np.broadcast_to(end, shape[:1]) for end in ends], axis=1)
                         for ends in ([table.first for table in own],
                                      [table.last for table in own])])


@lru_cache(maxsize=8)
def _tables(layout: bytes) -> Tables:
    nu, step, length, interpolated = np.frombuffer(layout).reshape(4, -1)
    band = Band(float(nu[0]), float(nu[min(FEWEST_GROUPS, len(nu) - 1)]))
    return Tables(tuple(table_of((shape,), nu, band) for shape in FREE_TERMS),
                  table_of(LOW_PASSES, nu, band, Response(nu, step, length, interpolated)),
                  table_of(HIGH_PASSES, nu, band))


class Response:
    """
    What groups see of a filter: the mean over their band, and what is folded and leaks there.

    A mean over m samples passes (sin(pi m nu)/(m sin(pi nu)))^2 of what is m times as fast as its
    rate allows; of white noise all that is folded adds up to 1, behind a filter it does not. The
    ends of a block of L points leak what is slower, f, into the coefficients about kappa: over an
    even and an odd one (1/sin(pi (kappa - f)) - 1/sin(pi (kappa + f)))^2 / 2L a unit of f.

    Where the mean of its neighbours stands in for a lost sample, what that mean takes out is
    missing, and the error is added at every frequency: of filtered noise less than of white noise.
    """

    def __init__(self, nu: Array, step: Array, length: Array, interpolated: Array) -> None:
        at, weight, first = [], [], []
        count = 0
        for each, means, points in zip(nu.tolist(), step.tolist(), length.tolist(), strict=True):
            inside, share = _folded(each, means)
            slower = each * 0.5 ** np.arange(1.5, max(np.log2(each / _SLOWEST), 2))
            kappa, f = means * each, means * slower
            leak = (f * np.log(2) / (2 * points)
                    * (1 / np.sin(np.pi * (kappa - f)) - 1 / np.sin(np.pi * (kappa + f)))**2)
            first.append(count)
            at += [inside, slower]
            # Of white noise a coefficient holds as much as without leaks.
            weight += [share * (1 - leak.sum()), leak]
            count += len(inside) + len(slower)
        self._at, self._weight, self._first = np.concatenate(at), np.concatenate(weight), first
        self._kept = (1 - interpolated * _taken_by_mean(nu))**2
        self._lost = interpolated * (1 - interpolated)
        self._taken = _taken_by_mean(_EVERY)**2

    def of(self, power: Power, corner: float) -> Array:
        """Return it of a low-pass."""
        passed = np.add.reduceat(power(self._at, corner) * self._weight, self._first)
        error = self._lost * (power(_EVERY, corner) * self._taken).mean()
        return np.asarray((passed * self._kept + error)
                          / (self._kept + self._lost * self._taken.mean()) + _ROUNDING)


def _taken_by_mean(nu: Array) -> Array:
    """Share of an amplitude that the mean of the neighbours of a sample takes out."""
    return np.asarray(1 - np.cos(2 * np.pi * nu[..., None] * np.arange(1, NEIGHBOURS + 1)
                                 ).mean(axis=-1))


def _folded(nu: float, means: float) -> tuple[Array, Array]:
    """Give places whose power means over a band see, and how much of it."""
    # A band is an eighth of an octave, unless half the sample rate ends it.
    inside = np.minimum(nu * 2.0**(_POINTS * min(1 / 16, float(np.log2(0.5 / nu)))), 0.4999)
    # Below a fiftieth of their rate, means of samples fold next to nothing.
    if nu * means < 0.02:
        return inside, _GAUSS
    fold = np.arange(-min(_FOLDS, (means - 1) // 2), min(_FOLDS, means // 2) + 1)
    places = inside[:, None] + fold / means
    share = (np.sin(np.pi * means * inside)[:, None] / (means * np.sin(np.pi * places)))**2
    # What is folded more often is taken to be as strong as at the last.
    share[:, -1] += np.maximum(1 - share.sum(axis=1), 0.0)
    return (np.minimum(np.minimum(abs(places), 1 - places), 0.4999).ravel(),
            (_GAUSS[:, None] * share).ravel())


def table_of(shapes: tuple[Shape, ...], nu: Array, band: Band, seen: Response | None = None
             ) -> Table:
    """Tabulate shapes on their grids; low-passes as they are seen."""
    rows, grids = [], []
    for shape in shapes:
        assert shape.grid is not None
        grid = shape.grid(band)
        values = grid.first + grid.step * np.arange(
            max(int(np.ceil((grid.last - grid.first) / grid.step)) + 1, 5))
        grids.append(values)
        rows += [np.log(shape.power(nu, value) if seen is None else seen.of(shape.power, value))
                 for value in values.tolist()]
    count = np.array([len(values) for values in grids])
    return Table(np.array([v[0] for v in grids]), np.array([v[-1] for v in grids]),
                 np.array([v[1] - v[0] for v in grids]), np.stack(rows),
                 np.cumsum(count) - count, count)
