# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The lowest point of a smooth curve, near the best of some values that were tried."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lowest_near(loss: Callable[[float], float], tried: Sequence[float] | Array, best: int,
                tolerance: float) -> tuple[float, float]:
    """
    Refine the best of some values between its neighbours.

    Parameters
    ----------
    loss : callable
        Of a value; what is sought is where it is lowest.
    tried : sequence of float
        Rising.
    best : int
        Place of the best of them.
    tolerance : float
        How near to the lowest point is near enough.

    Returns
    -------
    value, loss : float

    Examples
    --------
    >>> value, _ = lowest_near(lambda x: (x - 1.2)**2, [0.0, 1.0, 2.0], 1, 1e-3)
    >>> round(value, 2)
    1.2

    """
    from scipy.optimize import minimize_scalar  # seldom needed: a tenth of a second of import

    around = (tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)])
    found = minimize_scalar(loss, bounds=around, method='bounded', options={'xatol': tolerance})
    return float(found.x), float(found.fun)
