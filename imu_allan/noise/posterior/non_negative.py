# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Non-negative least squares for the few columns of a noise model.

References
----------
C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, ch. 23.

"""

from collections.abc import Sequence
from math import sqrt

from imu_allan.arrays import Array
import numpy as np


def non_negative(gram: Array, target: Array, positive: Sequence[int] = ()) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0; `positive` guesses the nonzero entries."""
    # For four columns, Python floats are several times faster than arrays.
    rows: list[list[float]] = gram.tolist()
    right: list[float] = target.tolist()
    columns = range(len(right))
    root = [sqrt(max(rows[i][i], 1e-300)) for i in columns]
    active = list(positive) or list(columns)
    solved: list[tuple[int, float]] = []
    # Limit the iterations, because near-collinear columns can make `gram` indefinite by rounding.
    for _ in range(4 * len(right) + 4):
        solved = _solve(rows, right, active)
        least, lowest = 0.0, -1
        for i, value in solved:
            if value * root[i] < least:
                least, lowest = value * root[i], i
        if lowest >= 0:
            active = [i for i in active if i != lowest]
            continue
        most, entering = 1e-10, -1
        for i in columns:
            if i not in active:
                rest = right[i]
                for j, value in solved:
                    rest -= rows[i][j] * value
                if rest > most * root[i]:
                    most, entering = rest / root[i], i
        if entering < 0:
            break
        active = sorted([*active, entering])
    x = np.zeros(len(right))
    for i, value in solved:
        x[i] = max(value, 0.0)
    return x


def _solve(gram: list[list[float]], target: list[float], part: list[int]
           ) -> list[tuple[int, float]]:
    """Solve the symmetric system of the chosen rows and columns by Cholesky's method."""
    # For so few numbers, sums over generators would take twice as long as these loops.
    lower: list[list[float]] = []
    x: list[float] = []
    for i in part:
        row = gram[i]
        line: list[float] = []
        tiny = 1e-13 * row[i] + 1e-300
        rest, explained = row[i] + tiny, target[i]
        for column, other, before in zip(part, lower, x, strict=False):
            value = row[column]
            for one, two in zip(line, other, strict=False):
                value -= one * two
            value /= other[-1]
            line.append(value)
            rest -= value * value
            explained -= value * before
        line.append(sqrt(max(rest, tiny)))
        x.append(explained / line[-1])
        lower.append(line)
    for last in range(len(part) - 1, -1, -1):
        line = lower[last]
        x[last] /= line[-1]
        for column in range(last):
            x[column] -= line[column] * x[last]
    return list(zip(part, x, strict=True))
