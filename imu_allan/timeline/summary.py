# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Summary of the messages so far.

The result, `imu_allan info` and the node's /diagnostics all describe one
`TimelineSummary`.
"""

from dataclasses import dataclass, field

from imu_allan.finding import Finding
from imu_allan.noise.terms import AXES
from imu_allan.result import Span, Timeline, Total
from imu_allan.timeline.findings import density_error, mostly_motion, remarks_of
from imu_allan.timeline.memory import Clock, Counts, Decision, Memory
from imu_allan.timeline.motion import MotionSummary
from imu_allan.timeline.stamps import iso_time, SECOND


@dataclass(frozen=True)
class TimelineSummary:
    """
    Summary of the messages so far.

    Attributes
    ----------
    timeline : Timeline
        The part that goes into the result. `samples` counts the messages that have a place on the
        grid, those in motion included. `missing` counts all empty places between them,
        interpolated or in a listed gap, except those of messages with unusable values. `samples`,
        `duplicates`, `out_of_order` and `rejected` add up to the messages decided on.
    clock : {'header', 'receive'} or None
        None before the first message, and if samples are only counted (no usable stamps).
    frame_id : str or None
        header.frame_id of the messages used.
    start_time : str or None
        ISO-8601 time of the first sample.
    remarks : tuple of Finding
        Findings the user should know about.
    present : tuple of bool, length 6
        Whether each axis is used; the others are NaN in every block.
    messages : int
        Messages seen, including those still held back.
    counts : Counts
        Messages by what became of them, gaps, and the faults of the stamps.
    motion : MotionSummary
        What was cut out as motion; nothing if motion is kept.
    measured_rate_hz : float or None
        Rate by the clock, whatever rate was stated.
    jitter_s : float or None
        Standard deviation of the latest stamps about the grid.
    mostly_motion : bool
        Whether more than half of the samples are motion and no segment of five seconds is at rest.
        Then this is not a recording at rest.
    turned : tuple of str
        Axes whose mean moved away and came back, as in a slow turn.
    density_error : tuple of (float, float)
        Largest relative errors, too low and too high, of noise densities, in addition to chance.

    """

    timeline: Timeline
    clock: Clock | None
    frame_id: str | None
    start_time: str | None
    remarks: tuple[Finding, ...]
    present: tuple[bool, ...]
    messages: int = 0
    counts: Counts = field(default_factory=Counts)
    motion: MotionSummary = field(default_factory=MotionSummary)
    measured_rate_hz: float | None = None
    jitter_s: float | None = None
    mostly_motion: bool = False
    turned: tuple[str, ...] = ()
    density_error: tuple[float, float] = (0.0, 0.0)


def summarize(memory: Memory) -> TimelineSummary:
    """Summarize the state of a timeline."""
    counts, decision, cursor = memory.counts, memory.decision, memory.cursor
    # With 'keep', motion is only detected, not cut out.
    motion = (MotionSummary() if memory.motion is None or memory.options.motion == 'keep'
              else memory.motion.summary)
    measured = _measured_rate(counts, decision, cursor.late_ns)
    rate = memory.options.rate_hz or measured
    last_sample_s = 1 / rate if rate and counts.samples else 0.0
    start = None
    epoch_clock_ns = 20 * 365 * 86400 * SECOND   # smaller stamps count from a boot, not from 1970
    if cursor.first_ns is not None and not decision.counted_only:
        boot_clock = cursor.first_ns < epoch_clock_ns
        first = max(cursor.first_ns, counts.receive.first_ns) if boot_clock else cursor.first_ns
        # A table that counts from zero has no date.
        start = iso_time(first) if first >= epoch_clock_ns else None
    return TimelineSummary(
        timeline=Timeline(
            sample_rate_hz=rate, samples=counts.samples,
            duration_s=cursor.elapsed_ns / SECOND + last_sample_s,
            missing=counts.missing, duplicates=counts.duplicates,
            out_of_order=counts.out_of_order, rejected=counts.rejected,
            gaps=tuple(Span(*gap) for gap in counts.listed_gaps),
            motion=tuple(Span(*span) for span in motion.cut.listed),
            all_gaps=Total(counts.gaps, counts.gaps_ns / SECOND)
            if counts.gaps > len(counts.listed_gaps) else None,
            all_motion=Total(motion.cut.count, motion.cut.total_s)
            if motion.cut.count > len(motion.cut.listed) else None),
        clock=None if decision.counted_only else decision.clock,
        frame_id=decision.frame_id, start_time=start, remarks=remarks_of(memory),
        present=tuple(decision.present), messages=counts.messages + memory.pending.messages,
        counts=counts.copy(), motion=motion.copy(), mostly_motion=mostly_motion(motion),
        measured_rate_hz=None if decision.counted_only else measured,
        jitter_s=None if cursor.jitter is None or decision.counted_only
        else cursor.jitter * decision.pace.interval_ns / SECOND,
        turned=tuple(name for axis, name in enumerate(AXES)
                     if any(found[2] == axis for found in memory.slow_turns)),
        density_error=density_error(counts, decision))


def _measured_rate(counts: Counts, decision: Decision, late_ns: float) -> float | None:
    """Return samples per second of all unbroken segments; the last stamp is late by `late_ns`."""
    # Only whole places are corrected, as after a gap taken for lateness: less may be a drifting
    # rate.
    interval = decision.pace.interval_ns
    passed = counts.paced_ns - max(int(late_ns / interval), 0) * interval
    if passed <= 0 or not counts.paced_steps:
        return None
    return counts.paced_steps / passed * SECOND
