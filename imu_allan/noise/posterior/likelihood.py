# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Negative log posterior of many models in one batch, with gradient and Fisher information.

A model is a row: its axis, its shapes and their parameters. These are nuisances and logarithms of
amplitudes, in units of the smallest amplitude that the record can detect. Rows of similar
structure are computed together, whatever their axis. The mean enters by restricted likelihood:
with A = X' W X and b = X' W c of the regressors X,

    ln L = -1/2 sum n (ln lambda + P/lambda) + 1/2 b' A^-1 b - 1/2 ln det A.

References
----------
P. Whittle, Ark. Mat. 2 (1953). H. D. Patterson and R. Thompson, Biometrika 58 (1971).

"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.posterior import shapes, thresholds_and_priors as priors
from imu_allan.noise.posterior.regression import mean, regressors, residual_power
from imu_allan.noise.record.groups import Groups
import numpy as np
from scipy.special import digamma

PLAIN = len(shapes.TERM_SHAPES)
# White noise is in every model, even if it is too weak to be detected.
Q, N, B, K, OUTPUT, SMOOTH = range(PLAIN)
LAW, ALPHA, PROCESS, TIME, LOW, HIGH = range(PLAIN, PLAIN + 6)
SLOTS = HIGH + 1
"""Parameters of a row: amplitudes of the terms, amplitude and nuisance of each free term, corners
of the low-pass and of the high-pass."""
AMPLITUDES = np.array([*range(PLAIN), LAW, PROCESS])
NUISANCES = np.array([ALPHA, TIME, LOW, HIGH])
AT_OUTPUT = np.array([shape.at_output for shape in shapes.TERM_SHAPES])
SLOWER = np.array([K, SMOOTH, PROCESS])
"""Slots of noise slower than flicker: random walk, smooth drift, Gauss-Markov process."""
GENTLE_FAMILY = [shape.key for shape in shapes.LOW_PASSES].index('exponential_average')
_WALL = 0.05
"""Standard deviation of the penalty on a nuisance beyond an end of its range."""
_COSTLY = np.array([*np.flatnonzero(AT_OUTPUT), *NUISANCES])
"""Slots that make a batch slower to compute."""


