# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Where a label stands: near its point, inside the panel, and where it covers least."""

from collections.abc import Iterable
from math import inf

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]

LETTER = 0.56
"""Mean width of a letter over its height, in the sans-serif fonts of browsers."""
_AROUND = [(right, down) for down in (-34, 34, -58, 58, -86, 86, 0, -120, 120)
           for right in (16, -16, 44, -44, 90, -90)]
"""Where to try: first right above the point, then ever further off; for text 12.5 high."""


def best_place(point: tuple[float, float], size: tuple[float, float], panel: Box, avoid: Array,
               taken: Iterable[Box], scale: float = 1.0) -> Box:
    """
    Return the box for a label.

    Parameters
    ----------
    point : (float, float)
        What the label is about; y grows downwards.
    size : (float, float)
        Width and height of the label.
    panel : (float, float, float, float)
        Left, top, right and bottom of the panel.
    avoid : ndarray, shape (n, 2)
        Points that should stay free.
    taken : iterable of box
        Where labels stand.
    scale : float, optional
        Of the distances that are tried: the height of the text over 12.5.

    """
    others = list(taken)
    width, height = size
    best, cost = (point[0], point[1], point[0] + width, point[1] + height), inf
    for right, down in _AROUND:
        left = point[0] + right * scale - (width if right < 0 else 0)
        top = point[1] + down * scale - height / 2
        box = (left, top, left + width, top + height)
        # What a unit of distance costs beside a covered point, which costs 3.
        price = _price(box, panel, avoid, others) + 0.02 * (abs(right) + abs(down))
        if price < cost:
            best, cost = box, price
    return best


def _price(box: Box, panel: Box, avoid: Array, taken: Iterable[Box]) -> float:
    left, top, right, bottom = panel
    price = 0.0
    if box[0] < left + 2 or box[2] > right - 2 or box[1] < top + 2 or box[3] > bottom - 2:
        price += 1000
    for other in taken:
        if (box[0] < other[2] + 3 and other[0] < box[2] + 3
                and box[1] < other[3] + 3 and other[1] < box[3] + 3):
            price += 500
    covered = ((avoid[:, 0] > box[0] - 4) & (avoid[:, 0] < box[2] + 4)
               & (avoid[:, 1] > box[1] - 4) & (avoid[:, 1] < box[3] + 4))
    return price + 3.0 * float(covered.sum())
