# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the node knows of its topics and itself, and what of it needs attention: ``/diagnostics``.

The log reports the same conditions when they begin and when they end.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import time
from typing import NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from imu_allan.block import Half
from imu_allan.finding_messages import for_display, message_of
from imu_allan.node.output_topics import key_values, remark_values
from imu_allan.node.standards import Comparison
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result, Timeline
from imu_allan.timeline import TimelineSummary
from imu_allan.timeline.memory import RATE_TOLERANCE
from imu_allan.wording import counted, duration, listed, spoken

RECENT_S = 30.0
"""Window of recent counts: a user who looks twice a minute sees every event. Totals keep all."""
_PASSED = frozenset({'clock_jumps', 'field_absent', 'frozen', 'motion', 'rest_within_motion',
                     'several_frames', 'spikes'})
"""Codes of findings whose cause may be over; the counts show whether it persists."""

SILENT_S = 2.0
"""After this long without a message, reception has stopped and no waiting times are predicted."""

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
Status = tuple[bytes, str, Mapping[str, object]]
"""Level, message and values."""


class Recent:
    """Increase of counts within the last `RECENT_S`."""

    def __init__(self) -> None:
        self._seen: dict[str, list[tuple[float, int]]] = {}

    def see(self, now: float, totals: Mapping[str, int], *, known: bool = False) -> None:
        """Record totals; first totals that are `known` are not recent, and a drop restarts."""
        for name, total in totals.items():
            seen = self._seen.setdefault(name, [(now, total if known else 0)])
            if total < seen[-1][1]:
                seen[:] = [(now, 0)]
            if total > seen[-1][1]:
                seen.append((now, total))
            # The first entry is the total at the beginning of the window.
            while len(seen) > 1 and now - seen[1][0] > RECENT_S:
                seen.pop(0)

    def __getitem__(self, name: str) -> int:
        """Return the recent increase of one count."""
        seen = self._seen.get(name)
        return seen[-1][1] - seen[0][1] if seen else 0


@dataclass
class Facts:
    """
    Counts and conditions of one topic of an IMU, for ``/diagnostics``.

    The facts of the first topic also hold what concerns the whole node.
    """

    topic: str
    queue: int
    expected_rate: float  # Hz; 0 if unknown
    half: Half | None = None  # the sensor on the topic, if it carries only one
    received: int = 0
    lost: int = 0
    malformed: int = 0
    skipped: int = 0  # passed over while paused
    malformed_why: str = ''
    overrun: int = 0  # how often the queue was full when it was emptied
    recent: Recent = field(default_factory=Recent)
    mixed: bool = False  # messages of two publishers are being passed over
    mixed_samples: int = 0  # passed over because publishers were mixed
    elsewhere: bool = False  # messages go to the run of another IMU, which may replace this one
    looping: bool = False  # earlier messages are repeated, as by a recording played in a loop
    publishers: int = 0
    publisher_names: Sequence[str] = ()  # if there are several
    refused: list[str] = field(default_factory=list)  # why publishers are not matched
    silent_s: float = 0.0  # since the last message, or since the wait for the first one began
    silence_why: str = ''  # how the log explains it; empty before it is worth a line
    received_hz: float = 0.0  # recent
    cpu_s: float | None = None  # recent CPU time of the whole process per message
    longest_hold_s: float = 0.0  # longest time between two calls of `take`, since the last report
    paused: bool = False
    on_probation: bool = False  # messages are held back until they show which IMU they are from
    fit_s: float | None = None
    update_error: str = ''  # why the latest samples cannot be used
    errors: Mapping[str, str] = field(default_factory=dict)  # those of the `Worker`
    state_file: str = ''  # empty if none is kept
    checkpointed_at: float | None = None  # by the monotonic clock
    resumed: str = ''  # what became of the state file at the start
    timeline: Timeline | None = None  # at the last look
    temperature_topic: str = ''
    temperature_c: float | None = None
    temperature_at: float | None = None  # of the last reading, by the monotonic clock
    comparisons: list[Comparison] = field(default_factory=list)


class Condition(NamedTuple):
    """A condition that may need attention; it is reported only while it is present."""

    name: str
    present: bool
    level: bytes
    message: str
    over: str | None = None
    """Text to log when the condition ends; none if empty. If None, the log omits the condition."""


def diagnostics_message(node_name: str, stamp: Time,
                        topics: Sequence[tuple[Facts, TimelineSummary]], result: Result | None
                        ) -> DiagnosticArray:
    """Return all statuses of the node."""
    array = DiagnosticArray()
    array.header.stamp = stamp

    def add(name: str, topic: str, level: bytes, message: str, values: Mapping[str, object]
            ) -> None:
        array.status.append(DiagnosticStatus(
            level=level, name=f'{node_name}: {name}', message=message, hardware_id=topic,
            values=key_values(values)))

    for facts, summary in topics:
        which = f' {facts.half}' if facts.half else ''
        add(f'reception{which}', facts.topic, *_reception(facts))
        add(f'timeline{which}', facts.topic, *_timeline(facts, summary))
    facts, both = topics[0][0], ', '.join(facts.topic for facts, _ in topics)
    add('estimation', both, *_estimation(facts, result))
    add('storage', both, *_storage(facts))
    for one in facts.comparisons:
        add(one.standard, both, {'ok': OK, 'warn': WARN, 'error': ERROR}[one.level], one.message,
            {})
    return array


