# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What ``/diagnostics`` says, in one module because all of its statuses read the same facts.

Is everything well with the samples, the fit and the files?
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from imu_allan.node.result_messages import as_text, remark_values
from imu_allan.node.sequential import rest_s
from imu_allan.node.standards import Finding
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result
from imu_allan.timeline import TimelineSummary
from imu_allan.timeline.options import RATE_TOLERANCE
from imu_allan.wording import counted, duration, spoken
from imu_allan.writers.words import message_of, presented

_PASSED = frozenset({'axis_absent_in_part', 'axis_late_start', 'clock_jumps', 'field_absent',
                     'frozen', 'gaps_not_listed', 'late_start', 'motion', 'motion_not_listed',
                     'rest_within_motion', 'several_frames', 'spikes'})
"""Codes of remarks that tell of what may be over: counts say whether it goes on."""

RECENT_S = 30.0
"""Somebody who looks twice a minute sees what happened; what is longer ago is a total."""
SILENT_S = 2.0
"""Without a message for so long nothing comes, and nothing is expected of time."""
_LATELY = f'in the last {RECENT_S:.0f} s'

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
Verdict = tuple[bytes, str]
_LEVELS = {'ok': OK, 'warn': WARN, 'error': ERROR}


class Recent:
    """Growth of counts within the last `RECENT_S`."""

    def __init__(self) -> None:
        self._seen: dict[str, list[tuple[float, int]]] = {}

    def see(self, now: float, totals: Mapping[str, int], *, known: bool = False) -> None:
        """Note the totals; those of a resumed run are `known`, one that falls begins anew."""
        for name, total in totals.items():
            seen = self._seen.setdefault(name, [(now, total if known else 0)])
            if total < seen[-1][1]:
                seen[:] = [(now, 0)]
            if total > seen[-1][1]:
                seen.append((now, total))
            # The first entry is what had been counted when the window began.
            while len(seen) > 1 and now - seen[1][0] > RECENT_S:
                seen.pop(0)

    def __getitem__(self, name: str) -> int:
        """Growth of one count."""
        seen = self._seen.get(name)
        return seen[-1][1] - seen[0][1] if seen else 0


@dataclass
class Facts:
    """
    What the node counts and remembers for ``/diagnostics``, of each topic of an IMU.

    What concerns the whole node stands in those of the first topic.
    """

    topic: str
    queue: int
    expected_rate: float  # Hz; 0 where it is unknown
    state_file: str  # empty where none is kept
    half: str | None = None  # the sensor that comes on the topic, where it is one alone
    received: int = 0
    lost: int = 0
    malformed: int = 0
    skipped: int = 0  # passed over in a pause
    malformed_why: str = ''
    overrun: int = 0  # how often the queue was full when it was emptied
    recent: Recent = field(default_factory=Recent)
    mixed: bool = False  # messages of two publishers are passed over now
    mixed_samples: int = 0  # passed over for that
    looping: bool = False  # the messages have come before, as of a recording in a loop
    publishers: int = 0
    refused: list[str] = field(default_factory=list)  # why publishers are not matched
    namesakes: int = 0  # other nodes of the same name
    silent_s: float = 0.0  # since the last message, or since the first is waited for
    pause_s: float = 0.0  # the longest before a message came, since the last report
    restarts: int = 0  # how often the numbers of the messages have begun anew
    received_hz: float = 0.0  # lately
    cpu_s: float | None = None  # of the whole process for each message, lately
    longest_hold_s: float = 0.0  # between two takings, since the last report
    paused: bool = False
    on_probation: bool = False  # messages are held until they show whose they are
    fit_s: float | None = None
    fit_error: str = ''  # as all of these: of the last attempt, empty where it did not fail
    update_error: str = ''  # why the latest samples are of no use
    save_error: str = ''
    checkpoint_error: str = ''
    output_error: str = ''  # of trying the output folder
    checkpoint_age_s: float | None = None
    resumed: str = ''  # what became of the state file at the start
    moved_s: float = 0.0  # left out as motion
    temperature_topic: str = ''
    thermometers: int = 0
    temperature_c: float | None = None
    temperature_missing: bool = False  # nothing has published it for a while
    temperature_silent_s: float = 0.0  # where longer than the thermometer has ever taken
    findings: list[Finding] = field(default_factory=list)


