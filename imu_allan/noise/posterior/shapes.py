# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The spectral shapes that a noise model can contain, as small objects in one table.

A term is added with an amplitude; a response multiplies everything before it in the signal path.
Either has at most one nuisance parameter on a uniform grid: an exponent, or the logarithm of a
time or corner. Frequencies are in cycles per sample; grids depend on the length of the record.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

from imu_allan.arrays import Array, Ints
from imu_allan.noise import spectrum
import numpy as np

Power = Callable[[Array, float], Array]
"""Maps frequencies in cycles per sample and a nuisance to power, up to a constant factor."""
Grid = Callable[[float, float], Array]
"""Maps the lowest frequency and the lowest possible edge of a record to values of a nuisance."""

LOWEST_CORNER = 1e-3
"""Lowest corner of a low-pass in cycles per sample: below, slow drift looks like a pass band."""
FEWEST_GROUPS = 24
"""Fewest bands that a model must describe: three octaves are enough to separate the terms."""


@dataclass(frozen=True)
class Shape:
    """
    A term or response that a spectrum can contain.

    Attributes
    ----------
    key : str
    prior : float
        Prior probability of presence: of a term per unit of the logarithm of its amplitude, of a
        response in total.
    power : callable
        Power at frequencies in cycles per sample, given the nuisance.
    grid : callable, optional
        Uniform grid of the nuisance.
    at_output : bool
        Whether the term is added after all filters.
    like : str
        Key of the term that gaps and the ends of a record affect in the same way.

    """

    key: str
    prior: float
    power: Power
    grid: Grid | None = None
    at_output: bool = False
    like: str = ''


def _grid(first: float, last: float, step: float) -> Array:
    """Return a grid of at least five values that reaches `last`."""
    return np.asarray(first + step * np.arange(max(int(np.ceil((last - first) / step)) + 1, 5)))


def _of_corner(highest: float, step: float = 0.1) -> Grid:
    """Return a grid of log corners, from the lowest with enough bands below it to `highest`."""
    def grid(_: float, lowest_edge: float) -> Array:
        lowest = max(lowest_edge, LOWEST_CORNER)
        return _grid(np.log(min(lowest, highest / 2)), np.log(highest), step)
    return grid


def _butterworth(order: int) -> Power:
    return lambda nu, corner: 1 / (1 + (np.tan(np.pi * nu) / np.exp(corner)) ** (2 * order))


def _moving_average(times: int) -> Power:
    return lambda nu, corner: (np.sinc(nu / np.exp(corner)) / np.sinc(nu)) ** (2 * times)


def _high_pass(nu: Array, corner: float) -> Array:
    """Power response of a first-order high-pass, with leakage at the ends of a finite record."""
    falls = 1 / (1 + (np.sin(np.pi * nu) / np.pi)**2 * np.exp(-2 * corner))
    leak = min(float(nu[0]) / (np.pi * np.exp(corner)), 1.0)
    return np.asarray(1 - falls * (1 - leak))


WHITE, FLICKER, WALK = 'noise_density', 'bias_instability', 'rate_random_walk'

TERM_SHAPES = (
    Shape('quantization_noise', 0.3, lambda nu, _: spectrum.quantization(nu, 1.0), at_output=True),
    Shape(WHITE, 1.0, lambda nu, _: spectrum.white(nu, 1.0)),
    Shape(FLICKER, 0.15, lambda nu, _: spectrum.flicker(nu, 1.0)),
    Shape(WALK, 0.15, lambda nu, _: spectrum.random_walk(nu, 1.0)),
    Shape('output_noise', 0.02, lambda nu, _: spectrum.white(nu, 1.0), at_output=True,
          like=WHITE),
    Shape('smooth_drift', 0.03, lambda nu, _: spectrum.random_walk(nu, 1.0)**2, like=WALK),
)
"""
Terms without a nuisance. Every model contains white noise; output noise needs a filter before it.

Smooth drift is a mean that moves smoothly in a way that no trend of the list describes. Its
spectrum is f^-4, like that of an integrated random walk.
"""

FREE_SHAPES = (
    Shape('power_law', 0.15, lambda nu, alpha: spectrum.power_law(nu, 1.0, alpha),
          # Flatter noise would take the place of white noise behind an unlisted filter.
          lambda *_: _grid(0.4, 1.9, 0.1), like=FLICKER),
    Shape('gauss_markov', 0.05,
          lambda nu, time: spectrum.gauss_markov(nu, 1.0, float(np.exp(time))),
          lambda slowest, _: _grid(np.log(50.0), max(
              -np.log(2 * np.pi * slowest), np.log(50.0) + 1.4), 0.25), like=WHITE),
)
"""Terms with a nuisance: slow noise of any exponent, and a Gauss-Markov process."""

