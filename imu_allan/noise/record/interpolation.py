# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Effect of interpolated samples on the spectrum of white noise."""

from imu_allan.arrays import Array
from imu_allan.block import NEIGHBOURS
import numpy as np


def taken_by_mean(nu: Array) -> Array:
    """Share of an amplitude that is lost when the mean of its neighbours replaces a sample."""
    return np.asarray(1 - np.cos(2 * np.pi * nu[..., None] * np.arange(1, NEIGHBOURS + 1)
                                 ).mean(axis=-1))


def white_through_interpolation(nu: Array, share: float) -> Array:
    """
    Return the power of white noise with interpolated samples, relative to a full record.

    `nu`, shape (n,): in cycles per sample. `share`: of interpolated samples. The received ones are
    white; lost ones repeat the noise of neighbours that are farther apart where many are lost.
    As they lie at random places, a white error is added.
    """
    kept, turn = 1 - share, np.exp(2j * np.pi * nu)
    # Distances to the next received sample are geometric; those to the following ones are sums.
    shared = np.mean([np.real((kept * turn / (1 - share * turn))**number)
                      for number in range(1, NEIGHBOURS + 1)], axis=0)
    error = share * kept / (2 * NEIGHBOURS)
    return np.asarray((kept + share * shared)**2 / kept + error)
