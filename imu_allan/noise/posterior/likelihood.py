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
from imu_allan.noise.posterior.regression import regress, regressors, residual_power
from imu_allan.noise.record.groups import Groups, half_octaves
import numpy as np
from scipy.special import digamma

PLAIN = len(shapes.TERM_SHAPES)
# White noise is in every model, even if it is too weak to be detected.
Q, N, B, K, OUTPUT, SMOOTH = range(PLAIN)
LAW, ALPHA, PROCESS, TIME, LOW, HIGH = range(PLAIN, PLAIN + 6)
SLOTS = HIGH + 1
"""Parameters of a row: log amplitudes of the terms, log amplitude and nuisance of each free term,
log corners of the low-pass and of the high-pass."""
FREE_SLOTS = (LAW, ALPHA), (PROCESS, TIME)
"""Log amplitude and nuisance of each free term, in the order of `FREE_SHAPES`."""
AMPLITUDES = np.array([*range(PLAIN), LAW, PROCESS])
NUISANCES = np.array([ALPHA, TIME, LOW, HIGH])
AT_OUTPUT = np.array([shape.at_output for shape in shapes.TERM_SHAPES])
SLOWER = np.array([K, SMOOTH, PROCESS])
"""Slots of noise slower than flicker: random walk, smooth drift, Gauss-Markov process."""
_WALL = 0.05
"""Standard deviation of the penalty on a nuisance beyond an end of its range."""
_COSTLY = np.array([*np.flatnonzero(AT_OUTPUT), *NUISANCES])
"""Slots that make a batch slower to compute."""