LOW_PASSES = (
    Shape('exponential_average', 3.0,
          lambda nu, corner: 1 / (1 + (np.sin(np.pi * nu) / np.exp(corner)) ** 2),
          _of_corner(60.0)),
    # The notches need a finer grid than the other filters.
    Shape('moving_average', 0.05, _moving_average(1), _of_corner(0.9, 0.04)),
    # A Bartlett window, and the decimator of a delta-sigma converter.
    Shape('moving_average_2', 0.05, _moving_average(2), _of_corner(0.9)),
    Shape('moving_average_3', 0.05, _moving_average(3), _of_corner(0.9)),
    Shape('two_poles', 0.05, lambda nu, corner: _butterworth(1)(nu, corner)**2, _of_corner(20.0)),
    Shape('butterworth_1', 0.05, _butterworth(1), _of_corner(20.0)),
    Shape('butterworth_2', 0.05, _butterworth(2), _of_corner(4.0)),
    Shape('butterworth_3', 0.05, _butterworth(3), _of_corner(4.0)),
    Shape('butterworth_4', 0.05, _butterworth(4), _of_corner(4.0)),
    Shape('gauss', 0.05, lambda nu, corner: np.exp(-np.log(2) * (nu / np.exp(corner)) ** 2),
          _of_corner(0.8)),
)
"""Low-pass responses, at most one per model."""
EXPONENTIAL_AVERAGE = 0
"""The only low-pass that may be too gentle to be detected."""

HIGH_PASSES = (Shape('high_pass', 0.1, _high_pass, lambda slowest, _: _grid(
    np.log(slowest / 2), np.log(max(0.2, 2 * slowest)), 0.25)),)
"""A filter that tracks and subtracts a bias is slower than a fifth of the sample rate."""


@dataclass(frozen=True)
class Table:
    """
    Logarithm of the power of shapes on their grids, with cubic interpolation between grid points.

    Attributes
    ----------
    first, last, step : ndarray, shape (shapes,)
        Ends and spacing of each grid.
    rows : ndarray, shape (points, groups)
        Values of all shapes, one shape after the other.
    start, count : ndarray of int, shape (shapes,)
        First row of each shape, and its number of grid points.

    """

    first: Array
    last: Array
    step: Array
    rows: Array
    start: Ints
    count: Ints

    def interpolated(self, shape: Ints, x: Array, slopes: bool = True,
                     rows: Array | None = None) -> tuple[Array, Array]:
        """
        Return values of shapes at nuisances `x`, and derivatives, each of shape (n, groups).

        `rows`: other values on the same grids.
        """
        place = np.clip((x - self.first[shape]) / self.step[shape], 0, self.count[shape] - 1)
        point = np.clip(place.astype(np.int64), 1, self.count[shape] - 3)
        powers = np.zeros((len(x), 2 if slopes else 1, 4))
        powers[:, 0] = (place - point)[:, None] ** np.arange(4)
        powers[:, 1:, 1:] = ((1 / self.step[shape])[:, None] * powers[:, 0, :3]
                             * np.arange(1, 4))[:, None]
        around = (self.start[shape] + point)[:, None] + np.arange(-1, 3)
        found = np.matmul(powers @ _CATMULL_ROM, (self.rows if rows is None else rows)[around])
        return found[:, 0], found[:, -1]

    def select(self, shapes: Ints) -> 'Table':
        """Return a selection of the shapes, which shares `rows` with this table."""
        return replace(self, **{key: getattr(self, key)[shapes] for key in (
            'first', 'last', 'step', 'start', 'count')})


# Weights of the four values around a position: E. Catmull and R. Rom, 1974.
_CATMULL_ROM = 0.5 * np.array([[0.0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]])


def tables(nu: Array, step: Array, length: Array) -> 'Tables':
    """Return cached tables of all shapes with a nuisance, at the frequencies of the groups."""
    return _tables(np.stack((nu, step, length)).tobytes())


@dataclass(frozen=True)
class Tables:
    """
    Tables of all shapes with a nuisance: the low-passes, the high-pass, each term by itself.

    `ranges`, shape (2, low-passes, nuisances): first and last values of the nuisances of the terms
    and the filters, given the low-pass.
    """

    terms: tuple[Table, ...]
    low_pass: Table
    high_pass: Table
    ranges: Array