def waiting_for(result: Result) -> tuple[float, str, str] | None:
    """Return seconds, axis and term of the coefficient that should become observable next."""
    return min(((coefficient.observable_in_s, name, key)
                for name, axis in result.axes.items()
                for key, coefficient in axis.coefficients.items()
                if not coefficient.observable and coefficient.observable_in_s is not None),
               default=None)


def observable_axes(result: Result) -> dict[str, int]:
    """Return on how many axes each term is observable."""
    return {key: sum(axis.coefficients[key].observable for axis in result.axes.values())
            for key in TERMS}


def _worst(conditions: Sequence[Condition], otherwise: str) -> tuple[bytes, str]:
    return next(((condition.level, condition.message) for condition in conditions
                 if condition.present), (OK, otherwise))


def reception_conditions(facts: Facts) -> list[Condition]:
    """Return what may be wrong with the messages on a topic, the worst first."""
    topic, recent = facts.topic, facts.recent
    lately = f'in the last {RECENT_S:.0f} s'
    return [
        Condition('mixed', facts.mixed, ERROR,
                  f'messages on {topic} are passed over: they are of another publisher than the '
                  'run, or too few to tell',
                  f'no message on {topic} is passed over any more; call ~/reset if it is another '
                  'IMU'),
        Condition('unpublished', not facts.publishers, ERROR,
                  '; '.join(facts.refused) or f'nothing publishes {topic}'),
        Condition('silent', facts.silent_s > SILENT_S, ERROR,
                  f'no message for {facts.silent_s:.0f} s'),
        Condition('publishers', facts.publishers > 1, WARN,
                  f'{facts.publishers} publishers on {topic} ({listed(facts.publisher_names)}): '
                  'where their samples mix they are passed over; give every IMU a topic of its '
                  'own', f'one publisher is left on {topic}'),
        Condition('looping', facts.looping, WARN,
                  f'the messages on {topic} repeat from the first one on, as a recording played '
                  'in a loop does: what has come before is passed over',
                  f'the messages on {topic} are new again'),
        Condition('malformed', recent['malformed'] > 0, WARN,
                  f'{counted(recent["malformed"], "message")} on {topic} could not be decoded '
                  f'{lately}: {facts.malformed_why}',
                  f'every message on {topic} can be decoded again; '
                  f'{counted(facts.malformed, "message")} could not be in all'),
        Condition('lost', recent['lost'] > 0, WARN,
                  f'{counted(recent["lost"], "message")} on {topic} lost {lately}: ask for '
                  'reliable delivery and a queue for 2.5 s of messages, with qos_overrides',
                  f'no message on {topic} is lost any more; {_were(facts.lost)} in all'),
        Condition('paused', facts.paused, WARN, 'paused: samples are passed over')]


def _were(count: int) -> str:
    return f'{count:,} {"was" if count == 1 else "were"}'


def _reception(facts: Facts) -> Status:
    values = {'received': facts.received, 'lost': facts.lost, 'malformed': facts.malformed,
              'passed_over': facts.skipped, 'mixed': facts.mixed_samples,
              'publishers': facts.publishers,
              'rate_hz': facts.received_hz, 'cpu_per_message_s': facts.cpu_s,
              'longest_hold_s': facts.longest_hold_s, 'queue': facts.queue,
              'paused': facts.paused, 'temperature_topic': facts.temperature_topic or None,
              'temperature_c': facts.temperature_c,
              'temperature_age_s': _age_s(facts.temperature_at)}
    return *_worst(reception_conditions(facts),
                   f'receiving {facts.received_hz:.4g} messages per second'), values


