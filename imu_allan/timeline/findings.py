# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What was seen of the messages, in words, in one module as they are told together.

Stamps, losses, gaps, motion: every warning stands here. That of what was counted is given from a
threshold on, beside which it stands; that of a decision, such as the choice of a clock, where
intake.py or stage.py decides it.
"""

from collections.abc import Sequence
from math import log

from imu_allan.result import Remark
from imu_allan.sensor.units import STANDARD_GRAVITY
from imu_allan.timeline.clock import SECOND
from imu_allan.timeline.content import Content
from imu_allan.timeline.counts import Counts
from imu_allan.timeline.decision import AXIS_NAMES, Decision
from imu_allan.timeline.excluded import MotionSummary
from imu_allan.timeline.late_axes import LateAxes
from imu_allan.timeline.options import TimelineOptions
from imu_allan.timeline.presence import Presence
import numpy as np

_GRAVITY_TOLERANCE = 0.5
"""In m/s^2: usual offsets are less, units of g or removed gravity far more. A judgment."""
_MANY_MISSING = 0.05
"""The fit allows for bridges; so many say that the link is bad. A judgment."""
_TOO_MANY_MISSING = 0.51
"""Longer gaps left out, as where 55 % are lost in all: up to there N is right."""
_OFF_BEYOND = 0.25
"""Of 36 axes N was off by 13 % at most with 57.5 % lost, by 19 with 60; more are not bridged."""
_MOSTLY = 0.5
"""Of the samples, in motion, from which on a recording is not one of a sensor at rest."""
_LONG_MOTION_S = 10.0
"""Less than that is a knock with its margins, whatever its share of a short recording."""
_SHORTEST_REST_S = 5.0
"""A stop at a traffic light is longer; a car between two bends is quiet for less."""
_LEAST_CONTRAST = 0.999 * log(3.0) * 2 / 3
"""A third of the noise: what shakes as much where it does not turn is no rest, but a straight."""
_NAMED_RESTS = 5
"""As many as fit on two lines of a terminal."""
_LITTLE_HIDDEN = 0.005
"""Losses up to here move the noise density by less than a tenth of a usual interval."""
_MANY_ABSENT = 0.01
"""Share of the messages; fewer are slips of a driver. A judgment."""
_UNEVEN_RATE = 0.005
"""Moves the noise density by half of it: a tenth of a usual interval."""
_FEWEST_FOR_SPEED = 256
"""Messages, 2.5 s at 100 Hz: in less the lag of the receive stamps hides any difference."""
_OTHER_SPEED = 0.05
"""A crystal is off by millionths; a replay or a simulation by more than this. A judgment."""
_LONGEST_LAG_S = 0.3
"""Receive stamps lag by tenths of a second: over some seconds that is a few percent."""


def remarks_of(counts: Counts, decision: Decision, content: Content, presence: Presence,
               late_axes: LateAxes, options: TimelineOptions, motion: MotionSummary,
               excursions: Sequence[Sequence[float]] = ()) -> tuple[Remark, ...]:
    """
    Word what the user should know about.

    Parameters
    ----------
    counts, decision, content, presence, late_axes, options, motion, excursions
        As `imu_allan.timeline.summary.summarize`.

    Returns
    -------
    tuple of Remark
        Of the recording as a whole, each code once.

    """
    told = (_presence_remarks(counts, decision, presence) | _late_axes(counts, content, late_axes)
            | _remarks(counts, decision, content, options, motion))
    return tuple(Remark(code, text) for code, text in told.items()) + _slow_turns(excursions)


def receive_clock(flaw: str) -> dict[str, str]:
    """Tell why receive stamps are used: the flaw of header stamps, as `judge_clock` words it."""
    return {'receive_clock': f'header stamps are {flaw}: receive stamps are used'}


def even_receive_clock() -> dict[str, str]:
    """Tell that header stamps could be used, but less well."""
    return {'receive_clock': (
        'header stamps come in ticks or batches: receive stamps, which come evenly, are used')}


def clock_changed(flaw: str, since_s: float) -> dict[str, str]:
    """Tell from when on header stamps are given up."""
    return {'clock_changed': (
        f'header stamps are {flaw} from about {since_s:.6g} s on: receive stamps are used from '
        'there')}


def counted_samples(rate_hz: float) -> dict[str, str]:
    """Tell that no stamps are used at all."""
    return {'counted_samples': (
        f'no usable stamps: samples are counted at the stated {rate_hz:g} Hz, and missing ones '
        'cannot be seen')}


def several_publishers() -> dict[str, str]:
    """Tell that messages look as those of two sensors."""
    return {'several_publishers': (
        'the values of neighbouring messages differ in turn, as those of two sensors that publish '
        'with one frame_id do: if so, the rate is twice that of each, and the noise density 29 % '
        'too low if they are alike and off by any factor if not; ros2 topic info --verbose names '
        'the publishers')}


def density_error(counts: Counts, decision: Decision) -> tuple[float, float]:
    """
    Bound what faults of the stamps, as the remarks tell, may have done to noise densities.

    Returns
    -------
    float, float
        Largest shares by which they may be too low, and too high; none of it is chance.

    """
    either = ((_uneven_error(counts) + _short_error(counts, decision)) / 2
              + _bridged_error(counts))
    return either, either + _hidden_error(decision)


def _hidden_error(decision: Decision) -> float:
    hidden = decision.hidden if decision.counting else 0.0
    return hidden / 2 / (1 - hidden) if hidden >= _LITTLE_HIDDEN else 0.0


def _short_error(counts: Counts, decision: Decision) -> float:
    error = decision.rate_error(counts.paced_steps) if decision.counting else 0.0
    return error if error > _LITTLE_HIDDEN else 0.0


def _bridged_error(counts: Counts) -> float:
    many = counts.bridged >= _TOO_MANY_MISSING * (counts.samples + counts.bridged)
    return _OFF_BEYOND if counts.bridged and many else 0.0


def _uneven_error(counts: Counts) -> float:
    if not (counts.lowest_rate_hz and counts.paced_ns and counts.paced_steps):
        return 0.0
    rate = counts.paced_steps / counts.paced_ns * SECOND
    off = max(rate / counts.lowest_rate_hz, counts.highest_rate_hz / rate) - 1
    return off if off >= _UNEVEN_RATE else 0.0


def mostly_motion(motion: MotionSummary) -> bool:
    """Tell whether a recording moves, without a stop to rest that is worth the name."""
    return _moves(motion) and (motion.longest_rest_s < _SHORTEST_REST_S
                               or motion.contrast < _LEAST_CONTRAST)


def _moves(motion: MotionSummary) -> bool:
    # Margins cut most of a few seconds about a single knock: that is no moving recording.
    return motion.seen > 0 and (motion.excluded == motion.seen or (
        motion.excluded_s > _LONG_MOTION_S
        and motion.excluded > _MOSTLY * motion.seen
        and motion.struck > 0.5 * _MOSTLY * motion.seen))


def _remarks(counts: Counts, decision: Decision, content: Content, options: TimelineOptions,
             motion: MotionSummary) -> dict[str, str]:
    remarks = decision.remarks | _content_remarks(counts, content) | _clock_remarks(
        counts, decision)
    if counts.clock_jumps:
        remarks['clock_jumps'] = (
            f'the {decision.clock} clock jumped {_times(counts.clock_jumps)}: no difference is '
            'taken across a jump')
    if decision.counting:
        hidden, error = _hidden_error(decision), _short_error(counts, decision)
        bound = ('' if not hidden else
                 f'; up to {100 * decision.hidden:.1f} % of the samples may be missing unseen, '
                 f'and the noise density then be up to {100 * hidden:.1f} % too high')
        if error:
            bound += f'; the record is short, its rate may be up to {100 * error:.1f} % off'
        seen = ('what was lost on the way is known by the numbers that the publisher gave them, '
                'and of the rest only gaps that last are seen' if decision.numbered else
                'and only gaps that last are seen')
        remarks['uneven_stamps'] = (
            f'{decision.clock} stamps come too unevenly to see a single missing sample: messages '
            f'are counted, {seen}{bound}')
    if counts.gaps > len(counts.listed_gaps):
        remarks['gaps_not_listed'] = (
            f'{counts.gaps} gaps of {counts.gaps_ns / SECOND:.6g} s in all; only the first '
            f'{len(counts.listed_gaps)} are listed')
    places = counts.samples + counts.bridged
    if counts.bridged > _MANY_MISSING * places:
        off = _bridged_error(counts)
        bound = f'; the noise density may be up to {100 * off:.0f} % off' if off else ''
        remarks['many_missing'] = (
            f'{100 * counts.bridged / places:.1f} % of the samples are missing and bridged by the '
            f'local mean: record with a deeper queue or with reliable delivery{bound}')
    if counts.at_other_rate:
        stay = counts.at_other_rate < counts.samples
        used, other = SECOND / (decision.interval_ns or 1.0), counts.changed_rate_hz
        # Time is told from the first sample used: what was cut out before has none.
        change, which = ((f'from {used:.4g} to {other:.4g} Hz at {counts.rate_changed_s:.6g} s',
                          'another rate than the first') if counts.rate_changed_s > 0 else
                         (f'from {other:.4g} to {used:.4g} Hz', 'the first rate'))
        remarks['rate_changed'] = (
            f'the sample rate changed {change}: the {counts.at_other_rate} samples at {which} are '
            f'left out; analyze {"them" if stay else "them, the larger part,"} by themselves with '
            '--start and --duration')
    remarks |= _rate_remarks(counts)
    if counts.other_frames:
        others = ', '.join(f'{name!r} ({count} messages)'
                           for name, count in counts.other_frames.items())
        remarks['several_frames'] = (
            f'several publishers on one topic: messages of frame_id {decision.frame_id!r} are '
            f'used, those of {others} rejected')
    if counts.gravity_samples:
        size = float(np.linalg.norm(counts.gravity)) / counts.gravity_samples
        if abs(size - STANDARD_GRAVITY) > _GRAVITY_TOLERANCE:
            hint = ('; is it in units of g?' if abs(size - 1) < 0.05
                    else '; has gravity been removed?' if size < 0.5 else '')
            remarks['gravity'] = (
                f'the mean acceleration is {size:.4g} m/s^2, not about 9.81{hint}')
    if options.motion == 'exclude':
        return remarks | _motion_remarks(motion)
    return remarks | _kept_motion(motion)


def _rate_remarks(counts: Counts) -> dict[str, str]:
    """Bound the error of a rate that changes too little, or for too short, to be cut out."""
    off = _uneven_error(counts)
    if not off:
        return {}
    rate = counts.paced_steps / counts.paced_ns * SECOND
    low, high = min(counts.lowest_rate_hz, rate), max(counts.highest_rate_hz, rate)
    return {'uneven_rate': (
        f'the sample rate varies between {low:.5g} and {high:.5g} Hz: {rate:.5g} Hz, its mean, is '
        f'used; averaging times may be up to {100 * off:.1f} % off and noise densities half as '
        'much')}


def _presence_remarks(counts: Counts, decision: Decision, presence: Presence) -> dict[str, str]:
    remarks, there = {}, decision.present or [True] * 6
    never = [name for name, gone, was in zip(AXIS_NAMES, decision.not_finite, there, strict=True)
             if gone and not was]
    if never:
        remarks['axis_not_finite'] = f'{", ".join(never)}: NaN or infinite, left out'
    lasting: dict[int, list[str]] = {}
    for name, gone, was in zip(AXIS_NAMES, presence.gone, there, strict=True):
        if gone and was:
            lasting.setdefault(gone, []).append(name)
    if lasting:
        told = '; '.join(f'{", ".join(names)} in {gone} of {counts.messages} messages'
                         for gone, names in lasting.items())
        remarks['axis_absent_in_part'] = (
            f'no values for a while, NaN or declared absent (covariance[0] is -1): {told}; the '
            'record of these axes is shorter by that, the others lose nothing')
    return remarks


def _late_axes(counts: Counts, content: Content, late_axes: LateAxes) -> dict[str, str]:
    late: dict[int, list[str]] = {}
    for name, messages in zip(AXIS_NAMES, late_axes.late, strict=True):
        # Where the whole sensor was dead, that is told in one.
        if messages > content.head:
            late.setdefault(messages, []).append(name)
    if not late:
        return {}
    told = '; '.join(f'{", ".join(names)} for the first {messages} of {counts.messages} messages'
                     for messages, names in late.items())
    return {'axis_late_start': (
        f'one value, of an axis that had not come to life yet: {told}; the record of these axes '
        'begins behind that, the others lose nothing')}


def _content_remarks(counts: Counts, content: Content) -> dict[str, str]:
    remarks = {}
    if content.frozen and content.frozen <= content.head:
        remarks['late_start'] = (
            f'the first {content.head} messages hold one value or none: the sensor had not come '
            'to life yet, they are left out')
    elif content.frozen:
        since = '' if content.frozen_s is None else f', first at {content.frozen_s:.6g} s'
        remarks['frozen'] = (
            f'{content.frozen} messages repeat one value again and again{since}: the sensor or '
            'its driver stood still, they are left out')
    if content.held:
        share = content.repeats / (content.repeats + content.changes)
        remarks['held_values'] = (
            f'{100 * share:.0f} % of the messages repeat the values of the one before: the sensor '
            'is polled faster than it samples; its own rate is used and the repeats are left out')
    if counts.spikes:
        what, they = (('1 single message holds wild values', 'it is') if counts.spikes == 1 else
                      (f'{counts.spikes} single messages hold wild values', 'they are'))
        remarks['spikes'] = (f'{what}, ten times the noise and more: {they} left out; look for '
                             'errors on the bus of the sensor')
    if counts.absent > _MANY_ABSENT * counts.messages:
        remarks['field_absent'] = (
            f'{counts.absent} messages declare angular velocity or linear acceleration as not '
            'provided (covariance[0] is -1), others do not: they are left out')
    return remarks


def _clock_remarks(counts: Counts, decision: Decision) -> dict[str, str]:
    """Compare the speeds of both clocks; a jump of either is no speed."""
    if (decision.clock != 'header' or counts.last_header is None
            or counts.last_receive is None or counts.messages < _FEWEST_FOR_SPEED):
        return {}
    header = (counts.last_header - counts.first_header_ns) / SECOND
    receive = (counts.last_receive - counts.first_receive_ns) / SECOND
    if counts.clock_jumps:
        # What the samples take by the header's rate. Where that is less, samples may be missing.
        header = counts.samples * counts.paced_ns / SECOND / max(counts.paced_steps, 1)
        header = max(header, receive)
    if not (receive > 0 and header > 0) or (
            abs(log(header / receive)) < max(_OTHER_SPEED, _LONGEST_LAG_S / receive)):
        return {}
    return {'clock_speed': (
        f'header stamps run {header / receive:.3g} times as fast as receive stamps, as in a '
        'replay or a simulation; were they wrong, averaging times would be off by that, and the '
        'noise density by its square root: --clock receive uses the other clock')}


def _slow_turns(excursions: Sequence[Sequence[float]]) -> tuple[Remark, ...]:
    """Tell of means that went away and came back."""
    if not excursions:
        return ()
    listed = ', '.join(
        f'{AXIS_NAMES[int(axis)]} by {size:.2g} {"rad/s" if axis < 3 else "m/s^2"} for '
        f'{lasts:.3g} s from {start:.4g} s on'
        for start, lasts, axis, size in excursions[:_NAMED_RESTS])
    return (Remark('slow_motion', (
        f'a mean goes away and comes back, as in a slow turn or tilt: {listed}; bias instability '
        'and random walk of that axis may be nothing else: they are given as upper bounds; '
        'analyze the rest alone with --start and --duration')),)


def _motion_remarks(motion: MotionSummary) -> dict[str, str]:
    remarks = {}
    if mostly_motion(motion):
        remarks['mostly_motion'] = (
            f'{100 * motion.excluded / motion.seen:.0f} % of the samples are motion: record while '
            'the sensor stands still')
    elif _moves(motion):
        listed = ', '.join(f'{lasts:.4g} s at {start:.5g} s'
                           for start, lasts in motion.rests[:_NAMED_RESTS])
        more = len(motion.rests) - _NAMED_RESTS
        remarks['rest_within_motion'] = (
            f'the IMU moves during {100 * motion.excluded / motion.seen:.0f} % of the samples: '
            f'only the {motion.rest_s:.4g} s at rest are used ({listed}'
            f'{f" and {more} more" if more > 0 else ""})')
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


def _kept_motion(motion: MotionSummary) -> dict[str, str]:
    if not motion.count:
        return {}
    start = motion.spans[0][0] if motion.spans else 0.0
    return {'motion_kept': (
        f'motion or knocks were seen {_times(motion.count)}, {motion.excluded_s:.6g} s in all, '
        f'first at {start:.5g} s, and kept as asked: coefficients and bounds describe them as '
        'much as the noise')}


def _times(count: int) -> str:
    return 'once' if count == 1 else f'{count} times'
