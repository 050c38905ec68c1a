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
from imu_allan.noise.posterior.likelihood import ALPHA, AMPLITUDES, LOW, NUISANCES, Rows, Spectra
import numpy as np

_LONGEST = np.full(likelihood.SLOTS, 0.5)
_LONGEST[AMPLITUDES] = 1.5
_LONGEST[ALPHA] = 0.25
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
    structure, x = _structures(rows), rows.x.copy()
    loss, gradient, information = likelihood.losses(spectra, rows, x)
    # The rows that go on, and those that are returned
    damping, live, kept = np.full(count, 1e-3), np.arange(count), np.ones(count, dtype=bool)
    # The corner of a high-pass needs that many; what creeps on approaches the end of a range.
    for step in range(16):
        held = on_grid and step == 0
        move, predicted = _damped_step(
            information[live], gradient[live], damping[live], held=held)
        tried, some = x[live] + move, rows.take(live)
        new_loss, new_gradient, new_information = likelihood.losses(spectra, some, tried)
        good = new_loss <= loss[live] + 1e-9
        gain = np.where(good, loss[live] - new_loss, np.inf)
        better = live[good]
        x[better], loss[better] = tried[good], new_loss[good]
        gradient[better], information[better] = new_gradient[good], new_information[good]
        damping[live] = np.where(good, damping[live] / 6, np.maximum(damping[live], 1e-2) * 8)
        kept &= ~_merged(structure, rows.present, x, loss, information)
        if held:
            present = rows.present[:, NUISANCES]
            kept &= _near_maximum(structure, x[:, NUISANCES] * present, loss,
                                  gradient[:, NUISANCES] * present)
        going = kept[live]
        if not held:
            going &= (gain > tolerance) & (damping[live] < 1e6) & ~likelihood.out_of_range(
                spectra, some, x[live], gradient[live])
        # Drift that is far stronger than where it starts takes some steps to show what it gains.
        if step >= 5 and np.isfinite(hopeless):
            score = rows.prior - loss
            best = np.full(int(rows.spectrum.max()) + 1, -np.inf)
            np.maximum.at(best, rows.spectrum, score)
            going &= score[live] + 3 * predicted > best[rows.spectrum[live]] - hopeless
        live = live[going]
        if not len(live):
            break
    evidence = (rows.prior - loss + 0.5 * rows.present.sum(axis=1) * np.log(2 * np.pi)
                - 0.5 * np.linalg.slogdet(information)[1])
    return replace(rows, x=x, loss=loss, hessian=information, evidence=evidence).take(kept)


def _damped_step(information: Array, gradient: Array, damping: Array, *, held: bool
                 ) -> tuple[Array, Array]:
    """
    Return the step of damped Fisher scoring, and by how much it should lower the loss.

    `information` is overwritten. With `held`, nuisances stay.
    """
    diagonal = np.einsum('rii->ri', information)
    diagonal *= 1 + damping[:, None]
    diagonal += 1e-9
    if held:
        diagonal[:, NUISANCES] *= 1e9
    move = -np.linalg.solve(information, gradient[:, :, None])[..., 0]
    predicted_gain = -0.5 * np.einsum('ri,ri->r', move, gradient)
    return move / np.maximum(1, np.max(np.abs(move) / _LONGEST, axis=1))[:, None], predicted_gain


def _near_maximum(structure: Ints, nuisances: Array, loss: Array, gradient: Array) -> Bools:
    """
    Mark rows whose neighbour uphill in the nuisance is no better row of the same structure.

    `nuisances`, `gradient`, shape (rows, nuisances): zero for those that a row does not have.
    """
    lowest = np.full((int(structure.max()) + 1, nuisances.shape[1]), np.inf)
    highest = -lowest
    np.minimum.at(lowest, structure, nuisances)
    np.maximum.at(highest, structure, nuisances)
    spread = highest - lowest
    # The nuisance of which the rows of a structure are a grid
    own = np.arange(len(structure)), np.argmax(spread, axis=1)[structure]
    order = np.lexsort((nuisances[own], structure))
    rises, loss = gradient[own][order] < 0, loss[order]
    same = structure[order][1:] == structure[order][:-1]
    near = np.ones(len(structure), dtype=bool)
    near[:-1] &= ~(rises[:-1] & same & (loss[1:] < loss[:-1]))
    near[1:] &= rises[1:] | ~(same & (loss[:-1] < loss[1:]))
    found = spread.max(axis=1)[structure] == 0
    found[order] |= near
    return np.asarray(found)


def _structures(rows: Rows) -> Ints:
    """Give the same number to rows that differ only in their parameters."""
    _, found = np.unique(np.column_stack((
        rows.spectrum, rows.edge, np.where(rows.present[:, LOW], rows.low_pass, -1),
        rows.present @ (1 << np.arange(likelihood.SLOTS)))), axis=0, return_inverse=True)
    return found.ravel()


def _merged(structure: Ints, present: Bools, x: Array, loss: Array, information: Array) -> Bools:
    """Mark rows within the standard errors of the best row of the same structure."""
    order = np.lexsort((loss, structure))
    leaders = order[np.searchsorted(structure[order], np.arange(structure.max() + 1))]
    best = leaders[structure]
    near = np.abs(x - x[best]) < _reach(information[leaders])[structure]
    return np.asarray((near | ~present).all(axis=1) & (best != np.arange(len(structure))))


def _reach(information: Array) -> Array:
    """Return the distances below which rows are the same, shape (rows, SLOTS)."""
    diagonal = np.maximum(np.einsum('rii->ri', information), 1e-12)
    # Rows closer than 0.7 standard errors are the same; a standard error is at least 0.15.
    return np.asarray(0.7 * np.maximum(1 / np.sqrt(diagonal), 0.15))


def inside(spectra: Spectra, rows: Rows) -> Bools:
    """Mark rows with all nuisances inside their ranges; at an end, a row is another model."""
    first, last = spectra.tables.ranges[:, rows.low_pass]
    x = rows.x[:, NUISANCES]
    within = (x > first + 0.02) & (x < last - 0.02)
    return np.asarray((within | ~rows.present[:, NUISANCES]).all(axis=1))


def distinct(rows: Rows) -> Rows:
    """Keep the best of the rows that converged to the same point; sort by evidence."""
    structure, reach = _structures(rows), _reach(rows.hessian)
    kept: list[int] = []
    for i in np.argsort(-rows.evidence).tolist():
        near = (np.abs(rows.x[i] - rows.x[kept]) < reach[kept]) | ~rows.present[i]
        if not (near.all(axis=1) & (structure[kept] == structure[i])).any():
            kept.append(i)
    return rows.take(kept)
