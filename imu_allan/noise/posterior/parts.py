# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk goes on all through a record, or is what a mean has done once.

A mean may settle, bend or jump in more ways than any list of trends has. Whatever it does, it
does at some time; a random walk goes on. Parts of the record, each with a mean and a ramp of its
own, must agree on its strength; where they show it together, they do without any one of them.
"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise.posterior.evidence import climb
from imu_allan.noise.posterior.judgments import UNEVEN
from imu_allan.noise.posterior.likelihood import PLAIN
from imu_allan.noise.posterior.posterior import Posterior
from imu_allan.noise.posterior.prepared import prepared
from imu_allan.noise.posterior.search import B, K
from imu_allan.noise.record.groups import Groups, joined_groups
import numpy as np


def goes_on(posterior: Posterior, parts: Sequence[Sequence[Groups]], dt: float) -> bool:
    """
    Distinguish a random walk from what a mean has done once.

    Parameters
    ----------
    posterior : Posterior
        Of the whole, with a model that has a random walk.
    parts : sequence of sequence of Groups
        Spectra of equal parts of one record, or of parts of several; each has a mean of its own.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    bool
        Whether parts agree on the random walk, and none is all that shows it.

    """
    every = [groups for part in parts for groups in part]
    if not all(groups.power.any() for groups in every):
        # The axis stands still in one.
        return False
    together, count = joined_groups(every), len(parts)
    assert together.record is not None
    own = np.arange(count)[:, None] == np.repeat(
        np.arange(count), [len(part) for part in parts])[together.record]
    model = next(model for model in posterior.models if model.row.has[0, K])
    spectra, _ = prepared([together], dt)
    record, of = model.spectra, int(model.row.of[0])
    known = np.interp(np.log(spectra.frequency), np.log(record.frequency),
                      record.dof[of] / np.maximum(record.whole[of], 1e-9))
    # A part is worth as little as the whole where no model describes the record.
    dof = np.minimum(spectra.dof, spectra.whole * known)
    # Without each part, each part by itself, and all; then without a random walk.
    seen = np.concatenate((~own, own, np.ones_like(own[:1])))
    spectra = spectra.taken(np.zeros(len(seen), np.int64)).worth(dof * seen)
    which = np.concatenate((np.arange(len(seen)), np.arange(count), [2 * count]))
    flicker = np.arange(len(which)) >= len(seen)
    rows = model.row.take(np.zeros(len(which), np.int64))
    x, has = rows.x.copy(), rows.has.copy()
    x[:, :PLAIN] += np.log(record.unit[of] / spectra.unit[0])
    x[:, K] = np.maximum(x[:, K], 0.0)
    x[flicker, B] = np.maximum(x[flicker, B], 1.0)
    has[flicker, K] = False
    has[flicker, B] |= not model.row.has[0, PLAIN]
    edge = np.searchsorted(spectra.frequency, np.append(record.frequency, np.inf)[rows.edge])
    loss = climb(spectra, replace(
        rows, of=which, x=x, has=has, edge=edge, prior=np.zeros(len(which))), 12).loss
    without, alone, [whole], still, [whole_still] = np.split(
        loss, [count, 2 * count, 2 * count + 1, 3 * count + 1])
    # Only where they show it together can one of them be all that shows it.
    anywhere = whole_still <= whole or (without <= still).all()
    return bool(anywhere and whole - alone.sum() < UNEVEN)