@lru_cache(maxsize=8)
def _tables(layout: bytes) -> Tables:
    nu, step, length = np.frombuffer(layout).reshape(3, -1)
    terms = tuple(table_of((shape,), nu) for shape in FREE_SHAPES)
    response = Response(nu, step, length)
    low_pass, high_pass = (table_of(own, nu, response) for own in (LOW_PASSES, HIGH_PASSES))
    ends = [np.broadcast_arrays(table.first, table.last, low_pass.first)[:2]
            for table in (*terms, low_pass, high_pass)]
    return Tables(terms, low_pass, high_pass, np.stack(ends, axis=-1))


class Response:
    """
    Effect of a filter on the power of groups: its mean over the band, with aliasing and leakage.

    The mean of m samples passes (sin(pi m nu)/(m sin(pi nu)))^2 of the power at an alias nu. For
    white noise the aliases add up to 1; behind a filter they do not. Power at a lower frequency f
    leaks at the ends of a block of L points into the coefficients near kappa. Averaged over an
    even and an odd one this is (1/sin(pi (kappa - f)) - 1/sin(pi (kappa + f)))^2 / 2L per unit f.
    """

    def __init__(self, nu: Array, step: Array, length: Array) -> None:
        frequencies, weights = [], []
        for group, means, points in zip(nu.tolist(), step.tolist(), length.tolist(), strict=True):
            inside, share = _folded(group, means)
            # Neglect leakage from below a quarter of the lowest corner.
            slower = group * 0.5 ** np.arange(1.5, max(np.log2(group / (LOWEST_CORNER / 4)), 2))
            kappa, f = means * group, means * slower
            leak = (f * np.log(2) / (2 * points)
                    * (1 / np.sin(np.pi * (kappa - f)) - 1 / np.sin(np.pi * (kappa + f)))**2)
            frequencies.append(np.concatenate((inside, slower)))
            # Leakage does not change the power of white noise.
            weights.append(np.concatenate((share * (1 - leak.sum()), leak)))
        self._frequency, self._weight = np.concatenate(frequencies), np.concatenate(weights)
        self._first = np.cumsum([0, *(len(own) for own in frequencies[:-1])])

    def of(self, power: Power, corner: float) -> Array:
        """Return the response to a low-pass, relative to white noise without a filter."""
        passed = np.add.reduceat(power(self._frequency, corner) * self._weight, self._first)
        # The smallest response keeps logarithms finite.
        return np.asarray(passed + 1e-15)


def _folded(nu: float, means: float) -> tuple[Array, Array]:
    """Return the frequencies whose power folds into a band of block means, and their weights."""
    # Nodes and weights of Gauss-Legendre quadrature.
    nodes, weights = np.sqrt(0.6) * np.arange(-1.0, 2.0), np.array([5.0, 8.0, 5.0]) / 18
    # A band is an eighth of an octave wide, unless it is cut at half the sample rate.
    inside = np.minimum(nu * 2.0**(nodes * min(1 / 16, float(np.log2(0.5 / nu)))), 0.4999)
    # Slower, aliasing is negligible: even behind a high-pass, the ends of the record leak more.
    if nu * means < 0.002:
        return inside, weights
    # Aliases beyond the fourth hold 2 % of the power.
    fold = np.arange(-min(4, (means - 1) // 2), min(4, means // 2) + 1)
    places = inside[:, None] + fold / means
    share = (np.sin(np.pi * means * inside)[:, None] / (means * np.sin(np.pi * places)))**2
    # Aliases of higher order are assumed to be as strong as the last one.
    share[:, -1] += np.maximum(1 - share.sum(axis=1), 0.0)
    return (np.minimum(np.minimum(abs(places), 1 - places), 0.4999).ravel(),
            (weights[:, None] * share).ravel())


def table_of(shapes: tuple[Shape, ...], nu: Array, response: Response | None = None) -> Table:
    """Tabulate log power on the grids of shapes; with `response`, as the groups see a filter."""
    ends = float(nu[0]), float(nu[min(FEWEST_GROUPS, len(nu) - 1)])
    grids = [shape.grid(*ends) for shape in shapes if shape.grid is not None]
    rows = [np.log(shape.power(nu, value) if response is None else response.of(shape.power, value))
            for shape, grid in zip(shapes, grids, strict=True) for value in grid.tolist()]
    first, second, last = np.array([(grid[0], grid[1], grid[-1]) for grid in grids]).T
    count = np.array([len(grid) for grid in grids])
    return Table(first, last, second - first, np.stack(rows), np.cumsum(count) - count, count)
