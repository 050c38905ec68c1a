# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What was seen of the messages: the counts, and what to tell the user about them.

The result, `imu_allan info` and the node's /diagnostics all tell the story of one
`TimelineSummary`.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import dataclass, field
from typing import Any, Literal

from imu_allan.result import Remark, Span, Timeline
from imu_allan.timeline.clock import iso_time, SECOND
from imu_allan.timeline.motion import MotionSummary
from imu_allan.timeline.options import TimelineOptions
import numpy as np

Clock = Literal['header', 'receive']

LISTED_GAPS = 1000
"""Gaps that are listed one by one; more are only counted."""

_GRAVITY = 9.80665
_GRAVITY_TOLERANCE = 0.5
_MANY_MISSING = 0.05
_MOSTLY = 0.5
_LONG_MOTION_S = 10.0
_EPOCH_CLOCK_NS = 20 * 365 * 86400 * SECOND
"""Stamps below count from a boot, not from 1970."""


@dataclass(frozen=True)
class TimelineSummary:
    """
    What was seen of the messages so far.

    Attributes
    ----------
    timeline : Timeline
        The part that goes into the result. `samples` counts the messages that found their place
        on the grid, those in motion among them; `missing` counts all empty places between them,
        bridged or in a listed gap. `samples`, `duplicates`, `out_of_order` and `rejected` add up
        to the messages decided on.
    clock : {'header', 'receive'} or None
        None before a message came, and where samples are only counted (no usable stamps).
    frame_id : str or None
        header.frame_id of the messages used.
    start_time : str or None
        ISO-8601 time of the first sample.
    remarks : tuple of Remark
        Findings the user should know about.
    present : tuple of bool, length 6
        Whether each axis is there; the others are NaN in every block.
    messages : int
        Messages seen, those still held back included.
    bridged : int
        Missing samples that were bridged by the local mean.
    gaps, gaps_s : int, float
        Number and total duration of the gaps that were not bridged, listed or not.
    measured_rate_hz : float or None
        Rate by the clock, whatever rate was stated.
    jitter_s : float or None
        Standard deviation of the stamps about the grid, lately.
    header_repeats, header_backward, receive_repeats, receive_backward : int
        Stamps equal to, or before, the stamp of the message before, on either clock.
    clock_jumps : int
        Jumps of the clock, and changes from one clock to the other.
    at_other_rate : int
        Messages rejected because they came at another rate than the first ones.
    motions, excluded_s : int, float
        Number and total duration of the spans of motion cut out, listed or not.
    moving : bool
        Motion was seen within the last seconds.
    mostly_motion : bool
        More than half of the samples are motion: this is no recording at rest.

    """

    timeline: Timeline
    clock: Clock | None
    frame_id: str | None
    start_time: str | None
    remarks: tuple[Remark, ...]
    present: tuple[bool, ...]
    messages: int = 0
    bridged: int = 0
    gaps: int = 0
    gaps_s: float = 0.0
    measured_rate_hz: float | None = None
    jitter_s: float | None = None
    header_repeats: int = 0
    header_backward: int = 0
    receive_repeats: int = 0
    receive_backward: int = 0
    clock_jumps: int = 0
    at_other_rate: int = 0
    motions: int = 0
    excluded_s: float = 0.0
    moving: bool = False
    mostly_motion: bool = False


