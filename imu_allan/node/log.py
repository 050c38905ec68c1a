# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The log of a node on /rosout: one line for each event, repeated ever more rarely.

By itself the node logs every change of state once, and progress from time to time. Each `see_`
method of `LogOfChanges` receives the current state and compares it with the previous one.
"""

from collections.abc import Callable, Iterable, Sequence
import math
import time
import traceback

from imu_allan.errors import printable
from imu_allan.finding import Finding
from imu_allan.finding_messages import for_display, message_of, title_of
from imu_allan.node import diagnostics
from imu_allan.node.diagnostics import Condition, Facts
from imu_allan.node.rclpy_inside import Logger
from imu_allan.result import Result, Timeline
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import counted, duration, measured, spoken

FIRST_INTERVAL_S = 10.0
"""Time between the first two lines of a kind; it doubles up to `LONGEST_INTERVAL_S`."""
LONGEST_INTERVAL_S = 600.0
"""Longest time between lines of a kind; for tracebacks, which are long, also the shortest."""
REPEAT_S = 30.0
"""Shortest time between repeated warnings about a condition that comes and goes."""


class Log:
    """
    A logger that makes every text printable and limits how often lines of one kind appear.

    Lines of a kind repeat at growing intervals, whatever figures they contain, so that a log of
    days stays readable. Lines are of one kind if the reader would react to them in the same way.
    `logger` returns where a line goes at its time.
    """

    def __init__(self, logger: Callable[[], Logger]) -> None:
        self._logger = logger
        self._said: dict[str, tuple[float, float]] = {}

    def info(self, text: str, kind: str = '') -> None:
        """Log a normal event; it is rate-limited only with a `kind`, if users can trigger it."""
        if not kind or self._is_due(kind, FIRST_INTERVAL_S):
            self._logger().info(printable(text))

    def warning(self, text: str, kind: str, every_s: float = FIRST_INTERVAL_S) -> bool:
        """Log what the user should look at; return whether it was logged (see the class)."""
        if due := self._is_due(kind, every_s):
            self._logger().warning(printable(text))
        return due

    def error(self, text: str, kind: str, every_s: float = FIRST_INTERVAL_S) -> None:
        """Log what does not work."""
        if self._is_due(kind, every_s):
            self._logger().error(printable(text))

    def bug(self, error: BaseException, consequence: str) -> None:
        """Log the traceback of an unforeseen error, and what happens next."""
        if self._is_due(f'bug {type(error).__name__} {consequence}', LONGEST_INTERVAL_S):
            trace = ''.join(traceback.format_exception(error))
            self._logger().error(f'{trace}internal error: {consequence}; please report it')

    def _is_due(self, kind: str, every_s: float) -> bool:
        now = time.monotonic()
        said, pause_s = self._said.get(kind, (-math.inf, every_s))
        if now - said < pause_s:
            return False
        # After a long enough silence the intervals start over.
        again = now - said < 2 * max(pause_s, LONGEST_INTERVAL_S)
        self._said[kind] = now, min(2 * pause_s, LONGEST_INTERVAL_S) if again else every_s
        return True


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
        self._see('reception', diagnostics.reception_conditions(facts))
        why = facts.silence_why
        if self._silence and not why:
            self._log.info(f'messages come on {self._topic}')
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
        self._see('timeline', diagnostics.timeline_conditions(facts, summary))

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
                changed.setdefault((found.observable, f'{spoken(key)} ({found.unit})'),
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
                                     comes=facts.silent_s < diagnostics.SILENT_S))

    def _see_findings(self, where: str, findings: Sequence[Finding]) -> None:
        """Report new findings, and those that few samples showed by chance and more do not."""
        # Progress lines, or conditions of their own, report these.
        elsewhere = {'short_recording', 'motion', 'mostly_motion', 'unknown_rate', 'clock_jumps'}
        # While the queue overruns, any other fault of the samples may be caused by that.
        self._see(where, [
            Condition(found.code, True, diagnostics.WARN, message_of(found, live=True),
                      f'no longer found: {title_of(found)}')
            for found in findings if found.code not in elsewhere
            and (not self._overrun or found.code in self._reported)])


def progress_line(result: Result, timeline: Timeline, *, comes: bool = True) -> str:
    """Describe the samples, what is observable and, while messages come, what is expected next."""
    rate = f' at {timeline.sample_rate_hz:.4g} Hz' if timeline.sample_rate_hz else ''
    used = f', {duration(timeline.rest_s)} of it at rest' if timeline.motion else ''
    shown = [f'{spoken(key)} of {count}'
             for key, count in diagnostics.observable_axes(result).items() if count]
    text = (f'{counted(timeline.samples, "sample")}{rate} in {duration(timeline.duration_s)}'
            f'{used}; observable of {counted(len(result.axes), "axis", "axes")}: '
            f'{", ".join(shown) or "nothing yet"}')
    following = diagnostics.waiting_for(result)
    if following is None or not comes:
        return text
    seconds, axis, key = following
    return f'{text}; next: {spoken(key)} of {spoken(axis)} in about {duration(seconds)}'