def diagnostics_message(node_name: str, stamp: Time,
                        topics: Sequence[tuple[Facts, TimelineSummary]], result: Result | None
                        ) -> DiagnosticArray:
    """All statuses of the node."""
    array = DiagnosticArray()
    array.header.stamp = stamp
    parts: list[tuple[str, str, Verdict, Mapping[str, object]]] = []
    for facts, summary in topics:
        which = f' {facts.half}' if facts.half else ''
        parts += [(f'reception{which}', facts.topic, _reception_verdict(facts),
                   _reception_values(facts)),
                  (f'timeline{which}', facts.topic, _timeline_verdict(facts, summary),
                   _timeline_values(facts, summary))]
    facts, both = topics[0][0], ', '.join(facts.topic for facts, _ in topics)
    parts += [('estimation', both, _estimation_verdict(facts, result),
               _estimation_values(facts, result)),
              ('storage', both, _storage_verdict(facts), _storage_values(facts))]
    parts += [(finding.standard, both, (_LEVELS[finding.level], finding.message), {})
              for finding in facts.findings]
    for name, topic, (level, message), values in parts:
        array.status.append(DiagnosticStatus(
            level=level, name=f'{node_name}: {name}', message=message, hardware_id=topic,
            values=[KeyValue(key=key, value=as_text(value)) for key, value in values.items()
                    if value is not None]))
    return array


def waiting_for(result: Result) -> tuple[str, str, float] | None:
    """Axis, term and seconds of the coefficient that is expected to become observable next."""
    waits = [(coefficient.observable_in_s, name, key)
             for name, axis in result.axes.items()
             for key, coefficient in axis.coefficients.items()
             if not coefficient.observable and coefficient.observable_in_s is not None]
    if not waits:
        return None
    seconds, name, key = min(waits)
    return name, key, seconds


def _reception_verdict(facts: Facts) -> Verdict:
    if facts.namesakes:
        return ERROR, 'another node has the same name: start one of them with another name'
    if facts.mixed:
        return ERROR, (f'messages of more than one publisher on {facts.topic}: '
                       'they are passed over')
    if not facts.publishers:
        return ERROR, '; '.join(facts.refused) or f'nothing publishes {facts.topic}'
    if facts.silent_s > SILENT_S:
        return ERROR, f'no message for {facts.silent_s:.0f} s'
    if facts.publishers > 1:
        return WARN, (f'{facts.publishers} publishers on {facts.topic}: where their samples mix '
                      'they are passed over')
    if facts.looping:
        return WARN, 'the messages repeat: what has come before is passed over'
    if malformed := facts.recent['malformed']:
        return WARN, (f'{counted(malformed, "message")} could not be decoded {_LATELY}: '
                      f'{facts.malformed_why}')
    if lost := facts.recent['lost']:
        return WARN, f'{counted(lost, "message")} lost {_LATELY}: {cause_of_loss(facts)}'
    if facts.paused:
        return WARN, 'paused: samples are passed over'
    if facts.temperature_topic and not facts.thermometers:
        return WARN, f'nothing publishes {facts.temperature_topic}'
    if facts.temperature_silent_s:
        return WARN, f'no temperature for {facts.temperature_silent_s:.0f} s'
    return OK, f'receiving {facts.received_hz:.4g} messages per second'


def cause_of_loss(facts: Facts) -> str:
    """Say where messages were lost, and what helps."""
    if facts.recent['overrun']:
        return (f'the queue of {counted(facts.queue, "message")} is too short for what comes '
                f'between two looks; leave qos_overrides.{facts.topic}.subscription.depth out, '
                'or set it to 2.5 s of messages')
    return ('on the way, between publisher and node; ask for reliable delivery with '
            'qos_overrides')


def _reception_values(facts: Facts) -> Mapping[str, object]:
    return {'received': facts.received, 'lost': facts.lost, 'malformed': facts.malformed,
            'passed_over': facts.skipped, 'mixed': facts.mixed_samples,
            'publishers': facts.publishers,
            'rate_hz': facts.received_hz, 'cpu_per_message_s': facts.cpu_s,
            'longest_hold_s': facts.longest_hold_s, 'queue': facts.queue,
            'paused': facts.paused, 'temperature_c': facts.temperature_c}


def _timeline_verdict(facts: Facts, summary: TimelineSummary) -> Verdict:
    timeline = summary.timeline
    rate = summary.measured_rate_hz or timeline.sample_rate_hz
    if facts.update_error:
        return ERROR, facts.update_error
    if facts.on_probation:
        return OK, 'looking whether this is the IMU of the state file'
    if summary.moving:
        return WARN, 'the IMU moves: this part is left out'
    if summary.mostly_motion:
        return WARN, 'the IMU was moving most of the time: let it rest'
    wrong = off_rate(facts, summary)
    if wrong:
        return WARN, wrong
    lasting = [message_of(remark, live=True) for remark in presented(summary.remarks)
               if remark.code not in _PASSED]
    if lasting:
        return WARN, '; '.join(lasting)
    faults = [f'{counted(count, what)}{why}' for key, what, why in (
        ('missing', 'sample', ' missing'), ('duplicates', 'duplicate', ''),
        ('out_of_order', 'message', ' out of order'), ('rejected', 'message', ' rejected'),
        ('clock_jumps', 'jump', ' of the clock')) if (count := facts.recent[key])]
    if faults:
        why = [message_of(remark, live=True) for remark in presented(summary.remarks)]
        return WARN, '; '.join([f'{", ".join(faults)} {_LATELY}', *why])
    if not timeline.samples:
        return OK, 'no samples yet'
    return OK, f'{counted(timeline.samples, "sample")} at {rate or 0:.5g} Hz'