@dataclass
class Facts:
    """
    The running state of a timeline: counts, conclusions, and where on the grid it stands.

    Plain numbers and text only, so that JSON keeps it. `elapsed_ns` is the time since the first
    sample, which goes on where the clock jumps; `late_ns` how far the last stamp lies behind its
    place on the grid.
    """

    messages: int = 0
    samples: int = 0
    missing: int = 0
    bridged: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    rejected: int = 0
    header_repeats: int = 0
    header_backward: int = 0
    receive_repeats: int = 0
    receive_backward: int = 0
    clock_jumps: int = 0
    gaps: int = 0
    gaps_ns: int = 0
    listed_gaps: list[tuple[float, float]] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    other_frames: dict[str, int] = field(default_factory=dict)
    frame_id: str | None = None

    clock: Clock | None = None
    counted_only: bool = False
    present: list[bool] | None = None
    interval_ns: float | None = None
    spread: float = 0.0
    counting: bool = False
    jitter: float | None = None
    paced_ns: int = 0
    paced_steps: int = 0
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    gravity_samples: int = 0

    first_ns: int | None = None
    first_receive_ns: int = 0
    last_header: int | None = None
    last_receive: int | None = None
    last_ns: int | None = None
    other_ns: int = 0
    late_ns: float = 0.0
    tied_to: int | None = None
    ties: int = 0
    index: int = -1
    elapsed_ns: int = 0
    fresh_run: bool = False
    jumped: bool = False

    other_rate: bool = False
    at_other_rate: int = 0
    rate_changed_s: float = 0.0
    changed_rate_hz: float = 0.0

    def copy(self) -> 'Facts':
        """Give an independent copy."""
        twin = shallow_copy(self)
        for name, value in vars(self).items():
            if isinstance(value, (list, dict)):
                setattr(twin, name, value.copy())
        return twin

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> 'Facts':
        """
        Take the fields as JSON gives them.

        Raises
        ------
        TypeError
            If a field is unknown or of another type.

        """
        facts = cls(**plain)
        for name, default in vars(cls()).items():
            value = getattr(facts, name)
            kinds: tuple[type, ...] = (type(default),)
            if default is None:
                kinds = (type(None), int, float, str, list)
            elif isinstance(default, float):
                kinds = (float, int)
            if not isinstance(value, kinds):
                raise TypeError(f'{name} is {value!r}')
        facts.listed_gaps = [(float(start), float(lasts)) for start, lasts in facts.listed_gaps]
        return facts

    def list_gap(self, start_ns: float, duration_ns: float) -> None:
        """Note a gap that is not bridged."""
        self.gaps += 1
        self.gaps_ns += round(duration_ns)
        if len(self.listed_gaps) < LISTED_GAPS:
            self.listed_gaps.append((start_ns / SECOND, duration_ns / SECOND))


def summarize(facts: Facts, options: TimelineOptions, motion: MotionSummary,
              held_back: int) -> TimelineSummary:
    """
    Tell what was seen.

    Parameters
    ----------
    facts, options, motion
        State, options and cut spans of a timeline.
    held_back : int
        Messages that came but are not decided on.

    Returns
    -------
    TimelineSummary
        Of all that is decided on.

    """
    measured = facts.paced_steps / facts.paced_ns * SECOND if facts.paced_ns > 0 else None
    rate = options.rate_hz or measured
    last_sample_s = 1 / rate if rate and facts.samples else 0.0
    start = None
    if facts.first_ns is not None and not facts.counted_only:
        boot_clock = facts.first_ns < _EPOCH_CLOCK_NS
        start = iso_time(max(facts.first_ns, facts.first_receive_ns) if boot_clock
                         else facts.first_ns)
    jitter = None
    if facts.jitter is not None and facts.interval_ns is not None and not facts.counted_only:
        jitter = facts.jitter * facts.interval_ns / SECOND
    return TimelineSummary(
        timeline=Timeline(
            sample_rate_hz=rate, samples=facts.samples,
            duration_s=facts.elapsed_ns / SECOND + last_sample_s,
            missing=facts.missing, duplicates=facts.duplicates,
            out_of_order=facts.out_of_order, rejected=facts.rejected,
            gaps=tuple(Span(*gap) for gap in facts.listed_gaps),
            motion=tuple(Span(*span) for span in motion.spans)),
        clock=None if facts.counted_only else facts.clock,
        frame_id=facts.frame_id,
        start_time=start,
        remarks=tuple(Remark(code, text)
                      for code, text in _remarks(facts, options, motion).items()),
        present=tuple(facts.present or [True] * 6),
        messages=facts.messages + held_back,
        bridged=facts.bridged,
        gaps=facts.gaps, gaps_s=facts.gaps_ns / SECOND,
        measured_rate_hz=None if facts.counted_only else measured,
        jitter_s=jitter,
        header_repeats=facts.header_repeats, header_backward=facts.header_backward,
        receive_repeats=facts.receive_repeats, receive_backward=facts.receive_backward,
        clock_jumps=facts.clock_jumps, at_other_rate=facts.at_other_rate,
        motions=motion.count, excluded_s=motion.excluded_s, moving=motion.moving,
        mostly_motion=_mostly_motion(motion))


