# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Stamps of messages: what makes them unusable, where they jump, run backward or repeat.

All stamps are int64 nanoseconds. The header stamp is when the driver says the sample was taken,
the receive stamp is when the recorder or the subscription got the message.
"""

from dataclasses import dataclass

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.finding import Flaw
import numpy as np
from numpy.typing import NDArray

Stamps = Ints

SECOND = 1_000_000_000  # nanoseconds, the unit of all stamps
_JUMP_MESSAGES = 16
"""If this many messages in a row stay behind, the clock jumped back; fewer are only reordered."""


def flaw_of(stamps: Stamps, repeats: Bools, bursts: bool) -> Flaw | None:
    """Return what makes `stamps`, in order of arrival, unusable as the clock, or None."""
    # A message that `repeats` the content of the one before is not a flaw of the clock. With
    # `bursts`, equal stamps are expected. Without, one message in 200 out of order is no accident:
    # so begin the batches of a driver that dates samples back by too long an interval.
    if len(stamps) < 2:
        return None
    if not stamps.any():
        return 'zero'
    steps = np.diff(stamps)
    if not steps.any():
        # A few copies of one message say nothing about the clock.
        return None if repeats.all() and len(stamps) < 8 else 'constant'
    if len(stamps) >= 8 and not np.any(stamps % SECOND) and np.mean(steps == 0) > 0.2:
        return 'in whole seconds'
    distinct = steps[~(repeats & (steps == 0))]
    if np.mean(distinct == 0) > (0.98 if bursts else 0.1):
        return 'coarse'
    return 'out of order' if np.mean(distinct < 0) > (0.2 if bursts else 0.005) else None


@dataclass(frozen=True)
class Order:
    """Which messages can be placed on the timeline."""

    keep: Bools  # messages whose stamp is later than every stamp kept before, shape (n,)
    duplicate: Bools  # those of the other messages whose stamp repeats the newest, shape (n,)
    jumps: Bools  # kept messages before which the clock jumped back, shape (n,)


def order_stamps(stamps: Stamps, last: int | None) -> Order | None:
    """Find stamps that repeat or run backward, `last` before them; None if there are none."""
    # Messages behind the newest stamp are rejected. If many follow each other there, the clock has
    # jumped back (clock step, bag loop, restarted simulator), and ordering starts afresh with
    # them.
    n = len(stamps)
    if n == 0 or ((last is None or stamps[0] > last) and bool(np.all(stamps[1:] > stamps[:-1]))):
        return None
    keep = np.ones(n, dtype=bool)
    duplicate = np.zeros(n, dtype=bool)
    jumps = np.zeros(n, dtype=bool)
    start, newest = 0, last
    while True:
        part = stamps[start:]
        first = np.iinfo(np.int64).min if newest is None else newest
        before = np.maximum.accumulate(np.append(first, part[:-1]))
        ahead = part > before
        behind = np.flatnonzero(~ahead)
        keep[start:] = ahead
        duplicate[start:] = part == before
        jump = _first_jump_back(part, behind)
        if jump is None:
            break
        at = start + jump
        jumps[at] = True
        start, newest = at, None
    return Order(keep, duplicate, jumps)


def _first_jump_back(stamps: Stamps, behind: NDArray[np.intp]) -> int | None:
    """Find the first of many messages in a row that lie behind the newest stamp but go forward."""
    further = _JUMP_MESSAGES - 1
    in_a_row = behind[further:] - behind[:-further] == further
    for first in behind[:-further][in_a_row]:
        run = stamps[first:first + _JUMP_MESSAGES]
        if np.count_nonzero(np.diff(run) > 0) > _JUMP_MESSAGES // 2:
            return int(first)
    return None


def place_in_burst(stamps: Stamps, last: int | None, ties: int) -> Ints:
    """Count for each message those in a row before it with its stamp; `last` had `ties`."""
    tied = np.append(len(stamps) > 0 and last is not None and stamps[0] == last,
                     stamps[1:] == stamps[:-1])
    return count_in_runs(tied, ties)[0]


def count_in_runs(same: Bools, before: int) -> tuple[Ints, Ints]:
    """Count True values in a row up to each element, and in its run; `before` come first."""
    run = np.cumsum(~same)
    begins = np.append(-1 - before, np.flatnonzero(~same))
    lengths = np.cumsum(np.bincount(run, minlength=len(begins))) - 1 - begins
    return np.arange(len(same)) - begins[run], lengths[run]


def off_a_line(places: Array | Ints) -> Array:
    """Return how far places lie off the straight line that fits them best."""
    number = np.arange(len(places)) - (len(places) - 1) / 2
    off: Array = places - places.mean() - (number @ places) / (number @ number) * number
    return off
