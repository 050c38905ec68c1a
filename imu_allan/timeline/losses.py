# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which samples are lost, and where messages come at another rate instead.

Stamps jitter, arrive in pairs and bursts, and drift slowly; samples get lost. The phase of the
stamps against the grid distinguishes these. A lost sample shifts the phase permanently by one
whole place, jitter shifts it briefly, and drift slowly. Only a lost sample leaves the phase modulo
one place unchanged. Another rate that lasts is left out. One that is within 2 %, or brief, changes
N by 1 % at most.
"""

from math import pi

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.timeline.memory import RATE_TOLERANCE
from imu_allan.timeline.pace import COUNTING_SPREAD, group_phases, lasting_jumps, Pace, PHASE_GROUP
from imu_allan.timeline.stamps import Stamps
import numpy as np

EVEN_JITTER = 0.25
"""Steps this close to a whole number of intervals need no further analysis."""


def count_steps(places: Array, pace: Pace, late: float, new_run: bool) -> Ints:
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
        missing = lasting_jumps(phase, new_run)
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


def may_change(stamps: Stamps, steps: Ints, pace: Pace, tolerated: int) -> bool:
    """Return whether some messages, `steps` grid places apart, may come at another rate."""
    n = len(stamps)
    if n < 2:
        return False
    passed, counted = np.diff(stamps), steps[1:]
    short = ~_gaps(passed, counted, tolerated, pace)
    elapsed, places = float(passed[short].sum()) / pace.interval_ns, int(counted[short].sum())
    # They differ by more than jitter explains, or many places are empty.
    width = pace.batch if pace.counting else 0.0
    if (abs(elapsed - places) > 4 + width + 0.003 * n
            or places - np.count_nonzero(short) > 0.25 * n):
        return True
    # Half the rate for some of the messages looks like every second one lost.
    blocks = steps[1:][:(n - 1) // PHASE_GROUP * PHASE_GROUP].reshape(-1, PHASE_GROUP)
    return bool(np.any(np.count_nonzero(blocks > 1, axis=1) >= PHASE_GROUP // 2))


def _gaps(passed: Ints, steps: Ints, tolerated: int, pace: Pace) -> Bools:
    """Find long gaps, as opposed to single messages that are as late as a gap is long."""
    far: Bools = steps > tolerated
    # If only the message is late, time and places differ by three intervals or more.
    return far if pace.counting else far & (np.abs(passed / pace.interval_ns - steps) < 3.0)


def unpaced(passed: Ints, steps: Ints, tolerated: int, pace: Pace) -> tuple[int, int]:
    """Return the time and places to exclude from the rate: gaps, and places beside them."""
    # Up to 64 steps are counted correctly at any rate near the true one, and help to measure it.
    gaps = _gaps(passed, steps, tolerated if pace.counting else 64, pace)
    if not pace.counting and np.count_nonzero(gaps) * 16 < len(gaps):
        # With jitter, a place of a rare gap may be counted up to three steps beside it.
        beside = np.flatnonzero(gaps)[:, None] + np.arange(-3, 4)
        gaps[np.clip(beside, 0, len(gaps) - 1)] = True
    # With uneven stamps, the pause before a batch is not part of the gap.
    time = np.rint(steps * pace.interval_ns).astype(np.int64) if pace.counting else passed
    return int(time[gaps].sum()), int(steps[gaps].sum())


def rate_changes(places: Array, pace: Pace, other_rate: bool) -> list[tuple[int, bool]]:
    """Return the first message of each segment at one rate, to a block, and whether at another."""
    # A segment lasts at least two blocks. A block has 64 messages, 256 where messages are counted,
    # and more if they come in long batches.
    block = PHASE_GROUP
    if pace.counting:
        # A block of 16 batches: one more or less changes the rate by 6 %.
        block = max(4 * block, round(16 * pace.batch))
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
    return runs


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
    _, spread = group_phases(places)
    return len(places) < 2 or bool(np.mean(one) > 0.3 and spread < COUNTING_SPREAD
                                   and places[-1] - places[0] > 0.9 * (len(places) - 1))
