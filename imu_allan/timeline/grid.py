# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Samples on the even grid: short gaps are interpolated, long ones end a block."""

from itertools import pairwise

from imu_allan.arrays import Array, Ints
from imu_allan.block import EvenBlock, NEIGHBOURS
from imu_allan.timeline.stamps import SECOND
import numpy as np


def interpolate(samples: Array, at: Ints, segment: Ints) -> Array:
    """Return, for gaps before rows `at`, the mean of up to 8 samples on each side."""
    # Only samples of the same unbroken segment are used.
    around = at[:, None] + np.arange(-NEIGHBOURS, NEIGHBOURS)
    valid = (around >= 0) & (around < len(samples))
    around = np.clip(around, 0, len(samples) - 1)
    valid &= segment[around] == segment[at][:, None]
    weight = valid / valid.sum(axis=1, keepdims=True)
    # Averaged relative to the sample after the gap, so that equal values give exactly that value.
    behind = samples[at]
    means: Array = behind + np.einsum('gk,gki->gi', weight, samples[around] - behind[:, None])
    return means


def even_blocks(tail: Array, samples: Array, steps: Ints, index: Ints, elapsed_ns: Ints,
                interval_ns: float, tolerated: int, new_run: bool) -> list[EvenBlock]:
    """Return the samples with an `index` as blocks; the others are only neighbours."""
    # `tail` holds the samples before. Steps of up to `tolerated` are interpolated, longer ones end
    # a block.
    c = len(index)
    known = np.concatenate([tail, samples[:c + NEIGHBOURS]])
    gaps = np.flatnonzero((steps[:c] > 1) & (steps[:c] <= tolerated))
    segment = np.zeros(len(known), dtype=np.int64)
    segment[len(tail):] = np.cumsum(steps[:c + NEIGHBOURS] > tolerated)
    lengths = steps[gaps] - 1
    means = np.repeat(interpolate(known, gaps + len(tail), segment), lengths, axis=0)
    ends = np.cumsum(lengths)
    holes = (np.repeat(index[gaps] - ends, lengths)
             + np.arange(int(ends[-1]) if len(ends) else 0))
    breaks = np.flatnonzero(steps[:c] > tolerated).tolist()
    blocks = []
    for first, last in pairwise([0, *(at for at in breaks if at > 0), c]):
        begins, end = int(index[first]), int(index[last - 1]) + 1
        if steps[first] <= tolerated:
            begins -= int(steps[first]) - 1
        rows = np.empty((end - begins, 6))
        rows[index[first:last] - begins] = samples[first:last]
        low, high = np.searchsorted(holes, begins), np.searchsorted(holes, end)
        rows[holes[low:high] - begins] = means[low:high]
        start_ns = float(elapsed_ns[first]) - (int(index[first]) - begins) * interval_ns
        blocks.append(EvenBlock(rows, begins, holes[low:high] - begins, new_run and first == 0,
                                start_s=start_ns / SECOND))
    return blocks
