# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which samples are lost: how many places of the even grid lie between a message and the one before.

Stamps jitter, arrive in pairs and bursts, and drift slowly; samples get lost. The phase of the
stamps against the grid distinguishes these. A lost sample shifts the phase permanently by one
whole place, jitter shifts it briefly, and drift slowly. Only a lost sample leaves the phase modulo
one place unchanged.
"""

from imu_allan.arrays import Array, Ints
from imu_allan.timeline.pace import (
    COUNTING_SPREAD,
    group_phases,
    lasting_jumps,
    Pace,
    PHASE_GROUP,
)
import numpy as np

EVEN_JITTER = 0.25
"""Steps this close to a whole number of intervals need no further analysis."""


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
    turn, spread = group_phases(phase)
    if spread > COUNTING_SPREAD:
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
