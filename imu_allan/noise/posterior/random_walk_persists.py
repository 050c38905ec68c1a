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

from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.likelihood import B, K, LAW, N, PLAIN, spectrum
from imu_allan.noise.posterior.posterior import Posterior
from imu_allan.noise.posterior.prepared_spectra import prepared
from imu_allan.noise.posterior.thresholds_and_priors import UNEVEN
from imu_allan.noise.record.groups import Groups, joined_groups
import numpy as np


def random_walk_persists(posterior: Posterior, parts: Sequence[Sequence[Groups]], dt: float
                         ) -> bool:
    """
    Return whether the parts agree on the random walk, and it does not rest on one of them alone.

    `posterior`: of the whole record, with a model that contains a random walk. `parts`: spectra of
    equal parts of one record, or of parts of several; each has its own mean. `dt`: sample interval
    in seconds.
    """
    if not all(groups.power.any() for part in parts for groups in part):
        # The axis is constant in one part.
        return False
    joined, count = [joined_groups(part) for part in parts], len(parts)
    together = joined_groups(joined, apart=True)
    order = np.argsort(np.concatenate([one.frequency for one in joined]), kind='stable')
    own = np.arange(count)[:, None] == np.repeat(
        np.arange(count), [len(one.frequency) for one in joined])[order]
    model = next(model for model in posterior.models if model.row.has[0, K])
    spectra, _ = prepared([together], dt)
    record, of = model.spectra, int(model.row.of[0])
    known = np.interp(np.log(spectra.frequency), np.log(record.frequency),
                      record.dof[of] / np.maximum(record.whole[of], 1e-9))
    # Reduce the degrees of freedom of parts where no model describes the whole record.
    dof = np.minimum(spectra.dof, spectra.whole * known)
    # Fit each part alone, all but one, and all; the latter two also without random walk.
    seen = np.concatenate((own, ~own, np.ones_like(own[:1])))
    spectra = spectra.select(np.zeros(len(seen), np.int64)).with_dof(dof * seen)
    which = np.concatenate((np.arange(len(seen)), np.arange(count, len(seen))))
    flicker = np.arange(len(which)) >= len(seen)
    rows = model.row.take(np.zeros(len(which), np.int64))
    x, has = rows.x.copy(), rows.has.copy()
    x[:, :PLAIN] += np.log(record.unit[of] / spectra.unit[0])
    x[:, K] = np.maximum(x[:, K], 0.0)
    x[flicker, B] = np.maximum(x[flicker, B], 1.0)
    has[flicker, K] = False
    has[flicker, B] |= not model.row.has[0, LAW]
    edge = np.searchsorted(spectra.frequency, np.append(record.frequency, np.inf)[rows.edge])
    rows = replace(rows, of=which, x=x, has=has, edge=edge, prior=np.zeros(len(which)))
    # Parts may differ in their white noise, which says nothing of the random walk.
    lam, slopes, used = spectrum(spectra, rows.take([2 * count]), x[[2 * count]])
    white = spectra.dof[-1] * (slopes[np.searchsorted(used, N), 0] / 2 / lam[0])**2
    level = (own @ (white * spectra.power[-1] / lam[0])) / np.maximum(own @ white, 1e-9)
    columns = spectra.columns.copy()
    columns[:, N] *= np.where(level > 0, level, 1.0) @ own
    loss = maximise_rows(replace(spectra, columns=columns), rows).loss
    alone, without, [whole], still, [whole_still] = np.split(
        loss, [count, 2 * count, 2 * count + 1, 3 * count + 1])
    # Leaving parts out is a test only if all parts together show the random walk. They need not,
    # unless the mean is known to move: then it may have moved once more.
    shown = (without <= still).all() if whole < whole_still else not model.trends
    return bool(shown and whole - alone.sum() < UNEVEN)
