# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the log says of its own accord: every transition once, and progress from time to time.

Each `see_` method is given what is true now and compares it with what was true before.
"""

from imu_allan.node.diagnostics import Facts, off_rate, waiting_for
from imu_allan.node.findings import live_text
from imu_allan.node.log import Log
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import counted, duration, listed, measured, spoken

SILENCE_S = 5.0
"""Longer than a hiccup of Wi-Fi; any longer and a dead sensor is news late. A judgment."""
REPEAT_S = 30.0
"""A warning about something that flickers comes at most so often."""
PROGRESS_S = 60.0
"""As often as somebody who waits looks again."""
EARLY_S = 600.0
"""In the first ten minutes somebody watches: a line a minute; after that one an hour."""
LATER_S = 3600.0
"""A night makes ten lines."""
_TOLD_ELSEWHERE = frozenset({'short_recording', 'motion', 'mostly_motion', 'unknown_rate',
                             'clock_jumps'})
"""Codes of remarks that progress lines or transitions of their own tell."""
_REJECTING = frozenset({'several_frames', 'several_publishers', 'rate_changed'})
"""Codes of remarks that say by themselves which messages are rejected."""


class Announcements:
    """
    Compares what is with what was, and says the difference.

    Parameters
    ----------
    log : Log
        Where it is said.
    topic : str
        Of the IMU.

    """

    def __init__(self, log: Log, topic: str) -> None:
        self._log = log
        self._topic = topic
        self._silent = False
        self._publishers = 0
        self._namesakes = 0
        self._mixed = False
        self._looping = False
        self._levels: dict[str, str] = {}
        self.begin_run()

    @property
    def has_begun(self) -> bool:
        """Whether the first samples of the run have been told."""
        return self._began is not None

    def begin_run(self) -> None:
        """Forget what was said about the run before."""
        self._began: float | None = None
        self._progress_at = 0.0
        self._said_codes: set[str] = set()
        self._moving = False
        self._rejected = self._jumps = 0
        self._off_rate = False
        self._observable: set[tuple[str, str]] = set()

    def see_reception(self, facts: Facts, names: list[str]) -> None:
        """Tell of publishers that come and go, of mixing, and of data that return."""
        if facts.publishers != self._publishers:
            if facts.publishers > 1:
                self._log.warning(f'{facts.publishers} publishers on {self._topic} '
                                  f'({listed(names)}): where their samples mix they are passed '
                                  'over; give every IMU a topic of its own', 'publishers')
            elif self._publishers > 1:
                self._log.info(f'one publisher is left on {self._topic}')
            self._publishers = facts.publishers
        if facts.mixed != self._mixed:
            self._mixed = facts.mixed
            if facts.mixed:
                self._log.warning(f'the messages on {self._topic} are of more than one publisher: '
                                  'they are passed over', 'mixed', REPEAT_S)
            else:
                self._log.info(f'the messages on {self._topic} are of one publisher again; call '
                               '~/reset if it is another IMU')
        if facts.namesakes != self._namesakes:
            self._namesakes = facts.namesakes
            if facts.namesakes:
                self._log.warning('another node has the same name: their topics and services '
                                  'cannot be told apart; start one of them with another name',
                                  'namesakes')
        if facts.looping != self._looping:
            self._looping = facts.looping
            if facts.looping:
                self._log.warning(f'the messages on {self._topic} repeat from the first one on, '
                                  'as a recording played in a loop does: what has come before is '
                                  'passed over', 'looping', REPEAT_S)
            else:
                self._log.info(f'the messages on {self._topic} are new again')
        silent = facts.received > 0 and facts.silent_s > SILENCE_S
        if self._silent and not silent:
            self._log.info(f'messages come on {self._topic} again')
        self._silent = silent

    def see_timeline(self, now: float, facts: Facts, summary: TimelineSummary) -> None:
        """Tell of the first sample, of faults of clock and samples, and of motion."""
        timeline = summary.timeline
        if timeline.samples and self._began is None:
            self._began, self._progress_at = now, now + PROGRESS_S
            frame = f'frame_id {summary.frame_id!r}, ' if summary.frame_id else ''
            rate = f'{timeline.sample_rate_hz:.4g} Hz, ' if timeline.sample_rate_hz else ''
            self._log.info(f'first samples on {self._topic}: {frame}{rate}'
                           f'{summary.clock or "no"} stamps')
        for remark in summary.remarks:
            self._say_once(remark.code, live_text(remark))
        if summary.moving != self._moving:
            self._moving = summary.moving
            if summary.moving:
                self._log.warning('the IMU moves: what it measures meanwhile is left out',
                                  'moving', REPEAT_S)
            else:
                self._log.info('the IMU is at rest again')
        if summary.clock_jumps > self._jumps:
            self._log.warning(f'the {summary.clock} clock jumped: no difference is taken across '
                              'the jump', 'jumped', REPEAT_S)
        self._jumps = summary.clock_jumps
        if timeline.rejected > self._rejected and not _REJECTING & {
                remark.code for remark in summary.remarks}:
            self._log.warning(f'{counted(timeline.rejected, "message")} rejected: NaN, infinite '
                              'or declared absent', 'rejected', REPEAT_S)
        self._rejected = timeline.rejected
        wrong = off_rate(facts, summary)
        if wrong and not self._off_rate:
            self._log.warning(f'{wrong}; check expected_rate, or the setting of the driver',
                              'expected_rate', REPEAT_S)
        self._off_rate = bool(wrong)

    def see_result(self, result: Result) -> None:
        """Tell of coefficients that have become observable and of what the fit found."""
        fresh: dict[str, list[str]] = {}
        for name, axis in result.axes.items():
            for key, coefficient in axis.coefficients.items():
                if not coefficient.observable or (name, key) in self._observable:
                    continue
                self._observable.add((name, key))
                if coefficient.value is not None and coefficient.ci95 is not None:
                    value, low, high = measured(coefficient.value, *coefficient.ci95)
                    fresh.setdefault(f'{key.replace("_", " ")} ({coefficient.unit})', []).append(
                        f'{spoken(name)} {value} ({low} .. {high})')
        for what, axes in fresh.items():
            self._log.info(f'observable: {what} of {"; ".join(axes)}')
        for remark in result.warnings:
            self._say_once(remark.code, live_text(remark))

    def see_standing(self, facts: Facts) -> None:
        """Tell where the verdict of a standard has changed."""
        for finding in facts.findings:
            if self._levels.get(finding.standard) == finding.level:
                continue
            self._levels[finding.standard] = finding.level
            text = f'{finding.standard}: {finding.message}'
            if finding.level == 'error':
                self._log.error(text, f'{finding.standard} error', REPEAT_S)
            elif finding.level == 'warn':
                self._log.warning(text, f'{finding.standard} warn', REPEAT_S)
            else:
                self._log.info(text)

    def see_progress(self, now: float, facts: Facts, result: Result | None) -> None:
        """Tell how far the run has come, a line a minute at first, an hour later."""
        if self._began is None or now < self._progress_at or result is None or not result.axes:
            return
        early = now - self._began < EARLY_S
        self._progress_at = now + (PROGRESS_S if early else LATER_S)
        self._log.info(progress_line(result, facts.moved_s))

    def _say_once(self, code: str, text: str) -> None:
        if code not in self._said_codes and code not in _TOLD_ELSEWHERE:
            self._said_codes.add(code)
            self._log.warning(text, f'{code}: {text}', REPEAT_S)


def progress_line(result: Result, moved_s: float = 0.0) -> str:
    """Say how much has come, what is observable and what comes next."""
    timeline = result.timeline
    rate = f' at {timeline.sample_rate_hz:.4g} Hz' if timeline.sample_rate_hz else ''
    used = ''
    if moved_s and timeline.sample_rate_hz:
        rest = max(timeline.samples / timeline.sample_rate_hz - moved_s, 0.0)
        used = f', {duration(rest)} of it at rest'
    counts = {key: sum(axis.coefficients[key].observable for axis in result.axes.values())
              for key in TERMS}
    shown = [f'{key.replace("_", " ")} of {count}' for key, count in counts.items() if count]
    text = (f'{counted(timeline.samples, "sample")}{rate} in {duration(timeline.duration_s)}'
            f'{used}; observable of {counted(len(result.axes), "axis", "axes")}: '
            f'{", ".join(shown) or "nothing yet"}')
    following = waiting_for(result)
    if following is None:
        return text
    axis, key, seconds = following
    return (f'{text}; next: {key.replace("_", " ")} of {spoken(axis)} in about '
            f'{duration(seconds)}')