@dataclass(frozen=True)
class Spectra:
    """
    Spectra of several axes over the same bands, with everything that the posterior needs.

    Attributes
    ----------
    frequency : ndarray, shape (groups,)
        In Hz.
    dof, power : ndarray, shape (spectra, groups)
        Degrees of freedom are zero where a line was left out.
    whole : ndarray, shape (spectra, groups)
        Degrees of freedom before they were reduced for model uncertainty.
    columns : ndarray, shape (spectra, terms, groups)
        Power of the terms at unit amplitude, which is the detection limit of the record.
    unit : ndarray, shape (spectra, terms)
        Detection limit in SI units.
    like : ndarray, shape (spectra, free terms, groups)
        Logarithm of the effect of gaps and record ends on a free term.
    sizes : tuple of ndarray, shape (spectra, points)
        For each free term, the logarithm of its detection limit along its grid.
    free : tuple of Table
        For each free term, its power at the detection limit; one shape per spectrum.
    gentle : ndarray, shape (spectra,)
        Logarithm of the corner of the gentlest roll-off that can be detected.
    products : ndarray, shape (spectra, records * regressors * (1 + regressors), groups)
        `along` and `among` of `Groups`; each record has its own regressors.
    records : int
    tables : Tables
    unexplained : ndarray, shape (spectra, groups + 1)
        Loss of the groups from a given one on, when they are left unexplained.

    """

    frequency: Array
    dof: Array
    power: Array
    whole: Array
    columns: Array
    unit: Array
    like: Array
    sizes: tuple[Array, ...]
    free: tuple[shapes.Table, ...]
    gentle: Array
    products: Array
    records: int
    tables: shapes.Tables
    unexplained: Array

    @property
    def regressors(self) -> int:
        """Return the number of regressors of a record."""
        # The products are r of regressors with the coefficients and r^2 among each other.
        return int(np.sqrt(self.products.shape[1] // self.records))

    def select(self, of: Ints) -> 'Spectra':
        """Return a selection of the spectra."""
        each = {key: getattr(self, key)[of] for key in (
            'dof', 'power', 'whole', 'columns', 'unit', 'like', 'gentle', 'products',
            'unexplained')}
        return replace(self, **each, sizes=tuple(size[of] for size in self.sizes),
                       free=tuple(table.select(of) for table in self.free))

    def with_regressors(self, groups: Sequence[Groups], of: Ints) -> 'Spectra':
        """Return a selection of the spectra, with the regressors of other groups."""
        return replace(self.select(of), products=regressors(groups))

    def with_dof(self, dof: Array) -> 'Spectra':
        """Return the same spectra with other degrees of freedom."""
        spectra = replace(self, dof=dof)
        return replace(spectra, unexplained=unexplained_losses(self.frequency, dof, self.power))


def half_octaves(frequency: Array) -> Ints:
    """Return the half-octave of each band: 0 at the highest frequency, negative below."""
    return np.asarray(np.floor(2 * np.log2(frequency / frequency[-1])), np.int64)


def unexplained_losses(frequency: Array, dof: Array, power: Array) -> Array:
    """Return the loss above each edge with free levels by half-octave, shape (n, groups+1)."""
    half = half_octaves(frequency)
    new = np.concatenate(([True], half[1:] != half[:-1]))
    number = np.cumsum(new) - 1
    # Many short runs give many groups of few degrees of freedom: groups of a band share a level.
    eighth = np.round(8 * np.log2(frequency / frequency[-1]))
    band = np.cumsum(new | np.concatenate(([False], np.diff(eighth) != 0))) - 1
    own = np.empty_like(dof)
    for row, known, each in zip(own, dof, power, strict=True):
        # A thousandth stands for zero degrees of freedom.
        shared = np.maximum(np.bincount(band, known), 1e-3)
        level = np.bincount(band, known * each) / shared
        # Cancels what a free level gains on average: half a nat where it is well determined.
        gain = np.log(shared / 2) - digamma(shared / 2)
        row[:] = 0.5 * known * (np.log(np.maximum(level, 1e-300)) + 1 + gain)[band]
        octave = np.bincount(number, known)[number]
        prior = np.log(priors.UNSEEN_LEVEL * np.sqrt(4 * np.pi / np.maximum(octave, 1.0)))
        row -= np.where(new & (octave > 0), prior, 0.0)
    ends = np.zeros((len(own), 1))
    return np.concatenate((np.cumsum(own[:, ::-1], axis=1)[:, ::-1], ends), axis=1)


@dataclass
class Rows:
    """
    Models, one per row.

    Attributes
    ----------
    of : ndarray of int, shape (rows,)
        Index of the spectrum that the model describes.
    x : ndarray, shape (rows, SLOTS)
        Parameters.
    has : ndarray of bool, shape (rows, SLOTS)
        Parameters that the model has.
    family : ndarray of int, shape (rows,)
        Index of the low-pass, if there is one.
    edge : ndarray of int, shape (rows,)
        First of the groups that are left unexplained.
    prior : ndarray, shape (rows,)
        Log prior of the structure.
    loss, hessian, evidence : ndarray
        Set by `imu_allan.noise.posterior.evidence.maximise_rows`.

    """

    of: Ints
    x: Array
    has: Bools
    family: Ints
    edge: Ints
    prior: Array
    loss: Array
    hessian: Array
    evidence: Array

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.of)

    def take(self, which: Ints | Bools | list[int]) -> 'Rows':
        """Return a selection of the rows, by index or by mask."""
        return Rows(*[array[which] for array in vars(self).values()])

    def best(self) -> 'Rows':
        """Return the row of the largest evidence."""
        return self.take([int(np.argmax(self.evidence))])

    @staticmethod
    def joined(parts: Sequence['Rows']) -> 'Rows':
        """Concatenate rows."""
        return Rows(*(np.concatenate(arrays) for arrays in zip(
            *(vars(part).values() for part in parts), strict=True)))


def batches(rows: Rows) -> list[Ints]:
    """Split rows into batches of similar structure that fit into the cache."""
    key = rows.has[:, _COSTLY] @ (1 << np.arange(len(_COSTLY)))
    order = np.argsort(key, kind='stable')
    found, begin = [], 0
    for end in (*(np.flatnonzero(np.diff(key[order])) + 1).tolist(), len(order)):
        # A few rows are faster to compute in a batch with slots they lack than in their own.
        if end - begin >= 24 or end == len(order) > begin:
            # At most 256 rows stay in the cache.
            found += np.array_split(order[begin:end], -(-(end - begin) // 256))
            begin = end
    return found


def spectrum(spectra: Spectra, rows: Rows, x: Array, slopes: bool = True
             ) -> tuple[Array, Array, Ints]:
    """
    Return the expected power of rows, and its derivatives by the slots that occur in any of them.

    Returns
    -------
    lam : ndarray, shape (rows, groups)
    jacobian : ndarray, shape (used slots, rows, groups)
        Derivatives; none without `slopes`, for rows that all describe the same spectrum.
    used : ndarray of int
        Slots of `jacobian`.

    """
    has, of = rows.has, _shared(rows.of)
    used = np.flatnonzero(has.any(axis=0))
    place = {slot: number for number, slot in enumerate(used.tolist())}
    shape = len(x), spectra.dof.shape[1]
    jacobian = np.empty((len(used) if slopes else 0, *shape))
    level = np.where(has[:, :PLAIN], np.exp(np.minimum(2 * x[:, :PLAIN], 120.0)), 0.0)
    if slopes:
        body, behind = np.zeros(shape), np.zeros(shape)
        for slot in used[used < PLAIN].tolist():
            part = np.multiply(spectra.columns[of, slot], 2 * level[:, slot, None],
                               out=jacobian[place[slot]])
            total = behind if AT_OUTPUT[slot] else body
            total += part
        body *= 0.5
        behind *= 0.5
    else:
        body, behind = (level[:, own] @ spectra.columns[of[0], own]
                        for own in (~AT_OUTPUT, AT_OUTPUT))
    for k, table in enumerate(spectra.free):
        slot = PLAIN + 2 * k
        if slot in place:
            value, slope = shapes.cubic(table.rows, *table.place(rows.of, x[:, slot + 1]), slopes)
            value = np.exp(np.minimum(2 * x[:, slot, None], 120.0) + value)
            value *= has[:, slot, None]
            body += value
            if slopes:
                np.multiply(value, 2, out=jacobian[place[slot]])
                np.multiply(value, slope, out=jacobian[place[slot + 1]])
    bends = [(slot, *shapes.cubic(table.rows, *table.place(family, x[:, slot]), slopes))
             for slot, table, family in (
                 (LOW, spectra.tables.low_pass, rows.family),
                 (HIGH, spectra.tables.high_pass, np.zeros_like(rows.family))) if slot in place]
    if bends:
        response = np.exp(sum(value * has[:, slot, None] for slot, value, _ in bends))
        body *= response
        if slopes:
            for slot, number in place.items():
                if slot < LOW and not (slot < PLAIN and AT_OUTPUT[slot]):
                    jacobian[number] *= response
            for slot, _, slope in bends:
                np.multiply(body, slope, out=jacobian[place[slot]])
    return np.maximum(body + behind, 1e-300), jacobian, used


def _shared(of: Ints) -> Ints:
    """Shorten an index that is the same for all rows to one entry, so that nothing is copied."""
    return of[:1] if (of == of[0]).all() else of


def _row_sums(values: Array, weights: Array) -> Array:
    """Add up each row with its weights; a single row of weights is that of all."""
    return np.asarray(values @ weights[0] if len(weights) == 1 else
                      np.einsum('rg,rg->r', values, weights))


def losses(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """Return the negative log posterior of rows, its gradient and the Fisher information."""
    value, slope, bend = log_prior(spectra, rows, x)
    loss, gradient, information = -value, -slope, np.zeros((len(x), SLOTS, SLOTS))
    for part in batches(rows):
        some = rows.take(part)
        lam, jacobian, used = spectrum(spectra, some, x[part])
        weight, misfit = _weighed(spectra, some, lam)
        products = spectra.products[_shared(some.of)]
        gain, size, covariance = mean(products, spectra.records, weight)
        about = residual_power(spectra.power[some.of], products, size, covariance)
        weighed = (jacobian * (0.5 * weight / lam)).transpose(1, 0, 2)
        loss[part] += misfit - gain
        gradient[part[:, None], used] += np.matmul(weighed, (lam - about)[:, :, None])[..., 0]
        information[part[:, None, None], used[:, None], used] = np.matmul(
            weighed, jacobian.transpose(1, 2, 0))
    diagonal = np.einsum('rii->ri', information)
    diagonal += bend
    gradient[~rows.has] = 0.0
    information *= rows.has[:, :, None] & rows.has[:, None, :]
    diagonal += ~rows.has
    return loss, gradient, information


def fitted_mean(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array, Array]:
    """Regress the mean beside rows: expected power, weights, sizes and covariance as in `mean`."""
    lam, _, _ = spectrum(spectra, rows, x, slopes=False)
    weight, _ = _weighed(spectra, rows, lam)
    _, size, covariance = mean(spectra.products[_shared(rows.of)], spectra.records, weight)
    return lam, weight, size, covariance


def losses_alone(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """
    Return the negative log posterior of rows, without derivatives, and the mean beside them.

    The mean is that of the first record: sizes and standard errors, shape (rows, regressors).
    """
    loss = -log_prior(spectra, rows, x)[0]
    sizes, errors = np.empty((2, len(x), spectra.regressors))
    for axis in np.unique(rows.of).tolist():
        own = np.flatnonzero(rows.of == axis)
        for part in batches(rows.take(own)):
            here = own[part]
            some = rows.take(here)
            lam, _, _ = spectrum(spectra, some, x[here], slopes=False)
            weight, misfit = _weighed(spectra, some, lam)
            gain, size, covariance = mean(spectra.products[[axis]], spectra.records, weight)
            loss[here] += misfit - gain
            sizes[here] = size[:, 0]
            errors[here] = np.sqrt(np.maximum(np.einsum('rii->ri', covariance[:, 0]), 0.0))
    return loss, sizes, errors


def _weighed(spectra: Spectra, rows: Rows, lam: Array) -> tuple[Array, Array]:
    """Return the weights of groups below the edge of each row, and the loss without the mean."""
    of, edge = _shared(rows.of), _shared(rows.edge)
    dof = spectra.dof[of]
    if edge.min() < lam.shape[1]:
        dof = dof * (np.arange(lam.shape[1]) < edge[:, None])
    weight = dof / lam
    twice = _row_sums(np.log(lam), dof) + _row_sums(weight, spectra.power[of])
    return weight, 0.5 * twice + spectra.unexplained[rows.of, rows.edge]


def log_prior(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """Return the log prior of parameters, its gradient and its negative curvature, by slot."""
    slope, bend = np.zeros(x.shape), np.zeros(x.shape)
    # Uniform in the logarithm of an amplitude above the detection limit.
    there = rows.has[:, AMPLITUDES]
    fall = there * np.exp(np.minimum(-2 * x[:, AMPLITUDES], 60.0))
    value = -np.log1p(fall).sum(axis=1)
    slope[:, AMPLITUDES] = 2 * fall / (1 + fall)
    # As for a nuisance, its range limits the uncertainty of what the record leaves open.
    bend[:, AMPLITUDES] = 4 * fall / (1 + fall)**2 + there * 4 / priors.COVERED**2
    exponent = rows.has[:, ALPHA]
    if exponent.any():
        # Normal about the exponent of flicker.
        off = exponent * (x[:, ALPHA] - 1) / priors.EXPONENT_SPREAD
        value -= 0.5 * off**2 + exponent * np.log(priors.EXPONENT_SPREAD * np.sqrt(2 * np.pi))
        slope[:, ALPHA] = -off / priors.EXPONENT_SPREAD
        bend[:, ALPHA] = 1 / priors.EXPONENT_SPREAD**2
    gentle = rows.has[:, LOW] & (rows.family == GENTLE_FAMILY)
    if gentle.any():
        # A roll-off too gentle to be detected counts like an amplitude below the detection limit.
        fall = gentle * np.exp(4 * np.minimum(x[:, LOW] - spectra.gentle[rows.of], 10.0))
        value -= np.log1p(fall)
        slope[:, LOW] = -4 * fall / (1 + fall)
        bend[:, LOW] = 16 * fall / (1 + fall)**2
    first, last = spectra.tables.ranges(rows.family)
    nuisance = x[:, NUISANCES]
    off = rows.has[:, NUISANCES] * (nuisance - np.clip(nuisance, first, last)) / _WALL
    value -= 0.5 * (off**2).sum(axis=1)
    slope[:, NUISANCES] -= off / _WALL
    # The range of a nuisance limits its uncertainty.
    bend[:, NUISANCES] += 4 / (last - first)**2 + (off != 0) / _WALL**2
    return value, slope, bend


def out_of_range(spectra: Spectra, rows: Rows, x: Array, gradient: Array) -> Bools:
    """Mark rows that have left the range of a nuisance towards a maximum still farther out."""
    first, last = spectra.tables.ranges(rows.family)
    nuisance = x[:, NUISANCES]
    off = nuisance - np.clip(nuisance, first, last)
    outwards = (gradient[:, NUISANCES] - off / _WALL**2) * off < 0
    return np.asarray((outwards & rows.has[:, NUISANCES]).any(axis=1))


def structure_prior(spectra: Spectra, rows: Rows) -> Array:
    """Return the log prior of the shapes of rows, their edges and the density of nuisances."""
    has, groups = rows.has, len(spectra.frequency)
    total = has[:, :PLAIN] @ np.log([shape.prior for shape in shapes.TERM_SHAPES])
    # Neither flicker nor slow noise with another exponent.
    alone = ~has[:, [B, LAW]].any(axis=1)
    total += np.log(priors.WITHOUT_FLICKER) * alone * has[:, SLOWER].sum(axis=1)
    first, last = spectra.tables.ranges(rows.family)
    width = last - first
    gentle = rows.family == GENTLE_FAMILY
    width[gentle, 2] = (spectra.gentle[rows.of] - first[:, 2])[gentle]
    width[:, 0] = 1.0    # The exponent has a normal prior instead of a uniform one.
    law, process = (shape.prior for shape in shapes.FREE_SHAPES)
    odds = np.array([law * priors.EXPONENT_ODDS, process, 1.0, shapes.HIGH_PASSES[0].prior]
                    ) / np.maximum(width, 0.5)
    odds[:, 2] *= np.array([shape.prior for shape in shapes.LOW_PASSES])[rows.family]
    total += (has[:, NUISANCES] * np.log(odds)).sum(axis=1)
    half = -half_octaves(spectra.frequency)[np.minimum(rows.edge, groups - 1)]
    return np.asarray(total + (rows.edge < groups) * (priors.TOP + priors.PER_HALF_OCTAVE * half))
