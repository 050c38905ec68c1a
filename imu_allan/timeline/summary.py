# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Summary of the messages so far, with the findings about stamps, losses, gaps, values and motion.

The result, `imu_allan info` and the node's /diagnostics all describe one `TimelineSummary`.
Findings about counts are reported above a threshold, which stands beside each. Those about
decisions, such as the choice of a clock, come from where it is decided (choose_clock.py).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from math import log

from imu_allan.finding import Finding, finding
from imu_allan.noise.terms import AXES
from imu_allan.result import Span, Timeline, Total
from imu_allan.sensor.units import STANDARD_GRAVITY
from imu_allan.timeline.memory import Clock, Counts, Decision, LONGEST_QUEUE_NS, Memory
from imu_allan.timeline.motion import MotionSummary
from imu_allan.timeline.stamps import SECOND
from imu_allan.timeline.values import Content
import numpy as np


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
    remarks = tuple(_remarks_of(memory))
    measured = _measured_rate(counts, decision, cursor.late_ns)
    rate = memory.options.rate_hz or measured
    last_sample_s = 1 / rate if rate and counts.samples else 0.0
    start = None
    epoch_clock_ns = 20 * 365 * 86400 * SECOND   # smaller stamps count from a boot, not from 1970
    if cursor.first_ns is not None and not decision.counted_only:
        boot_clock = cursor.first_ns < epoch_clock_ns
        first = max(cursor.first_ns, counts.receive.first_ns) if boot_clock else cursor.first_ns
        # A table that counts from zero has no date.
        start = _iso_time(first) if first >= epoch_clock_ns else None
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
        frame_id=decision.frame_id, start_time=start, remarks=remarks,
        present=tuple(decision.present), messages=counts.messages + memory.pending.messages,
        counts=counts.copy(), motion=motion.copy(), mostly_motion=mostly_motion(motion),
        measured_rate_hz=None if decision.counted_only else measured,
        jitter_s=None if cursor.jitter is None or decision.counted_only
        else cursor.jitter * decision.pace.interval_ns / SECOND,
        turned=tuple(axis for remark in remarks if remark.code == 'slow_motion'
                     for axis in remark.axes),
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


def _remarks_of(memory: Memory) -> Iterator[Finding]:
    """Yield the findings; one about the recording as a whole comes once for each code."""
    for name, no_number in zip(AXES, memory.decision.not_finite, strict=True):
        if no_number:
            yield finding('axis_not_finite', (name,))
    for code, figures in memory.decision.remarks.items():
        yield finding(code, **figures)
    yield from _content_findings(memory.counts, memory.content, memory.options.polled)
    yield from _clock_findings(memory)
    yield from _count_findings(memory.counts, memory.decision)
    yield from _motion_findings(memory)


def density_error(counts: Counts, decision: Decision) -> tuple[float, float]:
    """Bound the relative errors, too low and too high, of N due to faults of the stamps."""
    either = _short_error(counts, decision) / 2 + _interpolation_error(counts)
    return either, either + _hidden_error(decision)


def _hidden_error(decision: Decision) -> float:
    # Fewer hidden losses change the noise density by less than a tenth of a usual interval.
    hidden = decision.pace.hidden
    return hidden / 2 / (1 - hidden) if hidden >= 0.005 else 0.0


def _short_error(counts: Counts, decision: Decision) -> float:
    error = decision.pace.batch / max(counts.paced_steps, 1) if decision.pace.counting else 0.0
    return error if error > 0.005 else 0.0


def _interpolation_error(counts: Counts) -> float:
    # With longer gaps in addition, 55 % are lost in all: up to there N is right.
    many = counts.interpolated >= 0.51 * (counts.samples + counts.interpolated)
    # On 36 axes N was off by up to 13 % with 57.5 % lost, by 19 % with 60 %; more losses are gaps.
    return 0.25 if counts.interpolated and many else 0.0


def mostly_motion(motion: MotionSummary) -> bool:
    """Return whether a recording is in motion, without any stop that is long and quiet enough."""
    # A stop at a traffic light is longer; a car between two bends is quiet for less. Rest with
    # more than a third of the noise of motion is not rest, but a straight road.
    return _moves(motion) and (motion.kept.longest_s < 5.0
                               or motion.contrast < 0.999 * log(3.0) * 2 / 3)


def _moves(motion: MotionSummary) -> bool:
    # A single knock and its margins may be most of a short recording, which then is not moving. A
    # lower limit on duration, and the share without margins, exclude that.
    return motion.seen > 0 and (motion.cut.rows == motion.seen or (
        motion.cut.total_s > 10.0
        and motion.cut.rows > 0.5 * motion.seen
        and motion.struck > 0.25 * motion.seen))


def _content_findings(counts: Counts, content: Content, known: bool) -> Iterator[Finding]:
    """Yield findings on values; `known`: whether repeats were, before any message."""
    if content.frozen:
        yield finding('frozen', messages=content.frozen, since_s=content.frozen_s)
    # Where repeats were known before, `repeated_half` says so.
    held = content.held and not known
    if held and counts.header.repeats >= content.repeats:
        # Polling gives a repeated value another stamp.
        yield finding('repeated_part', messages=content.repeats)
    elif held:
        yield finding('held_values', share=content.repeats / (content.repeats + content.changes))
    if counts.spikes:
        yield finding('spikes', messages=counts.spikes)
    # Less than one in a hundred are occasional driver faults. Chosen by judgment.
    if counts.other_axes > 0.01 * counts.messages:
        yield finding('field_absent', messages=counts.other_axes)


