# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From samples with their places to even pieces: short gaps bridged, split at the others."""

from itertools import pairwise

from imu_allan.block import NEIGHBOURS
from imu_allan.timeline.clock import SECOND
from imu_allan.timeline.grid import bridge
from imu_allan.timeline.pieces import EvenPiece
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def even_pieces(tail: Floats, samples: Floats, steps: Ints, index: Ints, elapsed_ns: Ints,
                interval_ns: float, tolerated: int, new_run: bool) -> list[EvenPiece]:
    """
    Give samples as rows without a gap.

    Parameters
    ----------
    tail : ndarray, shape (t, 6)
        Samples before, up to `NEIGHBOURS` of them.
    samples : ndarray, shape (n, 6)
        Those to give, and some of those that follow.
    steps : ndarray of int64, shape (n,)
        Places from each sample to the one before.
    index, elapsed_ns : ndarray of int64, shape (c,)
        Places and times of those to give, in nanoseconds since the first sample.
    interval_ns : float
        Time from place to place.
    tolerated : int
        Steps up to which a gap is bridged.
    new_run : bool
        Whether a run begins with the first sample.

    """
    c = len(index)
    known = np.concatenate([tail, samples[:c + NEIGHBOURS]])
    gaps = np.flatnonzero((steps[:c] > 1) & (steps[:c] <= tolerated))
    stretch = np.zeros(len(known), dtype=np.int64)
    stretch[len(tail):] = np.cumsum(steps[:c + NEIGHBOURS] > tolerated)
    lengths = steps[gaps] - 1
    means = np.repeat(bridge(known, gaps + len(tail), stretch), lengths, axis=0)
    ends = np.cumsum(lengths)
    holes = (np.repeat(index[gaps] - ends, lengths)
             + np.arange(int(ends[-1]) if len(ends) else 0))
    breaks = np.flatnonzero(steps[:c] > tolerated).tolist()
    pieces = []
    for first, last in pairwise([0, *(at for at in breaks if at > 0), c]):
        begins, end = int(index[first]), int(index[last - 1]) + 1
        if steps[first] <= tolerated:
            begins -= int(steps[first]) - 1
        rows = np.empty((end - begins, 6))
        rows[index[first:last] - begins] = samples[first:last]
        low, high = np.searchsorted(holes, begins), np.searchsorted(holes, end)
        rows[holes[low:high] - begins] = means[low:high]
        start_ns = float(elapsed_ns[first]) - (int(index[first]) - begins) * interval_ns
        pieces.append(EvenPiece(rows, begins, start_ns / SECOND, new_run and first == 0,
                                holes[low:high]))
    return pieces
