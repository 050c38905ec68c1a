# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Minus the logarithm of the posterior of many models at once, with gradient and Fisher information.

A model is a row: which axis it is of, which shapes it has, and their parameters (logarithms of
amplitudes in units of what the record can just see, and nuisances). Rows of the same structure
make one batch, whatever axis they are of. The mean is treated by restricted likelihood: with
A = X' W X and b = X' W c of the regressors X,

    ln L = -1/2 sum n (ln lambda + P/lambda) + 1/2 b' A^-1 b - 1/2 ln det A.

References
----------
P. Whittle, Ark. Mat. 2 (1953). H. D. Patterson and R. Thompson, Biometrika 58 (1971).

"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.noise.groups import Groups
from imu_allan.noise.posterior.shapes import (
    cubic,
    FREE_TERMS,
    GENTLE,
    HIGH_PASSES,
    LOW_PASSES,
    Table,
    Tables,
    TERMS,
)
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

PLAIN = len(TERMS)
FREE = len(FREE_TERMS)
# Behind the amplitudes of the terms, and amplitude and nuisance of each free term.
LOW, HIGH = PLAIN + 2 * FREE, PLAIN + 2 * FREE + 1
SLOTS = HIGH + 1
"""Amplitudes of the terms; amplitude and nuisance of each free term; low-pass; high-pass."""
AMPLITUDES = np.array([*range(PLAIN), *(PLAIN + 2 * k for k in range(FREE))])
NUISANCES = np.array([*(PLAIN + 2 * k + 1 for k in range(FREE)), LOW, HIGH])
OUTPUT = np.array([shape.at_output for shape in TERMS])
ALWAYS = [shape.key for shape in TERMS].index('noise_density')
"""Slot of the white noise, whose amplitude has no prior: it is always there."""
GENTLE_FAMILY = [shape.key for shape in LOW_PASSES].index(GENTLE)
_WALL = 0.05
"""How far a nuisance may stand beyond the end of its range, one sigma."""
_SMALL = 1e-300
"""Power that is none, of which there is a logarithm."""
_BATCH = 192
"""Rows of one batch: their arrays then stay in the cache."""
UNSEEN_LEVEL = 0.2
"""Prior density of the logarithm of the level of a half-octave that no model explains."""


@dataclass(frozen=True)
class Spectra:
    """
    Spectra of several axes over the same bands, as the posterior takes them.

    Attributes
    ----------
    frequency : ndarray, shape (groups,)
        In Hz.
    dof, power : ndarray, shape (spectra, groups)
        No degrees of freedom where a line was left out.
    whole : ndarray, shape (spectra, groups)
        Degrees of freedom before any doubt about the model was taken off.
    columns : ndarray, shape (spectra, terms, groups)
        Power of the terms at unit amplitude, which is what the record can just see.
    unit : ndarray, shape (spectra, terms)
        That amplitude, in SI units.
    like : ndarray, shape (spectra, free terms, groups)
        Logarithm of what gaps and ends do to a free term.
    sizes : tuple of ndarray, shape (spectra, points)
        By free term, the logarithm of the amplitude the record can just see, along its grid.
    gentle : ndarray, shape (spectra,)
        Logarithm of the corner of the gentlest roll-off that can be seen.
    along : ndarray, shape (spectra, records, groups, regressors)
    among : ndarray, shape (spectra, records, groups, regressors, regressors)
        As in `Groups`; every record has regressors of its own.
    tables : Tables
    left : ndarray, shape (spectra, groups + 1)
        Loss of what is left to itself from a group on.

    """

    frequency: Array
    dof: Array
    power: Array
    whole: Array
    columns: Array
    unit: Array
    like: Array
    sizes: tuple[Array, ...]
    gentle: Array
    along: Array
    among: Array
    tables: Tables
    left: Array

    def beside(self, groups: Sequence[Groups], of: Sequence[int]) -> 'Spectra':
        """Return spectra with other regressors, each that of one of these with other groups."""
        index = np.array(of)
        along, among = regressors(groups)
        return replace(self, dof=self.dof[index], power=self.power[index],
                       whole=self.whole[index], columns=self.columns[index],
                       unit=self.unit[index], like=self.like[index],
                       sizes=tuple(size[index] for size in self.sizes),
                       gentle=self.gentle[index], along=along, among=among,
                       left=self.left[index])

    def one(self, number: int) -> 'Spectra':
        """Return one of the spectra alone."""
        own = slice(number, number + 1)
        return replace(self, dof=self.dof[own], power=self.power[own], whole=self.whole[own],
                       columns=self.columns[own], unit=self.unit[own], like=self.like[own],
                       sizes=tuple(size[own] for size in self.sizes), gentle=self.gentle[own],
                       along=self.along[own], among=self.among[own], left=self.left[own])

    def worth(self, dof: Array) -> 'Spectra':
        """Return the same spectra with other degrees of freedom."""
        spectra = replace(self, dof=dof)
        return replace(spectra, left=left_to_itself(self.frequency, dof, self.power, self.whole))