def timeline_conditions(facts: Facts, summary: TimelineSummary) -> list[Condition]:
    """Return what may be wrong with the samples and their stamps, the worst first."""
    rate, expected = _rate(summary) or 0.0, facts.expected_rate
    remarks = [(remark.code, message_of(remark, live=True))
               for remark in for_display(summary.remarks)]
    lasting = [message for code, message in remarks if code not in _PASSED]
    faults = [f'{counted(count, what)}{why}' for key, what, why in (
        ('missing', 'sample', ' missing'), ('duplicates', 'duplicate', ''),
        ('out_of_order', 'message', ' out of order'), ('rejected', 'message', ' rejected'),
        ('clock_jumps', 'jump', ' of the clock')) if (count := facts.recent[key])]
    # These findings already say which messages are rejected.
    rejected = 0 if {code for code, _ in remarks} & {
        'several_frames', 'several_publishers', 'rate_changed'} else facts.recent['unusable']
    return [
        Condition('useless', bool(facts.update_error), ERROR, facts.update_error),
        Condition('elsewhere', facts.elsewhere, WARN,
                  'the messages are of another IMU: if they go on, or by ~/reset, a new run begins'
                  ),
        Condition('moving', summary.motion.moving, WARN,
                  'the IMU moves: what it measures meanwhile is left out',
                  'the IMU is at rest again'),
        Condition('mostly_motion', summary.mostly_motion, WARN,
                  'the IMU was moving most of the time: let it rest'),
        Condition('expected_rate',
                  bool(expected and rate) and abs(rate / expected - 1) > RATE_TOLERANCE, WARN,
                  f'measured {rate:.5g} Hz, expected {expected:g} Hz; check expected_rate, or the '
                  'setting of the driver', 'the rate is the expected one again'),
        Condition('remarks', bool(lasting), WARN, '; '.join(lasting)),
        # The end of a longer gap is what shows how many samples are missing.
        Condition('faults', bool(faults), WARN, '; '.join([
            f'found in the last {RECENT_S:.0f} s: {", ".join(faults)}',
            *(message for _, message in remarks)])),
        Condition('jumped', facts.recent['clock_jumps'] > 0, WARN,
                  f'the {summary.clock} stamps jumped: no difference is taken across a jump', ''),
        Condition('rejected', rejected > 0, WARN,
                  f'{counted(rejected, "message")} rejected: NaN, infinite or declared '
                  'absent',
                  f'no message is rejected any more; {_were(unusable(summary))} in all'),
        Condition('probation', facts.on_probation, OK,
                  'looking whether the messages are of the IMU of the run')]


def _rate(summary: TimelineSummary) -> float | None:
    return summary.measured_rate_hz or summary.timeline.sample_rate_hz


def timeline_counts(summary: TimelineSummary) -> dict[str, int]:
    """Return the totals of faults whose increase is a warning."""
    return {**{key: getattr(summary.timeline, key)
               for key in ('missing', 'duplicates', 'out_of_order', 'rejected')},
            'unusable': unusable(summary), 'clock_jumps': summary.counts.clock_jumps}


def unusable(summary: TimelineSummary) -> int:
    """Return the number of rejected messages, without those that a finding counts."""
    return summary.timeline.rejected - sum(
        int(remark.values['messages']) for remark in summary.remarks
        if remark.code in ('spikes', 'frozen'))


def _timeline(facts: Facts, summary: TimelineSummary) -> Status:
    timeline, counts, motion = summary.timeline, summary.counts, summary.motion
    rate = _rate(summary)
    otherwise = ('no samples yet' if not timeline.samples else
                 counted(timeline.samples, 'sample') + (f' at {rate:.5g} Hz' if rate else ''))
    return *_worst(timeline_conditions(facts, summary), otherwise), {
        'rate_hz': summary.measured_rate_hz, 'jitter_s': summary.jitter_s, 'clock': summary.clock,
        'frame_id': summary.frame_id, 'samples': counts.samples, 'duration_s': timeline.duration_s,
        'missing': counts.missing, 'interpolated': counts.interpolated, 'gaps': counts.gaps,
        'longest_gap_s': counts.longest_gap_ns / 1e9, 'duplicates': counts.duplicates,
        'out_of_order': counts.out_of_order, 'rejected': counts.rejected,
        'clock_jumps': counts.clock_jumps, 'header_repeats': counts.header.repeats,
        'moving': motion.moving, 'header_backward': counts.header.backward,
        'motion_excluded_s': motion.cut.total_s, 'rest_s': timeline.rest_s,
        'expected_rate_hz': facts.expected_rate or None}


def _estimation(facts: Facts, result: Result | None) -> Status:
    values: dict[str, object] = {'fit_duration_s': facts.fit_s}
    level, message = OK, 'no result yet'
    if result is not None:
        observable = observable_axes(result)
        values |= {'fitted_duration_s': result.timeline.duration_s,
                   **{f'observable/{key}': count for key, count in observable.items()},
                   **remark_values(result.warnings)}
        following = waiting_for(result) if facts.silent_s <= SILENT_S else None
        hidden = len(TERMS) * len(result.axes) - sum(observable.values())
        bad = [message_of(remark, live=True) for remark in result.warnings
               if remark.severity == 'act' and remark.code not in _PASSED]
        if following is not None:
            seconds, axis, key = following
            values |= {'next_observable': f'{axis} {key}', 'next_observable_in_s': seconds}
            message = (f'{spoken(key)} of {spoken(axis)} expected to be observable in '
                       f'{duration(seconds)}')
        elif result.axes:
            message = (f'{hidden} coefficients are below what this data can show' if hidden
                       else 'all coefficients are observable')
        if result.axes and bad:
            level, message = WARN, '; '.join(bad)
    if error := facts.errors.get('fit'):
        level, message = ERROR, error
    return level, message, values


def _storage(facts: Facts) -> Status:
    errors = [error for kind in ('checkpoint', 'aside', 'save', 'output_dir')
              if (error := facts.errors.get(kind))]
    message = (facts.resumed or 'a new run' if facts.state_file else
               'no state file: a crash or a reboot begins a new run')
    return ERROR if errors else OK, errors[0] if errors else message, {
        'state_file': facts.state_file or None,
        'checkpoint_age_s': _age_s(facts.checkpointed_at)}


def _age_s(at: float | None) -> float | None:
    return None if at is None else time.monotonic() - at