@dataclass(frozen=True)
class Spectra:
    """
    Spectra of several axes over the same bands, with everything that the posterior needs.

    Amplitudes are in units of the detection limit of the term in the record.

    Attributes
    ----------
    frequency, nu : ndarray, shape (groups,)
        In Hz, and in cycles per sample.
    dof, power : ndarray, shape (spectra, groups)
        Degrees of freedom are zero where a line was left out.
    nominal_dof : ndarray, shape (spectra, groups)
        Degrees of freedom before they were reduced for model uncertainty.
    design : ndarray, shape (spectra, terms, groups)
        Power of the terms at their detection limits.
    limit : ndarray, shape (spectra, terms)
        Detection limit of the amplitude in SI units.
    log_effect : ndarray, shape (spectra, free terms, groups)
        Logarithm of the effect of gaps and record ends on the power of a free term.
    free_log_limits : tuple of ndarray, shape (spectra, points)
        For each free term, the logarithm of its detection limit along its grid.
    free_tables : tuple of Table
        For each free term, its power at the detection limit; one shape per spectrum.
    gentlest_corner : ndarray, shape (spectra,)
        Logarithm of the corner of the gentlest roll-off that can be detected.
    products : ndarray, shape (spectra, records * regressors * (1 + regressors), groups)
        `along` and `among` of `Groups`; each record has its own regressors.
    records : int
    tables : Tables
    unexplained : ndarray, shape (spectra, groups + 1)
        Loss of the groups from a given one on, when they are left unexplained.

    """

    frequency: Array
    nu: Array
    dof: Array
    power: Array
    nominal_dof: Array
    design: Array
    limit: Array
    log_effect: Array
    free_log_limits: tuple[Array, ...]
    free_tables: tuple[shapes.Table, ...]
    gentlest_corner: Array
    products: Array
    records: int
    tables: shapes.Tables
    unexplained: Array

    @property
    def regressors(self) -> int:
        """Return the number of regressors of a record."""
        # The products are r of regressors with the coefficients and r^2 among each other.
        return int(np.sqrt(self.products.shape[1] // self.records))

    def select(self, which: Ints) -> 'Spectra':
        """Return a selection of the spectra."""
        arrays = {key: getattr(self, key)[which] for key in (
            'dof', 'power', 'nominal_dof', 'design', 'limit', 'log_effect', 'gentlest_corner',
            'products', 'unexplained')}
        return replace(self, **arrays,
                       free_log_limits=tuple(limit[which] for limit in self.free_log_limits),
                       free_tables=tuple(table.select(which) for table in self.free_tables))

    def with_regressors(self, groups: Sequence[Groups], which: Ints) -> 'Spectra':
        """Return a selection of the spectra, with the regressors of other groups."""
        return replace(self.select(which), products=regressors(groups))

    def with_dof(self, dof: Array) -> 'Spectra':
        """Return the same spectra with other degrees of freedom."""
        spectra = replace(self, dof=dof)
        return replace(spectra, unexplained=unexplained_losses(self.frequency, dof, self.power))


def unexplained_losses(frequency: Array, dof: Array, power: Array) -> Array:
    """Return the loss above each edge with free levels by half-octave, shape (n, groups+1)."""
    # The first group of each half-octave
    first = np.diff(half_octaves(frequency), prepend=np.inf) != 0
    octave = np.cumsum(first) - 1
    # Many short runs give many groups of few degrees of freedom: groups of a band share a level.
    eighth = np.round(8 * np.log2(frequency / frequency[-1]))
    band = np.cumsum(first | (np.diff(eighth, prepend=np.inf) != 0)) - 1
    losses = np.empty_like(dof)
    for loss, own_dof, own_power in zip(losses, dof, power, strict=True):
        # A thousandth stands for zero degrees of freedom.
        band_dof = np.maximum(np.bincount(band, own_dof), 1e-3)
        level = np.bincount(band, own_dof * own_power) / band_dof
        # Cancels what a free level gains on average: half a nat where it is well determined.
        gain = np.log(band_dof / 2) - digamma(band_dof / 2)
        loss[:] = 0.5 * own_dof * (np.log(np.maximum(level, 1e-300)) + 1 + gain)[band]
        octave_dof = np.bincount(octave, own_dof)[octave]
        prior = np.log(priors.UNSEEN_LEVEL * np.sqrt(4 * np.pi / np.maximum(octave_dof, 1.0)))
        loss -= np.where(first & (octave_dof > 0), prior, 0.0)
    from_edge = np.cumsum(losses[:, ::-1], axis=1)[:, ::-1]
    return np.concatenate((from_edge, np.zeros((len(losses), 1))), axis=1)


@dataclass
class Rows:
    """
    Models, one per row.

    Attributes
    ----------
    spectrum : ndarray of int, shape (rows,)
        Index of the spectrum that the model describes.
    x : ndarray, shape (rows, SLOTS)
        Parameters.
    present : ndarray of bool, shape (rows, SLOTS)
        Parameters that the model has.
    low_pass : ndarray of int, shape (rows,)
        Index of the low-pass, if there is one.
    edge : ndarray of int, shape (rows,)
        First of the groups that are left unexplained.
    prior : ndarray, shape (rows,)
        Log prior of the structure.
    loss, hessian, evidence : ndarray, shapes (rows,), (rows, SLOTS, SLOTS) and (rows,)
        Set by `imu_allan.noise.posterior.evidence.maximise_rows`.

    """

    spectrum: Ints
    x: Array
    present: Bools
    low_pass: Ints
    edge: Ints
    prior: Array
    loss: Array
    hessian: Array
    evidence: Array

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.spectrum)

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
    """Split rows into batches of similar structure that fit into the cache; return indices."""
    structure = rows.present[:, _COSTLY] @ (1 << np.arange(len(_COSTLY)))
    order = np.argsort(structure, kind='stable')
    found, begin = [], 0
    for end in (*(np.flatnonzero(np.diff(structure[order])) + 1).tolist(), len(order)):
        # A few rows are faster to compute in a batch with slots they lack than in their own.
        if end - begin >= 24 or end == len(order) > begin:
            # At most 256 rows stay in the cache.
            found += np.array_split(order[begin:end], -(-(end - begin) // 256))
            begin = end
    return found


def model_spectrum(spectra: Spectra, rows: Rows, x: Array, slopes: bool = True
                   ) -> tuple[Array, Array, Ints]:
    """
    Return the expected power of rows, and its derivatives by the slots that occur in any of them.

    Returns
    -------
    expected : ndarray, shape (rows, groups)
    jacobian : ndarray, shape (used slots, rows, groups)
        Derivatives; none without `slopes`, for rows that all describe the same spectrum.
    used : ndarray of int
        Slots of `jacobian`.

    """
    present, of = rows.present, _shared(rows.spectrum)
    used = np.flatnonzero(present.any(axis=0))
    shape = len(x), spectra.dof.shape[1]
    jacobian = np.empty((len(used) if slopes else 0, *shape))
    by_slot = dict(zip(used.tolist(), jacobian, strict=slopes))
    squares = np.where(present[:, :PLAIN], np.exp(np.minimum(2 * x[:, :PLAIN], 120.0)), 0.0)
    # Noise of the sensor passes the filters; noise of the output is added behind them.
    if slopes:
        sensor, output = np.zeros(shape), np.zeros(shape)
        for slot in used[used < PLAIN].tolist():
            slope = np.multiply(spectra.design[of, slot], 2 * squares[:, slot, None],
                                out=by_slot[slot])
            total = output if AT_OUTPUT[slot] else sensor
            total += slope
        sensor *= 0.5
        output *= 0.5
    else:
        sensor, output = (squares[:, own] @ spectra.design[of[0], own]
                          for own in (~AT_OUTPUT, AT_OUTPUT))
    for (slot, nuisance), table in zip(FREE_SLOTS, spectra.free_tables, strict=True):
        if slot in used:
            power, slope = table.interpolated(rows.spectrum, x[:, nuisance], slopes)
            power = np.exp(np.minimum(2 * x[:, slot, None], 120.0) + power)
            power *= present[:, slot, None]
            sensor += power
            if slopes:
                np.multiply(power, 2, out=by_slot[slot])
                np.multiply(power, slope, out=by_slot[nuisance])
    filters = [(slot, *table.interpolated(shape_index, x[:, slot], slopes))
               for slot, table, shape_index in (
                   (LOW, spectra.tables.low_pass, rows.low_pass),
                   (HIGH, spectra.tables.high_pass, np.zeros_like(rows.low_pass)))
               if slot in used]
    if filters:
        response = np.exp(sum(value * present[:, slot, None] for slot, value, _ in filters))
        sensor *= response
        for slot, slope in by_slot.items():
            if slot < LOW and slot not in (Q, OUTPUT):
                slope *= response
        if slopes:
            for slot, _, slope in filters:
                np.multiply(sensor, slope, out=by_slot[slot])
    return np.maximum(sensor + output, 1e-300), jacobian, used


def _shared(index: Ints) -> Ints:
    """Shorten an index that is the same for all rows to one entry, so that nothing is copied."""
    return index[:1] if (index == index[0]).all() else index


def _row_sums(values: Array, weights: Array) -> Array:
    """Add up each row with its weights; a single row of weights is that of all."""
    return np.asarray(values @ weights[0] if len(weights) == 1 else
                      np.einsum('rg,rg->r', values, weights))


def losses(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """Return the negative log posterior of rows, its gradient and the Fisher information."""
    log_density, slope, curvature = log_prior(spectra, rows, x)
    loss, gradient, information = -log_density, -slope, np.zeros((len(x), SLOTS, SLOTS))
    for batch in batches(rows):
        some = rows.take(batch)
        expected, jacobian, used = model_spectrum(spectra, some, x[batch])
        products = spectra.products[_shared(some.spectrum)]
        own_loss, weight, size, covariance = _regressed(spectra, some, expected, products)
        residual = residual_power(spectra.power[some.spectrum], products, size, covariance)
        weighted = (jacobian * (0.5 * weight / expected)).transpose(1, 0, 2)
        loss[batch] += own_loss
        gradient[batch[:, None], used] += np.matmul(
            weighted, (expected - residual)[:, :, None])[..., 0]
        information[batch[:, None, None], used[:, None], used] = np.matmul(
            weighted, jacobian.transpose(1, 2, 0))
    diagonal = np.einsum('rii->ri', information)
    diagonal += curvature
    gradient[~rows.present] = 0.0
    information *= rows.present[:, :, None] & rows.present[:, None, :]
    diagonal += ~rows.present
    return loss, gradient, information


def fitted_mean(spectra: Spectra, rows: Rows, x: Array
                ) -> tuple[Array, Array, Array, Array, Array]:
    """Return the expected power of rows of one spectrum, and the rest as from `_regressed`."""
    expected, _, _ = model_spectrum(spectra, rows, x, slopes=False)
    products = spectra.products[_shared(rows.spectrum)]
    return expected, *_regressed(spectra, rows, expected, products)


def losses_and_means(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """
    Return the negative log posterior of rows, without derivatives, and the mean beside them.

    The mean is that of the first record: sizes and standard errors, shape (rows, regressors).
    """
    loss = -log_prior(spectra, rows, x)[0]
    sizes, errors = np.empty((2, len(x), spectra.regressors))
    for spectrum in np.unique(rows.spectrum).tolist():
        own = np.flatnonzero(rows.spectrum == spectrum)
        for part in batches(rows.take(own)):
            batch = own[part]
            _, own_loss, _, size, covariance = fitted_mean(spectra, rows.take(batch), x[batch])
            loss[batch] += own_loss
            sizes[batch] = size[:, 0]
            errors[batch] = np.sqrt(np.maximum(np.einsum('rii->ri', covariance[:, 0]), 0.0))
    return loss, sizes, errors


def _regressed(spectra: Spectra, rows: Rows, expected: Array, products: Array
               ) -> tuple[Array, Array, Array, Array]:
    """
    Regress the mean beside rows, given their expected power and the products with regressors.

    Returns: loss, weights of the groups, which are zero from the edge of each row on, sizes and
    covariance as in `regress`.
    """
    of, edge = _shared(rows.spectrum), _shared(rows.edge)
    dof = spectra.dof[of]
    if edge.min() < expected.shape[1]:
        dof = dof * (np.arange(expected.shape[1]) < edge[:, None])
    weight = dof / expected
    twice = _row_sums(np.log(expected), dof) + _row_sums(weight, spectra.power[of])
    misfit = 0.5 * twice + spectra.unexplained[rows.spectrum, rows.edge]
    gain, size, covariance = regress(products, spectra.records, weight)
    return misfit - gain, weight, size, covariance


def log_prior(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """Return the log prior of parameters, its gradient and its negative curvature, by slot."""
    slope, curvature = np.zeros(x.shape), np.zeros(x.shape)
    # Uniform in the logarithm of an amplitude above the detection limit.
    present = rows.present[:, AMPLITUDES]
    fall = present * np.exp(np.minimum(-2 * x[:, AMPLITUDES], 60.0))
    value = -np.log1p(fall).sum(axis=1)
    slope[:, AMPLITUDES] = 2 * fall / (1 + fall)
    # As for a nuisance, its range limits the uncertainty of what the record leaves open.
    curvature[:, AMPLITUDES] = 4 * fall / (1 + fall)**2 + present * 4 / priors.COVERED**2
    with_exponent = rows.present[:, ALPHA]
    if with_exponent.any():
        # Normal about the exponent of flicker.
        spread = priors.EXPONENT_SPREAD
        off = with_exponent * (x[:, ALPHA] - 1) / spread
        value -= 0.5 * off**2 + with_exponent * np.log(spread * np.sqrt(2 * np.pi))
        slope[:, ALPHA] = -off / spread
        curvature[:, ALPHA] = 1 / spread**2
    gentle = rows.present[:, LOW] & (rows.low_pass == shapes.EXPONENTIAL_AVERAGE)
    if gentle.any():
        # A roll-off too gentle to be detected counts like an amplitude below the detection limit.
        beyond = x[:, LOW] - spectra.gentlest_corner[rows.spectrum]
        fall = gentle * np.exp(4 * np.minimum(beyond, 10.0))
        value -= np.log1p(fall)
        slope[:, LOW] = -4 * fall / (1 + fall)
        curvature[:, LOW] = 16 * fall / (1 + fall)**2
    first, last = spectra.tables.ranges[:, rows.low_pass]
    off = _beyond_range(x, first, last) * rows.present[:, NUISANCES] / _WALL
    value -= 0.5 * (off**2).sum(axis=1)
    slope[:, NUISANCES] -= off / _WALL
    # The range of a nuisance limits its uncertainty.
    curvature[:, NUISANCES] += 4 / (last - first)**2 + (off != 0) / _WALL**2
    return value, slope, curvature


def _beyond_range(x: Array, first: Array, last: Array) -> Array:
    """Return by how much nuisances lie beyond the ends of their ranges, with the sign."""
    return np.asarray(x[:, NUISANCES] - np.clip(x[:, NUISANCES], first, last))


def out_of_range(spectra: Spectra, rows: Rows, x: Array, gradient: Array) -> Bools:
    """Mark rows that have left the range of a nuisance towards a maximum still farther out."""
    off = _beyond_range(x, *spectra.tables.ranges[:, rows.low_pass])
    outwards = (gradient[:, NUISANCES] - off / _WALL**2) * off < 0
    return np.asarray((outwards & rows.present[:, NUISANCES]).any(axis=1))


def without_flicker(present: Bools) -> Array:
    """Return the log prior factors of rows with slower noise, but no flicker of any exponent."""
    alone = ~present[:, [B, LAW]].any(axis=1)
    return np.asarray(np.log(priors.WITHOUT_FLICKER) * alone * present[:, SLOWER].sum(axis=1))


def structure_prior(spectra: Spectra, rows: Rows) -> Array:
    """Return the log prior of the shapes of rows, their edges and the density of nuisances."""
    present, groups = rows.present, len(spectra.frequency)
    total = without_flicker(present)
    total += present[:, :PLAIN] @ np.log([shape.prior for shape in shapes.TERM_SHAPES])
    exponent, _, low_pass, _ = range(len(NUISANCES))
    first, last = spectra.tables.ranges[:, rows.low_pass]
    width = last - first
    gentle = rows.low_pass == shapes.EXPONENTIAL_AVERAGE
    width[gentle, low_pass] = (spectra.gentlest_corner[rows.spectrum] - first[:, low_pass])[gentle]
    width[:, exponent] = 1.0    # The exponent has a normal prior instead of a uniform one.
    law, process = (shape.prior for shape in shapes.FREE_SHAPES)
    odds = np.array([law * priors.EXPONENT_ODDS, process, 1.0, shapes.HIGH_PASSES[0].prior]
                    ) / np.maximum(width, 0.5)
    odds[:, low_pass] *= np.array([shape.prior for shape in shapes.LOW_PASSES])[rows.low_pass]
    total += (present[:, NUISANCES] * np.log(odds)).sum(axis=1)
    below_top = -half_octaves(spectra.frequency)[np.minimum(rows.edge, groups - 1)]
    return np.asarray(
        total + (rows.edge < groups) * (priors.TOP + priors.PER_HALF_OCTAVE * below_top))