def _mostly_motion(motion: MotionSummary) -> bool:
    # Margins cut most of a few seconds about a single knock: that is no moving recording.
    return motion.seen > 0 and (motion.excluded == motion.seen or (
        motion.excluded_s > _LONG_MOTION_S
        and motion.excluded > _MOSTLY * motion.seen
        and motion.struck > 0.5 * _MOSTLY * motion.seen))


def _remarks(facts: Facts, options: TimelineOptions, motion: MotionSummary) -> dict[str, str]:
    remarks = dict(facts.remarks)
    if facts.clock_jumps:
        remarks['clock_jumps'] = (
            f'the {facts.clock} clock jumped {_times(facts.clock_jumps)}: no difference is taken '
            'across a jump')
    if facts.counting:
        remarks['uneven_stamps'] = (
            f'{facts.clock} stamps come too unevenly to see a single missing sample: messages '
            'are counted, and only lasting gaps are seen')
    if facts.gaps > len(facts.listed_gaps):
        remarks['gaps_not_listed'] = (
            f'{facts.gaps} gaps of {facts.gaps_ns / SECOND:.6g} s in all; only the first '
            f'{len(facts.listed_gaps)} are listed')
    places = facts.samples + facts.bridged
    if facts.bridged > _MANY_MISSING * places:
        remarks['many_missing'] = (
            f'{facts.bridged / places:.1%} of the samples are missing and bridged by the local '
            'mean: record with a deeper queue or with reliable delivery')
    if facts.at_other_rate:
        stay = facts.at_other_rate < facts.samples
        remarks['rate_changed'] = (
            f'the sample rate changed from {SECOND / (facts.interval_ns or 1.0):.4g} to '
            f'{facts.changed_rate_hz:.4g} Hz at {facts.rate_changed_s:.6g} s: the '
            f'{facts.at_other_rate} samples at another rate than the first are left out; analyze '
            f'{"them" if stay else "them, the larger part,"} by themselves with --start and '
            '--duration')
    if facts.other_frames:
        others = ', '.join(f'{name!r} ({count} messages)'
                           for name, count in facts.other_frames.items())
        remarks['several_frames'] = (
            f'several publishers on one topic: messages of frame_id {facts.frame_id!r} are used, '
            f'those of {others} rejected')
    if facts.gravity_samples:
        size = float(np.linalg.norm(facts.gravity)) / facts.gravity_samples
        if abs(size - _GRAVITY) > _GRAVITY_TOLERANCE:
            hint = ('; is it in units of g?' if abs(size - 1) < 0.05
                    else '; has gravity been removed?' if size < 0.5 else '')
            remarks['gravity'] = (
                f'the mean acceleration is {size:.4g} m/s^2, not about 9.81{hint}')
    if options.motion == 'exclude':
        remarks |= _motion_remarks(motion)
    return remarks


def _motion_remarks(motion: MotionSummary) -> dict[str, str]:
    remarks = {}
    if _mostly_motion(motion):
        remarks['mostly_motion'] = (
            f'{motion.excluded / motion.seen:.0%} of the samples are motion: record while the '
            'sensor stands still')
    elif motion.count:
        remarks['motion'] = (
            f'motion or knocks were cut out {_times(motion.count)}, {motion.excluded_s:.6g} s '
            'in all')
    if motion.count > len(motion.spans):
        remarks['motion_not_listed'] = (
            f'only the first {len(motion.spans)} spans of motion are listed')
    if motion.changes:
        text = ', '.join(f'{ratio:.3g} times at about {time_s:.5g} s'
                         for time_s, ratio in motion.changes)
        remarks['noise_level_changed'] = (
            f'the noise changed for good: {text}; the curve mixes both levels, analyze them '
            'apart with --start and --duration')
    return remarks


def _times(count: int) -> str:
    return 'once' if count == 1 else f'{count} times'
