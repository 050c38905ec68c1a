# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the node logs by itself: every change of state once, and progress from time to time.

Each `see_` method receives the current state and compares it with the previous one.
"""

from collections.abc import Iterable, Sequence

from imu_allan.finding import Finding
from imu_allan.finding_messages import for_display, message_of, title_of
from imu_allan.node.diagnostics import (
    Condition,
    observable_axes,
    reception_conditions,
    SILENT_S,
    timeline_conditions,
    waiting_for,
    WARN,
)
from imu_allan.node.facts import Facts
from imu_allan.node.log import Log
from imu_allan.result import Result, Timeline
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import counted, duration, measured, spoken

REPEAT_S = 30.0
"""Shortest time between repeated warnings about a condition that comes and goes."""


class LogOfChanges:
    """Compares the current state with the previous one, and logs what has changed."""

    def __init__(self, log: Log, topic: str) -> None:
        self._log = log
        self._topic = topic
        # Names of the conditions that are present, by where they are seen.
        self._present: dict[str, set[str]] = {'reception': set()}
        # Names of those whose beginning was reported, each with the text for its end.
        self._reported: dict[str, str] = {}
        self._overrun = False
        self._silence = ''
        self._levels: dict[str, str] = {}
        self.begin_run()

    def begin_run(self) -> None:
        """Forget what was reported about the previous run."""
        # When the first samples of the run were reported.
        self.began: float | None = None
        # Time of the last progress line, since then.
        self._progress_s = 0.0
        self._present = {'reception': self._present['reception']}
        self._reported = {name: over for name, over in self._reported.items()
                          if name in self._present['reception']}
        self._observable: set[tuple[str, str]] = set()

    def see_reception(self, facts: Facts) -> None:
        """Report publishers that appear or leave, lost messages, and silence."""
        self._overrun = facts.recent['overrun'] > 0
        self._see('reception', reception_conditions(facts))
        why = facts.silence_why
        if why is None:
            self._silence = ''
        elif why != self._silence and self._log.warning(
                f'no message on {self._topic} for {facts.silent_s:.0f} s{why}',
                f'silence {self._topic}'):
            self._silence = why

    def _see(self, where: str, conditions: Iterable[Condition]) -> None:
        """Report conditions that begin, and the end of those whose beginning was reported."""
        seen = {one.name: one for one in conditions if one.present and one.over is not None}
        self._present[where] = {*seen}
        present = set().union(*self._present.values())
        for name in [name for name in self._reported if name not in present]:
            if over := self._reported.pop(name):
                self._log.info(over)
        for name, one in seen.items():
            if name in self._reported or self._log.warning(
                    one.message, f'{name} {self._topic}', REPEAT_S):
                self._reported[name] = one.over or ''

    def see_timeline(self, now: float, facts: Facts, summary: TimelineSummary) -> None:
        """Report the first sample, faults of the clock and the samples, and motion."""
        timeline = summary.timeline
        if timeline.samples and self.began is None:
            self.began = now
            frame = f'frame_id {summary.frame_id!r}, ' if summary.frame_id else ''
            rate = f'{timeline.sample_rate_hz:.4g} Hz, ' if timeline.sample_rate_hz else ''
            self._log.info(f'first samples on {self._topic}: {frame}{rate}'
                           f'{summary.clock or "no"} stamps')
        self._see_findings('findings', for_display(summary.remarks))
        self._see('timeline', timeline_conditions(facts, summary))

    def see_result(self, result: Result) -> None:
        """Report coefficients that become observable or cease to be, and new findings."""
        changed: dict[tuple[bool, str], list[str]] = {}
        for name, axis in result.axes.items():
            for key, found in axis.coefficients.items():
                if found.observable == ((name, key) in self._observable):
                    continue
                self._observable ^= {(name, key)}
                if found.value is not None and found.ci95 is not None:
                    value, low, high = measured(found.value, *found.ci95)
                    figures = f' {value} ({low} .. {high})'
                else:
                    figures = '' if found.upper95 is None else f' (below {found.upper95:.2g})'
                changed.setdefault((found.observable, f'{key.replace("_", " ")} ({found.unit})'),
                                   []).append(f'{spoken(name)}{figures}')
        for (observable, what), axes in sorted(changed.items(), key=lambda item: not item[0][0]):
            if observable:
                self._log.info(f'observable: {what} of {"; ".join(axes)}')
            else:
                self._log.warning(f'no longer observable: {what} of {"; ".join(axes)}: the longer '
                                  'record is explained as well without it', f'gone {what}')
        self._see_findings('result', result.warnings)

    def see_comparisons(self, facts: Facts) -> None:
        """Report each standard whose verdict has changed."""
        for found in facts.comparisons:
            if self._levels.get(found.standard) == found.level:
                continue
            self._levels[found.standard] = found.level
            text = f'{found.standard}: {found.message}'
            if found.level == 'ok':
                self._log.info(text)
            else:
                say = self._log.error if found.level == 'error' else self._log.warning
                say(text, f'{found.standard} {found.level}', REPEAT_S)

    def see_progress(self, now: float, facts: Facts, result: Result | None) -> None:
        """Report the progress of the run, every minute at first and every hour later."""
        # As often as a waiting user looks, who tends to watch the first ten minutes; after that a
        # night adds about ten lines.
        pause_s = 60.0 if self._progress_s < 600.0 else 3600.0
        if (self.began is None or now - self.began < self._progress_s + pause_s or result is None
                or not result.axes):
            return
        self._progress_s = now - self.began
        self._log.info(progress_line(result, facts.timeline or result.timeline,
                                     comes=facts.silent_s < SILENT_S))

    def _see_findings(self, where: str, findings: Sequence[Finding]) -> None:
        """Report new findings, and those that few samples showed by chance and more do not."""
        # Progress lines, or conditions of their own, report these.
        elsewhere = {'short_recording', 'motion', 'mostly_motion', 'unknown_rate', 'clock_jumps'}
        # While the queue overruns, any other fault of the samples may be caused by that.
        self._see(where, [Condition(found.code, True, WARN, message_of(found, live=True),
                                    f'no longer found: {title_of(found)}')
                          for found in findings if found.code not in elsewhere
                          and (not self._overrun or found.code in self._reported)])


def progress_line(result: Result, timeline: Timeline, *, comes: bool = True) -> str:
    """Describe the samples, what is observable and, while messages come, what is expected next."""
    rate = f' at {timeline.sample_rate_hz:.4g} Hz' if timeline.sample_rate_hz else ''
    used = f', {duration(timeline.rest_s)} of it at rest' if timeline.motion else ''
    shown = [f'{key.replace("_", " ")} of {count}'
             for key, count in observable_axes(result).items() if count]
    text = (f'{counted(timeline.samples, "sample")}{rate} in {duration(timeline.duration_s)}'
            f'{used}; observable of {counted(len(result.axes), "axis", "axes")}: '
            f'{", ".join(shown) or "nothing yet"}')
    following = waiting_for(result)
    if following is None or not comes:
        return text
    seconds, axis, key = following
    return (f'{text}; next: {key.replace("_", " ")} of {spoken(axis)} in about '
            f'{duration(seconds)}')