def timeline_counts(summary: TimelineSummary) -> dict[str, int]:
    """Give the totals of faults whose growth makes a warning."""
    timeline = summary.timeline
    return {'missing': timeline.missing, 'duplicates': timeline.duplicates,
            'out_of_order': timeline.out_of_order, 'rejected': timeline.rejected,
            'clock_jumps': summary.clock_jumps}


def off_rate(facts: Facts, summary: TimelineSummary) -> str:
    """Say that the measured rate is not the expected one; empty where it is."""
    rate = summary.measured_rate_hz or summary.timeline.sample_rate_hz
    if not facts.expected_rate or not rate:
        return ''
    if abs(rate / facts.expected_rate - 1) <= RATE_TOLERANCE:
        return ''
    return f'measured {rate:.5g} Hz, expected {facts.expected_rate:g} Hz'


def _timeline_values(facts: Facts, summary: TimelineSummary) -> Mapping[str, object]:
    timeline = summary.timeline
    return {'rate_hz': summary.measured_rate_hz, 'jitter_s': summary.jitter_s,
            'clock': summary.clock, 'frame_id': summary.frame_id, 'samples': timeline.samples,
            'duration_s': timeline.duration_s, 'missing': timeline.missing,
            'interpolated': summary.bridged, 'gaps': summary.gaps,
            'longest_gap_s': summary.longest_gap_s,
            'duplicates': timeline.duplicates, 'out_of_order': timeline.out_of_order,
            'rejected': timeline.rejected, 'clock_jumps': summary.clock_jumps,
            'header_repeats': summary.header_repeats, 'moving': summary.moving,
            'header_backward': summary.header_backward,
            'motion_excluded_s': summary.excluded_s,
            'rest_s': rest_s(timeline, summary.excluded_s),
            'expected_rate_hz': facts.expected_rate or None}


def _estimation_verdict(facts: Facts, result: Result | None) -> Verdict:
    if facts.fit_error:
        return ERROR, facts.fit_error
    if result is None or not result.axes:
        return OK, 'no result yet'
    bad = [message_of(remark, live=True) for remark in result.warnings
           if remark.severity == 'act' and remark.code not in _PASSED]
    if bad:
        return WARN, '; '.join(bad)
    following = waiting_for(result)
    if following is None or facts.silent_s > SILENT_S:
        hidden = sum(not coefficient.observable for axis in result.axes.values()
                     for coefficient in axis.coefficients.values())
        return OK, (f'{hidden} coefficients are below what this data can show' if hidden
                    else 'all coefficients are observable')
    axis, key, seconds = following
    return OK, (f'{key.replace("_", " ")} of {spoken(axis)} expected to be observable in '
                f'{duration(seconds)}')


def _estimation_values(facts: Facts, result: Result | None) -> Mapping[str, object]:
    values: dict[str, object] = {'fit_duration_s': facts.fit_s}
    if result is not None:
        values['fitted_duration_s'] = result.timeline.duration_s
        for key in TERMS:
            values[f'observable/{key}'] = sum(axis.coefficients[key].observable
                                              for axis in result.axes.values())
        values |= remark_values(result.warnings)
        following = waiting_for(result)
        if following is not None and facts.silent_s <= SILENT_S:
            axis, key, seconds = following
            values |= {'next_observable': f'{axis} {key}', 'next_observable_in_s': seconds}
    return values


def _storage_verdict(facts: Facts) -> Verdict:
    if facts.checkpoint_error:
        return ERROR, facts.checkpoint_error
    if facts.save_error:
        return ERROR, facts.save_error
    if facts.output_error:
        return ERROR, facts.output_error
    if not facts.state_file:
        return OK, 'no state file: a crash or a reboot begins a new run'
    return OK, facts.resumed or 'a new run'


def _storage_values(facts: Facts) -> Mapping[str, object]:
    return {'state_file': facts.state_file or None, 'checkpoint_age_s': facts.checkpoint_age_s}
