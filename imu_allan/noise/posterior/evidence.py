# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Maxima of many models in one batch, and their evidence.

References
----------
D. J. C. MacKay, Information Theory, Inference, and Learning Algorithms, ch. 28: Occam factors. R.
E. Kass and A. E. Raftery, JASA 90 (1995): Laplace's method.

"""

from dataclasses import replace

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.likelihood import AMPLITUDES, LOW, NUISANCES, Rows, SLOTS, Spectra
import numpy as np

_LONGEST = np.full(SLOTS, 0.5)
_LONGEST[AMPLITUDES] = 1.5
_LONGEST[NUISANCES[0]] = 0.25
"""Longest step per iteration, by parameter."""


def maximise_rows(spectra: Spectra, rows: Rows, hopeless: float = np.inf,
                  tolerance: float = 0.02, on_grid: bool = False) -> Rows:
    """
    Maximise the posterior of each row by damped Fisher scoring, and compute Laplace's evidence.

    Iteration stops early for rows that should stay `hopeless` nats below the best of their axis,
    and for rows whose nuisance leaves its range. A row that converges to the maximum of a better
    row of the same structure is dropped. With `on_grid`, the rows of a structure are a grid of a
    nuisance: the first step leaves it as it is, and then only rows near a maximum go on.
    """
    count = len(rows)
    # Drop the old Hessians, so that they are not copied with each selection of rows.
    rows = replace(rows, hessian=np.empty((count, 0)))
    kind = _kinds(rows)
    x = rows.x.copy()
    loss, gradient, information = likelihood.losses(spectra, rows, x)
    damping, live = np.full(count, 1e-3), np.arange(count)
    other = np.ones(count, dtype=bool)
    # The corner of a high-pass needs that many; what creeps on approaches the end of a range.
    for step in range(16):
        damped = information[live]
        diagonal = np.einsum('rii->ri', damped)
        diagonal *= 1 + damping[live, None]
        diagonal += 1e-9
        held = on_grid and step == 0
        if held:
            diagonal[:, NUISANCES] *= 1e9
        move = -np.linalg.solve(damped, gradient[live][:, :, None])[..., 0]
        promised = -0.5 * np.einsum('ri,ri->r', move, gradient[live])
        move /= np.maximum(1, np.max(np.abs(move) / _LONGEST, axis=1))[:, None]
        there = x[live] + move
        some = rows.take(live)
        new, slope, bend = likelihood.losses(spectra, some, there)
        good = new <= loss[live] + 1e-9
        gained = np.where(good, loss[live] - new, np.inf)
        better = live[good]
        x[better], loss[better] = there[good], new[good]
        gradient[better], information[better] = slope[good], bend[good]
        damping[live] = np.where(good, damping[live] / 6, np.maximum(damping[live], 1e-2) * 8)
        other &= ~_merged(kind, rows.has, x, loss, information)
        if held:
            own = rows.has[:, NUISANCES]
            other &= _leading(kind, x[:, NUISANCES] * own, loss, gradient[:, NUISANCES] * own)
        going = other[live]
        if not held:
            going &= (gained > tolerance) & (damping[live] < 1e6) & ~likelihood.out_of_range(
                spectra, some, x[live], gradient[live])
        if step >= 1 and np.isfinite(hopeless):
            score = rows.prior - loss
            best = np.full(int(rows.of.max()) + 1, -np.inf)
            np.maximum.at(best, rows.of, score)
            going &= score[live] + 3 * promised > best[rows.of[live]] - hopeless
        live = live[going]
        if not len(live):
            break
    evidence = (rows.prior - loss + 0.5 * rows.has.sum(axis=1) * np.log(2 * np.pi)
                - 0.5 * np.linalg.slogdet(information)[1])
    return replace(rows, x=x, loss=loss, hessian=information, evidence=evidence).take(other)


def _leading(kind: Ints, values: Array, loss: Array, gradient: Array) -> Bools:
    """
    Mark rows whose neighbour uphill in the nuisance is no better row of the same kind.

    `values`, `gradient`, shape (rows, nuisances): zero for a nuisance that a row does not have.
    """
    ends = np.full((2, int(kind.max()) + 1, values.shape[1]), np.inf)
    np.minimum.at(ends[0], kind, values)
    np.minimum.at(ends[1], kind, -values)
    spread = -ends.sum(axis=0)
    every, varied = np.arange(len(kind)), np.argmax(spread, axis=1)[kind]
    order = np.lexsort((values[every, varied], kind))
    rises, loss = gradient[every, varied][order] < 0, loss[order]
    same = kind[order][1:] == kind[order][:-1]
    kept = np.ones(len(kind), dtype=bool)
    kept[:-1] &= ~(rises[:-1] & same & (loss[1:] < loss[:-1]))
    kept[1:] &= rises[1:] | ~(same & (loss[:-1] < loss[1:]))
    found = spread.max(axis=1)[kind] == 0
    found[order] |= kept
    return np.asarray(found)


def _kinds(rows: Rows) -> Ints:
    """Give the same number to rows that differ only in their parameters."""
    _, found = np.unique(np.column_stack((
        rows.of, rows.edge, np.where(rows.has[:, LOW], rows.family, -1),
        rows.has @ (1 << np.arange(SLOTS)))), axis=0, return_inverse=True)
    return found.ravel()


def _merged(kind: Ints, has: Bools, x: Array, loss: Array, information: Array) -> Bools:
    """Mark rows within the standard errors of the best row of the same structure."""
    order = np.lexsort((loss, kind))
    leaders = order[np.searchsorted(kind[order], np.arange(kind.max() + 1))]
    best = leaders[kind]
    near = np.abs(x - x[best]) < _reach(information[leaders])[kind]
    return np.asarray((near | ~has).all(axis=1) & (best != np.arange(len(kind))))


def _reach(information: Array) -> Array:
    """Return the distances below which rows are the same, shape (rows, SLOTS)."""
    known = np.maximum(np.einsum('rii->ri', information), 1e-12)
    # Rows closer than 0.7 standard errors are the same; a standard error is at least 0.15.
    return np.asarray(0.7 * np.maximum(1 / np.sqrt(known), 0.15))


def inside(spectra: Spectra, rows: Rows) -> Bools:
    """Mark rows with all nuisances inside their ranges; at an end, a row is another model."""
    first, last = spectra.tables.ranges(rows.family)
    x = rows.x[:, NUISANCES]
    found = (x > first + 0.02) & (x < last - 0.02)
    return np.asarray((found | ~rows.has[:, NUISANCES]).all(axis=1))


def distinct(rows: Rows) -> Rows:
    """Keep the best of the rows that converged to the same point; sort by evidence."""
    kind, reach = _kinds(rows).tolist(), _reach(rows.hessian)
    kept: list[int] = []
    for i in np.argsort(-rows.evidence).tolist():
        if not any(kind[i] == kind[k] and ((np.abs(rows.x[i] - rows.x[k]) < reach[k])
                                           | ~rows.has[i]).all() for k in kept):
            kept.append(i)
    return rows.take(kept)
