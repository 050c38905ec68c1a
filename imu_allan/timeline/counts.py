# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a timeline has counted of its messages, for the report alone: nothing is decided by it."""

from dataclasses import dataclass, field

from imu_allan.state import Record
from imu_allan.timeline.clock import SECOND, Stamps
import numpy as np

LISTED_GAPS = 1000
"""Gaps that are listed one by one; more are only counted."""

SPARSE = 16
"""Every so many samples go into the mean acceleration, which needs no more."""
_LISTED_FRAMES = 9
"""Other frame_ids that are named: a fault can make any number of them."""


@dataclass
class Counts(Record):
    """
    Messages by their fate, and the faults of their stamps.

    Attributes
    ----------
    messages : int
        Decided on so far.
    samples : int
        Found their place on the grid.
    missing, bridged : int
        Empty places, and those of them that a local mean fills.
    duplicates, out_of_order, rejected : int
        Why the other messages found none.
    spikes : int
        Those of the rejected that are single wild values.
    absent : int
        Those of the rejected that declare a field as not provided which others have.
    header_repeats, header_backward, receive_repeats, receive_backward : int
        Stamps equal to, or before, the one before.
    first_header_ns, first_receive_ns : int
        Stamps of the first message.
    last_header, last_receive : int or None
        Newest stamps, with which the next ones are compared.
    clock_jumps : int
        Jumps of the clock in use.
    gaps, gaps_ns : int
        Gaps that are not bridged, and their total duration.
    longest_gap_ns : int
        Duration of the longest one.
    listed_gaps : list of (float, float)
        Start and duration in seconds of the first ones.
    other_frames : dict
        Messages rejected for their frame_id, by frame_id.
    at_other_rate : int
        Messages rejected because they came at another rate.
    rate_changed_s, changed_rate_hz : float
        When the rate last changed, and to which.
    lowest_rate_hz, highest_rate_hz : float
        Of messages that went on at another rate than was measured, and are used; 0 if none did.
    paced_ns, paced_steps : int
        Time and places of all unbroken stretches: their ratio is the rate.
    gravity : list of float, gravity_samples : int
        Sum of some accelerations, and how many.

    """

    messages: int = 0
    samples: int = 0
    missing: int = 0
    bridged: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    rejected: int = 0
    spikes: int = 0
    absent: int = 0
    header_repeats: int = 0
    header_backward: int = 0
    receive_repeats: int = 0
    receive_backward: int = 0
    first_header_ns: int = 0
    first_receive_ns: int = 0
    last_header: int | None = None
    last_receive: int | None = None
    clock_jumps: int = 0
    gaps: int = 0
    gaps_ns: int = 0
    longest_gap_ns: int = 0
    listed_gaps: list[tuple[float, float]] = field(default_factory=list)
    other_frames: dict[str, int] = field(default_factory=dict)
    at_other_rate: int = 0
    rate_changed_s: float = 0.0
    changed_rate_hz: float = 0.0
    lowest_rate_hz: float = 0.0
    highest_rate_hz: float = 0.0
    paced_ns: int = 0
    paced_steps: int = 0
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    gravity_samples: int = 0

    def forget(self) -> None:
        """Call all samples so far rejected: they were one value, repeated."""
        self.rejected += self.samples
        self.samples = self.missing = self.bridged = 0
        self.gaps = self.gaps_ns = self.longest_gap_ns = 0
        self.paced_ns = self.paced_steps = self.gravity_samples = 0
        self.listed_gaps, self.gravity = [], [0.0, 0.0, 0.0]

    def list_gap(self, start_ns: float, duration_ns: float) -> None:
        """Note a gap that is not bridged."""
        self.gaps += 1
        self.gaps_ns += round(duration_ns)
        self.longest_gap_ns = max(self.longest_gap_ns, round(duration_ns))
        if len(self.listed_gaps) < LISTED_GAPS:
            self.listed_gaps.append((start_ns / SECOND, duration_ns / SECOND))

    def reject_frame(self, frame_id: str, messages: int) -> None:
        """Note messages of another frame_id than the first."""
        self.messages += messages
        self.rejected += messages
        known = frame_id in self.other_frames or len(self.other_frames) < _LISTED_FRAMES
        name = frame_id if known else '...'
        self.other_frames[name] = self.other_frames.get(name, 0) + messages

    def add_header_faults(self, stamps: Stamps) -> bool:
        """Count repeated and backward header stamps; tell whether there are any."""
        repeats, backward = _stamp_faults(stamps, self.last_header)
        self.header_repeats += repeats
        self.header_backward += backward
        return bool(repeats or backward)

    def add_receive_faults(self, stamps: Stamps) -> None:
        """Count repeated and backward receive stamps."""
        repeats, backward = _stamp_faults(stamps, self.last_receive)
        self.receive_repeats += repeats
        self.receive_backward += backward


def _stamp_faults(stamps: Stamps, last: int | None) -> tuple[int, int]:
    """Count stamps equal to, and before, the one before."""
    if not len(stamps) or ((last is None or stamps[0] > last)
                           and (stamps[1:] > stamps[:-1]).all()):
        return 0, 0
    steps = np.diff(stamps) if last is None else np.diff(stamps, prepend=last)
    return int(np.count_nonzero(steps == 0)), int(np.count_nonzero(steps < 0))