def regressors(groups: Sequence[Groups]) -> tuple[Array, Array]:
    """Products with the regressors of every record of every spectrum."""
    along, among = [], []
    for one in groups:
        assert one.along is not None
        assert one.among is not None
        if one.record is None:
            along.append(one.along[None])
            among.append(one.among[None])
        else:
            own = one.record == np.arange(one.records)[:, None]
            along.append(np.where(own[:, :, None], one.along, 0.0))
            among.append(np.where(own[:, :, None, None], one.among, 0.0))
    return np.stack(along), np.stack(among)


def half_octaves(frequency: Array) -> Index:
    """Return the number of the half-octave of each band, downwards from the highest."""
    return np.asarray(np.floor(2 * np.log2(frequency / frequency[-1])), np.int64)


def left_to_itself(frequency: Array, dof: Array, power: Array, whole: Array) -> Array:
    """Loss of groups from an edge on, each half-octave with a free level, shape (n, groups+1)."""
    half = half_octaves(frequency)
    new = np.concatenate(([True], half[1:] != half[:-1]))
    number = np.cumsum(new) - 1
    own = 0.5 * dof * (np.log(np.maximum(power, _SMALL)) + 1) + 0.5 * (dof > 0)
    for row, count in zip(own, whole, strict=True):
        octave = np.bincount(number, count)[number]
        level = np.log(UNSEEN_LEVEL * np.sqrt(4 * np.pi / np.maximum(octave, 1.0)))
        row -= np.where(new & (octave > 0), level, 0.0)
    ends = np.zeros((len(own), 1))
    return np.concatenate((np.cumsum(own[:, ::-1], axis=1)[:, ::-1], ends), axis=1)


@dataclass
class Rows:
    """
    Models, one a row.

    Attributes
    ----------
    of : ndarray of int, shape (rows,)
        Spectrum of each.
    x : ndarray, shape (rows, SLOTS)
    has : ndarray of bool, shape (rows, SLOTS)
    family : ndarray of int, shape (rows,)
        Low-pass of each, where it has one.
    edge : ndarray of int, shape (rows,)
        Groups from here on are left to themselves.
    prior : ndarray, shape (rows,)
        Logarithm of the prior of the structure.
    loss, hessian, evidence : ndarray
        As `imu_allan.noise.posterior.evidence` finds them.

    """

    of: Index
    x: Array
    has: Mask
    family: Index
    edge: Index
    prior: Array
    loss: Array
    hessian: Array
    evidence: Array

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.of)

    def take(self, which: Index) -> 'Rows':
        """Return some of the rows."""
        return Rows(*(array[which] for array in vars(self).values()))

    @staticmethod
    def joined(parts: Sequence['Rows']) -> 'Rows':
        """Put rows one after the other."""
        return Rows(*(np.concatenate(arrays) for arrays in zip(
            *(vars(part).values() for part in parts), strict=True)))


