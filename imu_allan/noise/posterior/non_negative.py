# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Non-negative least squares for the few columns of a noise model.

References
----------
C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, ch. 23.

"""

from collections.abc import Sequence

from imu_allan.arrays import Array
import numpy as np


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive` guesses the nonzero entries."""
    root = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    # Unit columns, with a ridge between those that cannot be distinguished.
    gram, target = gram / (root[:, None] * root), target / root
    alone = np.eye(len(root))
    gram += 1e-13 * alone
    active, x = np.ones(len(root), dtype=bool), target
    if positive:
        active[:] = False
        active[positive] = True
    # Limit the iterations, because near-collinear columns can make `gram` indefinite by rounding.
    for _ in range(4 * len(root) + 4):
        both = active[:, None] & active
        x = np.asarray(np.linalg.solve(np.where(both, gram, alone), target * active), np.float64)
        rest = np.where(active, 0.0, target - gram @ x)
        if x.min(initial=0.0) < 0:
            active[x.argmin()] = False
        elif rest.max(initial=0.0) > 1e-10:
            active[rest.argmax()] = True
        else:
            break
    return np.asarray(np.maximum(x, 0.0) / root)
