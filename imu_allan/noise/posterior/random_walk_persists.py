# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decide whether a random walk persists through a record, or is a single movement of the mean.

A mean may settle, bend or jump in more ways than any list of trends covers. It does so at some
time, while a random walk continues. So parts of the record, each with its own mean and ramp, must
agree on its strength. If they show it together, it must remain without any one of them.
"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.likelihood import B, K, LAW, model_spectrum, N, PLAIN, Rows, Spectra
from imu_allan.noise.posterior.posterior import Drawn, Posterior
from imu_allan.noise.posterior.prepared_spectra import prepared
from imu_allan.noise.posterior.thresholds_and_priors import UNEVEN
from imu_allan.noise.record.groups import Groups, joined_groups
import numpy as np


def random_walk_persists(posterior: Posterior, quarters: Sequence[Sequence[Groups]], dt: float
                         ) -> bool:
    """
    Return whether a random walk persists without any one quarter, and without any records.

    `posterior`: of all records, with a model that contains a random walk. `quarters`: spectra of
    the quarters of each record; none of a record that is too short. `dt`: sample interval in
    seconds.
    """
    known = [own for own in quarters if own]
    # Leave out one record of up to eight, of more an eighth of them.
    eighths = np.array_split(np.arange(len(known)), min(max(len(known), 1), 8))
    splits = [[[one for number in part.tolist() for one in known[number]] for part in eighths]
              ] if len(known) > 2 else []
    if known and len(known) == len(quarters):
        splits.append([list(same) for same in zip(*known, strict=True)])
    return all(_agree(posterior, split, dt) for split in splits)


def _agree(posterior: Posterior, parts: Sequence[Sequence[Groups]], dt: float) -> bool:
    """
    Return whether parts agree on the random walk, and it does not rest on one of them alone.

    `parts`: spectra of equal parts of one record, or of parts of several; each has its own mean.
    """
    if not all(groups.power.any() for part in parts for groups in part):
        # The axis is constant in one part.
        return False
    model = next(model for model in posterior.models if model.has(K))
    spectra, part_groups = _side_by_side(parts, model, dt)
    count = len(parts)
    # Fit each part alone, all but one, and all; the latter two also without random walk.
    subsets = np.concatenate((part_groups, ~part_groups, np.ones_like(part_groups[:1])))
    spectra = spectra.select(np.zeros(len(subsets), np.int64)).with_dof(spectra.dof * subsets)
    subset = np.arange(len(subsets))
    rows = _started(model, spectra, np.concatenate((subset, subset[count:])),
                    with_walk=len(subsets))
    design = _levelled(spectra, rows.take([len(subsets) - 1]), part_groups)
    loss = maximise_rows(replace(spectra, design=design), rows).loss
    alone, without_one, [together], without_walk, [together_without_walk] = np.split(
        loss, np.cumsum([count, count, 1, count]))
    # Leaving parts out is a test only if all parts together show the random walk. They need not,
    # unless the mean is known to move: then it may have moved once more.
    shown = ((without_one <= without_walk).all() if together < together_without_walk
             else not model.trends)
    return bool(shown and together - alone.sum() < UNEVEN)


def _side_by_side(parts: Sequence[Sequence[Groups]], model: Drawn, dt: float
                  ) -> tuple[Spectra, Bools]:
    """Return the parts as one spectrum, and which of its groups each has, (parts, groups)."""
    joined = [joined_groups(part) for part in parts]
    number = np.repeat(np.arange(len(parts)), [len(one.frequency) for one in joined])
    order = np.argsort(np.concatenate([one.frequency for one in joined]), kind='stable')
    spectra, _ = prepared([joined_groups(joined, apart=True)], dt)
    # Reduce the degrees of freedom of parts where no model describes the whole record.
    record, of = model.spectra, model.spectrum
    described = np.interp(np.log(spectra.frequency), np.log(record.frequency),
                          record.dof[of] / np.maximum(record.nominal_dof[of], 1e-9))
    dof = np.minimum(spectra.dof, spectra.nominal_dof * described)
    return replace(spectra, dof=dof), np.arange(len(parts))[:, None] == number[order]


def _started(model: Drawn, spectra: Spectra, subsets: Ints, with_walk: int) -> Rows:
    """Return a row for each subset that starts from a model, only the first with random walk."""
    rows = model.row.take(np.zeros(len(subsets), np.int64))
    x, present = rows.x.copy(), rows.present.copy()
    x[:, :PLAIN] += np.log(model.limit / spectra.limit[0])
    x[:, K] = np.maximum(x[:, K], 0.0)
    # Flicker takes the place of the random walk.
    x[with_walk:, B] = np.maximum(x[with_walk:, B], 1.0)
    present[with_walk:, K] = False
    present[with_walk:, B] |= not model.has(LAW)
    edge_hz = np.append(model.spectra.frequency, np.inf)[rows.edge]
    return replace(rows, spectrum=subsets, x=x, present=present, prior=np.zeros(len(subsets)),
                   edge=np.searchsorted(spectra.frequency, edge_hz))


def _levelled(spectra: Spectra, row: Rows, part_groups: Bools) -> Array:
    """Return the design with white noise as strong in each part as beside a row of all parts."""
    # Parts may differ in their white noise, which says nothing of the random walk.
    power, slopes, used = model_spectrum(spectra, row, row.x)
    weight = spectra.dof[-1] * (slopes[np.searchsorted(used, N), 0] / 2 / power[0])**2
    observed = part_groups @ (weight * spectra.power[-1] / power[0])
    level = observed / np.maximum(part_groups @ weight, 1e-9)
    design = spectra.design.copy()
    design[:, N] *= np.where(level > 0, level, 1.0) @ part_groups
    return design