def batches(rows: Rows) -> list[Index]:
    """Rows of the same structure, no more to a batch than stay in the cache."""
    if not len(rows):
        return []
    key = rows.has[:, NUISANCES] @ (1 << np.arange(len(NUISANCES)))
    order = np.argsort(key, kind='stable')
    cuts = np.flatnonzero(np.diff(key[order])) + 1
    return [part for same in np.split(order, cuts)
            for part in np.array_split(same, -(-len(same) // _BATCH))]


def spectrum(spectra: Spectra, rows: Rows, x: Array, slopes: bool = True
             ) -> tuple[Array, Array | None, Index]:
    """
    Return the expected power of rows of one structure, and its derivatives by their slots.

    Returns
    -------
    lam : ndarray, shape (rows, groups)
    jacobian : ndarray, shape (rows, used slots, groups), or None
    used : ndarray of int
        Slots that any of the rows may have.

    """
    has = rows.has[0]
    theta = np.where(rows.has[:, :PLAIN], np.exp(np.minimum(2 * x[:, :PLAIN], 120.0)), 0.0)
    parts = spectra.columns[rows.of] * theta[:, :, None]
    body = parts[:, ~OUTPUT].sum(axis=1)
    free: list[tuple[int, Array, Array]] = []
    for k in range(FREE):
        slot = PLAIN + 2 * k
        if not has[slot]:
            continue
        table = spectra.tables.terms[k]
        at, t, per = table.place(np.zeros(len(x), np.int64), x[:, slot + 1])
        value, slope = cubic(table.rows, at, t, per)
        size, growth = _along_grid(spectra.sizes[k], rows.of, at, t, per)
        value = np.exp(np.minimum(2 * (x[:, slot] + size), 120.0)[:, None]
                       + value + spectra.like[rows.of, k])
        body = body + value
        if slopes:
            free.append((slot, value, slope + 2 * growth[:, None]))
    response: Array | None = None
    bends: list[tuple[int, Array]] = []
    for slot, table, family in ((LOW, spectra.tables.low_pass, rows.family),
                                (HIGH, spectra.tables.high_pass, np.zeros(len(x), np.int64))):
        if has[slot]:
            value, slope = cubic(table.rows, *table.place(family, x[:, slot]))
            own = np.exp(value)
            response = own if response is None else response * own
            bends.append((slot, slope))
    if response is not None:
        body = body * response
    lam = np.maximum(body + parts[:, OUTPUT].sum(axis=1), _SMALL)
    used = np.array([*range(PLAIN), *(slot for k in range(FREE) if has[PLAIN + 2 * k]
                                      for slot in (PLAIN + 2 * k, PLAIN + 2 * k + 1)),
                     *(slot for slot, _ in bends)])
    if not slopes:
        return lam, None, used
    jacobian = np.empty((len(x), len(used), lam.shape[1]))
    jacobian[:, :PLAIN] = 2 * parts
    if response is not None:
        jacobian[:, :PLAIN][:, ~OUTPUT] *= response[:, None]
    place = PLAIN
    for _, value, slope in free:
        behind = value if response is None else value * response
        jacobian[:, place] = 2 * behind
        jacobian[:, place + 1] = behind * slope
        place += 2
    for _, slope in bends:
        jacobian[:, place] = body * slope
        place += 1
    return lam, jacobian, used


def _along_grid(size: Array, of: Index, at: Index, t: Array, per: Array) -> tuple[Array, Array]:
    """Interpolate what a record can just see along the grid of a nuisance, by spectrum."""
    a, b, c, d = size[of, at - 1], size[of, at], size[of, at + 1], size[of, at + 2]
    p, q, r = c - a, 2 * a - 5 * b + 4 * c - d, 3 * (b - c) + d - a
    return (b + 0.5 * t * (p + t * (q + t * r)), 0.5 * (p + t * (2 * q + 3 * t * r)) * per)


def mean(spectra: Spectra, of: Index, weight: Array) -> tuple[Array, Array, Array]:
    """
    Regress on the mean's regressors under weights, shape (rows, groups).

    Returns
    -------
    gain : ndarray, shape (rows,)
        Of the restricted likelihood.
    size : ndarray, shape (rows, records, regressors)
    covariance : ndarray, shape (rows, records, regressors, regressors)

    """
    along, among = spectra.along, spectra.among
    if along.shape[1] == along.shape[3] == 1:
        target = np.einsum('rg,rg->r', weight, along[of, 0, :, 0])[:, None, None]
        gram = np.einsum('rg,rg->r', weight, among[of, 0, :, 0, 0])[:, None, None, None]
    else:
        target = np.einsum('rg,rkgi->rki', weight, along[of])
        gram = np.einsum('rg,rkgij->rkij', weight, among[of])
    if target.shape[-1] == 1:
        single = np.maximum(gram[..., 0], _SMALL)
        gain = 0.5 * (target**2 / single - np.log(single)).sum(axis=(1, 2))
        return gain, target / single, (1 / single)[..., None]
    norm = np.einsum('...ii->...i', gram)
    scale = np.sqrt(np.where(norm > 0, norm, 1.0))
    unit = gram / (scale[..., :, None] * scale[..., None, :]) + 1e-10 * np.eye(gram.shape[-1])
    covariance = np.linalg.inv(unit) / (scale[..., :, None] * scale[..., None, :])
    size = np.einsum('...ij,...j->...i', covariance, target)
    gain = 0.5 * np.einsum('mri,mri->m', target, size) - 0.5 * (
        np.linalg.slogdet(unit)[1] + 2 * np.log(scale).sum(axis=-1)).sum(axis=-1)
    return gain, size, covariance


def residual_power(spectra: Spectra, of: Index, size: Array, covariance: Array) -> Array:
    """Power about the mean as expected of the noise alone, shape (rows, groups)."""
    second = size[..., :, None] * size[..., None, :] + covariance
    power = spectra.power[of]
    if size.shape[1] == size.shape[2] == 1:
        about = power + second[:, 0, 0] * spectra.among[of, 0, :, 0, 0] \
            - 2 * size[:, 0] * spectra.along[of, 0, :, 0]
    else:
        about = power + np.einsum('rkij,rkgij->rg', second, spectra.among[of]) \
            - 2 * np.einsum('rki,rkgi->rg', size, spectra.along[of])
    return np.maximum(about, 1e-12 * power)


def losses(spectra: Spectra, rows: Rows, x: Array) -> tuple[Array, Array, Array]:
    """Minus the logarithm of the posterior of rows of one structure, gradient and information."""
    lam, jacobian, used = spectrum(spectra, rows, x)
    assert jacobian is not None
    weight, logarithms = _weighed(spectra, rows, lam)
    gain, size, covariance = mean(spectra, rows.of, weight)
    value, slope, bend = log_prior(spectra, rows, x)
    loss = 0.5 * (logarithms + np.einsum('rg,rg->r', weight, spectra.power[rows.of])) \
        + spectra.left[rows.of, rows.edge] - gain - value
    half = 0.5 * weight / lam
    about = residual_power(spectra, rows.of, size, covariance)
    gradient, information = -slope, np.zeros((len(x), SLOTS, SLOTS))
    gradient[:, used] += np.matmul(jacobian, (half * (lam - about))[:, :, None])[..., 0]
    information[:, used[:, None], used] = np.matmul(jacobian * half[:, None],
                                                    jacobian.transpose(0, 2, 1))
    diagonal = np.einsum('rii->ri', information)
    diagonal += bend
    gradient[~rows.has] = 0.0
    information *= rows.has[:, :, None] & rows.has[:, None, :]
    diagonal += ~rows.has
    return loss, gradient, information


def loss_alone(spectra: Spectra, rows: Rows, x: Array) -> Array:
    """Minus the logarithm of the posterior of rows of one structure."""
    lam, _, _ = spectrum(spectra, rows, x, slopes=False)
    weight, logarithms = _weighed(spectra, rows, lam)
    gain, _, _ = mean(spectra, rows.of, weight)
    return np.asarray(
        0.5 * (logarithms + np.einsum('rg,rg->r', weight, spectra.power[rows.of]))
        + spectra.left[rows.of, rows.edge] - gain - log_prior(spectra, rows, x, slopes=False)[0])


def _weighed(spectra: Spectra, rows: Rows, lam: Array) -> tuple[Array, Array]:
    """Weights of the groups below the edge of each row, and the weighed sum of logarithms."""
    dof = spectra.dof[rows.of]
    if rows.edge.min() < lam.shape[1]:
        dof = dof * (np.arange(lam.shape[1]) < rows.edge[:, None])
    return dof / lam, np.einsum('rg,rg->r', dof, np.log(lam))


def log_prior(spectra: Spectra, rows: Rows, x: Array, slopes: bool = True
              ) -> tuple[Array, Array, Array]:
    """Prior of the parameters of rows of one structure: value, gradient and curvature by slot."""
    slope, bend = np.zeros(x.shape), np.zeros(x.shape)
    # Uniform in the logarithm of an amplitude above what is seen.
    there = np.where(rows.has[:, AMPLITUDES] & (AMPLITUDES != ALWAYS), 1.0, 0.0)
    fall = np.exp(np.minimum(-2 * x[:, AMPLITUDES], 60.0))
    value = -np.einsum('ra,ra->r', there, np.log1p(fall))
    if slopes:
        share = there * fall / (1 + fall)
        slope[:, AMPLITUDES] = 2 * share
        bend[:, AMPLITUDES] = 4 * share / (1 + fall)
    has = rows.has[0]
    if has[PLAIN + 1]:
        # An exponent about that of flicker.
        off = (x[:, PLAIN + 1] - 1) / EXPONENT_SPREAD
        value -= 0.5 * off**2 + np.log(EXPONENT_SPREAD * np.sqrt(2 * np.pi))
        slope[:, PLAIN + 1] = -off / EXPONENT_SPREAD
        bend[:, PLAIN + 1] = 1 / EXPONENT_SPREAD**2
    if has[LOW]:
        # A roll-off gentler than what is seen, as an amplitude below.
        gentle = rows.family == GENTLE_FAMILY
        fall = np.exp(4 * np.minimum(x[:, LOW] - spectra.gentle[rows.of], 10.0))
        share = gentle * fall / (1 + fall)
        value -= gentle * np.log1p(fall)
        slope[:, LOW] = -4 * share
        bend[:, LOW] = 16 * share / (1 + fall)
    for slot, first, last in ranges(spectra.tables, rows):
        if has[slot]:
            off = (x[:, slot] - np.clip(x[:, slot], first, last)) / _WALL
            value -= 0.5 * off**2
            slope[:, slot] -= off / _WALL
            # No nuisance is less known than its range tells.
            bend[:, slot] += 4 / (last - first)**2 + (off != 0) / _WALL**2
    return value, slope, bend


EXPONENT_SPREAD = 0.35
"""Standard deviation of the exponent of slow noise about 1 in real sensors."""


def ranges(tables: Tables, rows: Rows) -> list[tuple[int, Array, Array]]:
    """Slot, first and last value of every nuisance, by row."""
    none = np.zeros(len(rows), np.int64)
    found: list[tuple[int, Table, Index]] = [
        (PLAIN + 2 * k + 1, table, none) for k, table in enumerate(tables.terms)]
    found += [(LOW, tables.low_pass, rows.family), (HIGH, tables.high_pass, none)]
    return [(slot, table.first[family], table.last[family]) for slot, table, family in found]


def structure_prior(tables: Tables, gentle: float, has: Mask, family: int) -> float:
    """Logarithm of the prior of having some shapes, the density of their nuisances included."""
    total = sum(np.log(shape.density) for slot, shape in enumerate(TERMS)
                if has[slot] and slot != ALWAYS)
    for k, shape in enumerate(FREE_TERMS):
        if has[PLAIN + 2 * k]:
            total += np.log(shape.density)
            if shape.key == 'gauss_markov':
                table = tables.terms[k]
                total -= np.log(table.last[0] - table.first[0])
                total += 0.0 if has[2] or has[PLAIN] else np.log(WITHOUT_FLICKER)
            else:
                total += np.log(EXPONENT_ODDS)
    for slot, table, one, shapes in ((LOW, tables.low_pass, family, LOW_PASSES),
                                     (HIGH, tables.high_pass, 0, HIGH_PASSES)):
        if has[slot]:
            last = gentle if slot == LOW and one == GENTLE_FAMILY else table.last[one]
            total += np.log(shapes[one].density / max(last - table.first[one], 0.5))
    return float(total)


EXPONENT_ODDS = 0.1
"""Of slow noise with another exponent, against flicker."""
WITHOUT_FLICKER = 0.3
"""Of a process where no flicker is: every sensor has some."""
