# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The even grid at the sensor's rate: which places are empty, and which are interpolated.

Stamps jitter, arrive in pairs and bursts, and drift slowly; samples get lost. The phase of the
stamps against the grid distinguishes these. A lost sample shifts the phase permanently by one
whole place, jitter shifts it briefly, and drift slowly. Only a lost sample leaves the phase modulo
one place unchanged.
"""

from itertools import pairwise
from math import pi, sqrt

from imu_allan.arrays import Array, Ints
from imu_allan.block import EvenBlock, NEIGHBOURS
from imu_allan.timeline.clock import SECOND
from imu_allan.timeline.options import RATE_TOLERANCE
from imu_allan.timeline.pace import (
    FIRM_PHASE,
    group_phases,
    lasting_jumps,
    Pace,
    PHASE_GROUP,
)
import numpy as np

EVEN_JITTER = 0.25
"""Steps this close to a whole number of intervals need no further analysis."""

RATE_BLOCK = 64
"""Messages from which one rate is measured."""


def count_steps(places: Array, pace: Pace, late: float = 0.0, new_run: bool = False) -> Ints:
    """Count the grid steps to each message from the one before, 1 where nothing is missing."""
    # `places` are stamps in intervals; 0 is the place of the last sample, whose stamp is `late`.
    # The phase of a new run rests on its first message alone, which may be late.
    steps = np.empty_like(places)
    steps[0] = places[0] - late
    np.subtract(places[1:], places[:-1], out=steps[1:])
    if not pace.counting:
        whole = np.rint(steps)
        if whole.min() >= 1:
            uneven = np.abs(steps - whole) >= EVEN_JITTER
            # A clock may drift by a fraction of an interval over a gap of more than ten.
            if not uneven.any() or bool(np.all(steps[uneven] > 10.0)):
                return whole.astype(np.int64)
    phase = places - np.arange(1, len(places) + 1)
    missing = None if pace.counting else _missing_by_phase(phase, new_run)
    if missing is None:
        missing = lasting_jumps(phase, None if new_run else 0.0)
    counted: Ints = np.diff(missing, prepend=0) + 1
    return counted


def _missing_by_phase(phase: Array, new_run: bool) -> Ints | None:
    """Count all samples missing before each message, by the phase less its slow drift."""
    turn, length = group_phases(phase)
    if np.mean(length) < FIRM_PHASE:
        return None
    turn -= np.rint(turn[0])
    centres = np.minimum(np.arange(len(turn)) * PHASE_GROUP + PHASE_GROUP / 2, len(phase))
    slow = np.interp(np.arange(len(phase)), centres, turn) if len(turn) > 1 else turn[0]
    raw = np.rint(phase - slow).astype(np.int64)
    few = 5   # messages that give the level at either end, as one or two may be late
    before = _level(raw[:few]) if new_run else 0
    if new_run and raw[0] < before - 1:
        # Stamps may be late but never early, so the first message lies before a gap.
        before = int(raw[0])
    earlier, later = np.append(before, raw[:-1]), np.append(raw[1:], _level(raw[-few:]))
    # The median of three removes single strays; the minimum removes passing lateness.
    smooth = np.clip(raw, np.minimum(earlier, later), np.maximum(earlier, later))
    lasting = np.minimum.accumulate(smooth[::-1])[::-1]
    return lasting - lasting[0] if new_run else np.maximum(lasting, 0)


def _level(values: Ints) -> int:
    return int(np.sort(values)[len(values) // 2])


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


def rate_changes(places: Array, pace: Pace, other_rate: bool) -> list[tuple[int, bool]]:
    """Return the first message of each segment at one rate, and whether at another one."""
    # A segment lasts at least two blocks. A block has 64 messages, 256 where messages are counted,
    # and more if they come in long batches.
    block = RATE_BLOCK
    if pace.counting:
        # A block of 16 batches: one more or less changes the rate by 6 %.
        block = max(4 * block, round(16 * sqrt(12) * pace.spread))
    starts = list(range(0, max(len(places) - block, 0) + 1, block))
    ends = [*starts[1:], len(places)]
    off = [not _on_rate(places[first:last], pace.counting)
           for first, last in zip(starts, ends, strict=True)]
    runs: list[tuple[int, bool]] = []
    state = other_rate
    for number, start in enumerate(starts):
        lasting = off[number:number + 2] == [not state, not state]
        if lasting:
            state = not state
        if not runs or runs[-1][1] != state:
            runs.append((start, state))
    edges = [0, *(_change_point(places, first, other) for first, other in runs[1:])]
    # Changes are located one by one, so those around a short run may be out of order.
    ordered = np.maximum.accumulate(edges).tolist()
    return [(edge, other) for edge, (_, other) in zip(ordered, runs, strict=True)]


def _on_rate(places: Array, counting: bool) -> bool:
    """Return whether messages n apart are mostly n intervals apart, for one of several n."""
    tolerance = 0.1 if counting else RATE_TOLERANCE
    # By chance, the mean cosine of 64 jittering steps falls only a third as far below zero.
    if not counting and len(places) > 1 and float(
            np.mean(np.cos(2 * pi * np.diff(places)))) < -0.3:
        # With regular drops, messages at another rate may be n intervals apart by chance.
        return False
    for apart in (1, 2, 4, 16, 64, 256):
        if len(places) <= apart:
            break
        distance = float(np.median(places[apart:] - places[:-apart])) / apart
        if abs(distance - 1) < tolerance:
            return True
    # If samples are dropped regularly, messages n apart never span n intervals.
    one = np.rint(np.diff(places)) == 1
    _, length = group_phases(places)
    return len(places) < 2 or bool(np.mean(one) > 0.3 and np.mean(length) > FIRM_PHASE
                                   and places[-1] - places[0] > 0.9 * (len(places) - 1))


def _change_point(places: Array, near: int, to_other: bool) -> int:
    """Locate the message near number `near` at which the rate changes."""
    reach = 256   # messages on each side
    first, last = max(near - reach, 0), min(near + reach, len(places) - 1)
    steps = np.diff(places[first:last + 1])
    other = float(np.median(steps[-reach // 2:] if to_other else steps[:reach // 2]))
    worse = np.minimum(np.abs(steps - 1), 1) - np.minimum(np.abs(steps - other), 1)
    total = np.cumsum(worse if to_other else -worse)
    return first + 1 + int(np.argmin(total))
