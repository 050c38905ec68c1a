# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Least squares without negative coefficients, for the few columns that a noise model has.

References
----------
C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, ch. 23.

"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive`: a guess which x are above."""
    # Plain numbers: for four columns they are several times faster than arrays.
    scale = [max(value, 1e-300) ** -0.5 for value in np.diagonal(gram).tolist()]
    n = len(scale)
    g = [[value * scale[i] * scale[j] for j, value in enumerate(row)]
         for i, row in enumerate(gram.tolist())]
    t = [value * scale[i] for i, value in enumerate(target.tolist())]
    active = list(positive) or list(range(n))
    x = [0.0] * n
    # The bound is for columns so alike that rounding makes `gram` indefinite.
    for _ in range(4 * n + 4):
        solved = _solve(g, t, active)
        x = [0.0] * n
        for i, value in zip(active, solved, strict=True):
            x[i] = value
        lowest = min(active, key=lambda i: x[i], default=-1)
        if active and x[lowest] < 0:
            active = [i for i in active if i != lowest]
            continue
        slack = {i: t[i] - sum(a * b for a, b in zip(g[i], x, strict=True)) for i in range(n)
                 if i not in active}
        entering = max(slack, key=lambda i: slack[i], default=-1)
        if not slack or slack[entering] <= 1e-10:
            break
        active = sorted([*active, entering])
    return np.array([max(value, 0.0) * s for value, s in zip(x, scale, strict=True)])


def _solve(gram: list[list[float]], target: list[float], part: list[int]) -> list[float]:
    """Solve the symmetric system of the chosen rows and columns by Cholesky's method."""
    # Loops over plain numbers: sums over generators take twice as long for so few.
    lower: list[list[float]] = []
    y: list[float] = []
    for row, i in enumerate(part):
        line: list[float] = []
        rest, explained = gram[i][i] + 1e-13, target[i]
        for column in range(row):
            other = lower[column]
            value = gram[i][part[column]]
            for k in range(column):
                value -= line[k] * other[k]
            value /= other[column]
            line.append(value)
            rest -= value * value
            explained -= value * y[column]
        line.append(max(rest, 1e-13) ** 0.5)
        y.append(explained / line[row])
        lower.append(line)
    x = [0.0] * len(part)
    for row in range(len(part) - 1, -1, -1):
        value = y[row]
        for k in range(row + 1, len(part)):
            value -= lower[k][row] * x[k]
        x[row] = value / lower[row][row]
    return x