def _clock_findings(memory: Memory) -> Iterator[Finding]:
    """Compare the speeds of both clocks, unless the user has chosen one."""
    counts, decision = memory.counts, memory.decision
    # With fewer messages, the lag of the receive stamps hides any difference.
    if ((memory.options.clock, decision.clock) != ('auto', 'header') or decision.one_clock
            or decision.counted_only
            or counts.header.last_ns is None or counts.receive.last_ns is None
            or counts.messages < 256):
        return
    header = counts.header.last_ns - counts.header.first_ns
    receive = counts.receive.last_ns - counts.receive.first_ns
    if header <= 0 or receive <= 0:
        return
    # A crystal is off by millionths; a replay or a simulation by more than 5 %. The first receive
    # stamps lag by what waited in a queue, unless the first messages show such a speed all the
    # time. Chosen by judgment.
    waited = 0.0 if abs(log(decision.first_speed)) >= 0.05 else LONGEST_QUEUE_NS
    if abs(log(header / receive)) >= max(0.05, waited / min(header, receive)):
        yield finding('clock_speed', ratio=header / receive)


def _count_findings(counts: Counts, decision: Decision) -> Iterator[Finding]:
    clock = 'time' if decision.one_clock else decision.clock
    if counts.clock_jumps:
        yield finding('clock_jumps', clock=clock, count=counts.clock_jumps)
    if decision.pace.counting:
        hidden = _hidden_error(decision)
        yield finding('uneven_stamps', clock=clock,
                      hidden_share=decision.pace.hidden if hidden else None,
                      density_high_share=hidden or None,
                      rate_error_share=_short_error(counts, decision) or None)
    places = counts.samples + counts.interpolated
    # The fit allows for interpolation, but one in twenty means a bad link. Chosen by judgment.
    if counts.interpolated > 0.05 * places:
        yield finding('many_missing', share=counts.interpolated / places,
                      density_error_share=_interpolation_error(counts) or None)
    if counts.at_other_rate:
        used, other = SECOND / decision.pace.interval_ns, counts.changed_rate_hz
        # Time counts from the first sample used: messages left out before it have no time.
        known = counts.rate_changed_s > 0
        yield finding('rate_changed', from_hz=used if known else other,
                      to_hz=other if known else used,
                      at_s=counts.rate_changed_s if known else None,
                      left_out=counts.at_other_rate,
                      most_left_out=counts.at_other_rate >= counts.samples)
    if counts.other_frames:
        yield finding('several_frames', frame_id=decision.frame_id, others=[*counts.other_frames],
                      rejected=[*counts.other_frames.values()])
    # An accelerometer that is all zeros is not there, which its axes say.
    if any(counts.gravity):
        size = float(np.linalg.norm(counts.gravity)) / counts.gravity_samples
        # Usual offsets are smaller; units of g or removed gravity differ far more. Chosen by
        # judgment.
        if abs(size - STANDARD_GRAVITY) > 0.5:
            yield finding('gravity', mean=size)


def _motion_findings(memory: Memory) -> Iterator[Finding]:
    if memory.motion is None:
        return
    motion, turns = memory.motion.summary, memory.motion.turns.found
    cut = motion.cut
    if memory.options.motion == 'keep':
        if cut.listed:
            yield finding('motion_kept', count=cut.count, seen_s=cut.total_s,
                          first_s=cut.listed[0][0])
        return
    if mostly_motion(motion):
        yield finding('mostly_motion', share=cut.rows / motion.seen)
    elif _moves(motion):
        # As many as fit into two lines of a terminal.
        named = motion.kept.listed[:5]
        yield finding('rest_within_motion', share=cut.rows / motion.seen,
                      rest_s=motion.kept.total_s, rests=len(motion.kept.listed),
                      starts_s=[start for start, _ in named],
                      durations_s=[lasts for _, lasts in named])
    elif cut.count:
        yield finding('motion', count=cut.count, excluded_s=cut.total_s)
    if motion.changes:
        yield finding('noise_level_changed', at_s=[time_s for time_s, _ in motion.changes],
                      ratios=[ratio for _, ratio in motion.changes])
    # Means that moved away and came back: the largest of each axis, and their number.
    for number, (axis, quantity) in enumerate(AXES.items()):
        own = [one for one in turns if one[2] == number]
        if own:
            start, lasts, _, size = max(own, key=lambda one: abs(one[3]))
            yield finding('slow_motion', (axis,), size=size, unit=quantity.unit, start_s=start,
                          duration_s=lasts, count=len(own))


def _iso_time(stamp_ns: int) -> str:
    """Format nanoseconds since 1970 as ISO-8601 in UTC."""
    moment = datetime(1970, 1, 1, tzinfo=timezone.utc) + timedelta(microseconds=stamp_ns // 1000)
    return moment.isoformat().replace('+00:00', 'Z')
