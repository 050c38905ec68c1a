# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages at another rate than the first ones: whether to look for them, and where they are.

Another rate that lasts is left out. One that is within 2 %, or brief, changes N by 1 % at most.
"""

from math import pi

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.timeline.options import RATE_TOLERANCE
from imu_allan.timeline.pace import COUNTING_SPREAD, group_phases, Pace, PHASE_GROUP
from imu_allan.timeline.stamps import Stamps
import numpy as np


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
    return far if pace.counting else far & (
        np.abs(passed / pace.interval_ns - steps) < 3.0)


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
