# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk shows in any part of a record, or is what a mean has done once.

A mean may settle, bend or jump in more ways than any list of courses has. Whatever it does, it
does at some time; a walk goes on. In parts of the record, each with a mean and a ramp of its own,
it shows as well: without any one of them as without the others.
"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise.groups import Groups, joined_groups
from imu_allan.noise.posterior.evidence import climb
from imu_allan.noise.posterior.likelihood import PLAIN
from imu_allan.noise.posterior.posterior import Posterior
from imu_allan.noise.posterior.prepared import prepared
from imu_allan.noise.posterior.search import B, K
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def walk_in_parts(posterior: Posterior, parts: Sequence[Groups], dt: float) -> Array:
    """
    Weigh the walk against flicker alone in all parts but each.

    Parameters
    ----------
    posterior : Posterior
        Of the whole record.
    parts : sequence of Groups
        Spectra of equal parts of it, over the same bands.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    ndarray, shape (parts,)
        Logarithm of the ratio of the likelihoods, of all parts without each.

    """
    model = next(model for model in posterior.models if model.row.has[0, K])
    index = np.arange(min(len(part.frequency) for part in parts))
    parts = [part.taken(index) for part in parts]
    sets = [joined_groups([part for number, part in enumerate(parts) if number != one])
            for one in range(len(parts))]
    spectra, _ = prepared(sets, dt)
    count = len(sets)
    rows = model.row.take(np.zeros(2 * count, np.int64))
    of = np.repeat(np.arange(count), 2)
    x, has = rows.x.copy(), rows.has.copy()
    x[:, :PLAIN] += np.log(model.spectra.unit[model.row.of[0]] / spectra.unit[of])
    x[:, K] = np.maximum(x[:, K], 0.0)
    has[1::2, K] = False
    has[1::2, B] |= ~has[1::2, PLAIN]
    x[1::2, B] = np.maximum(x[1::2, B], 1.0)
    edge = np.full(2 * count, len(sets[0].dof))
    loss = climb(spectra, replace(rows, of=of, x=x, has=has, edge=edge,
                                  prior=np.zeros(2 * count)), 12).loss
    return np.asarray(loss[1::2] - loss[::2])
