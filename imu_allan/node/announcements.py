# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the log says of its own accord: every transition once, and progress from time to time.

Each `see_` method is given what is true now and compares it with what was true before.
"""

from imu_allan.node.diagnostics import cause_of_loss, Facts, off_rate, waiting_for
from imu_allan.node.log import Log
from imu_allan.node.sequential import rest_s
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result
from imu_allan.timeline import TimelineSummary
from imu_allan.wording import counted, duration, listed, measured, spoken
from imu_allan.writers.words import message_of, presented

PAUSE_S = 1.0
"""Longer than a hiccup of Wi-Fi, and shorter than a driver takes to start. A judgment."""
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
    """Compares what is with what was, and says the difference."""

    def __init__(self, log: Log, topic: str) -> None:
        self._log = log
        self._topic = topic
        self._present: dict[str, bool] = {}
        self._restarts = 0
        self._overrun = False
        self._levels: dict[str, str] = {}
        self.begin_run()

    @property
    def has_begun(self) -> bool:
        """Whether the first samples of the run have been reported."""
        return self._began is not None

    def begin_run(self) -> None:
        """Forget what was said about the run before."""
        self._began: float | None = None
        self._progress_at = 0.0
        self._said_codes: set[str] = set()
        self._jumps = 0
        for what in ('moving', 'rejected', 'expected_rate'):
            self._present.pop(what, None)
        self._observable: set[tuple[str, str]] = set()

    def see_reception(self, facts: Facts, names: list[str]) -> None:
        """Tell of publishers that come and go, of losses, and of data that return."""
        topic = self._topic
        self._turn('publishers', facts.publishers > 1,
                   f'{facts.publishers} publishers on {topic} ({listed(names)}): where their '
                   'samples mix they are passed over; give every IMU a topic of its own',
                   f'one publisher is left on {topic}')
        self._turn('mixed', facts.mixed,
                   f'the messages on {topic} are of more than one publisher: they are passed over',
                   f'the messages on {topic} are of one publisher again; call ~/reset if it is '
                   'another IMU')
        self._turn('namesakes', facts.namesakes > 0,
                   'another node has the same name: their topics and services cannot be kept '
                   'apart; start one of them with another name',
                   'no other node has the same name any more')
        self._turn('looping', facts.looping,
                   f'the messages on {topic} repeat from the first one on, as a recording played '
                   'in a loop does: what has come before is passed over',
                   f'the messages on {topic} are new again')
        recent = facts.recent
        self._overrun = recent['overrun'] > 0
        self._turn('malformed', recent['malformed'] > 0,
                   f'{counted(recent["malformed"], "message")} on {topic} could not be decoded: '
                   f'{facts.malformed_why}',
                   f'every message on {topic} can be decoded again; '
                   f'{counted(facts.malformed, "message")} could not be in all')
        self._turn('lost', recent['lost'] > 0,
                   f'{counted(recent["lost"], "message")} on {topic} lost: '
                   f'{cause_of_loss(facts)}',
                   f'no message on {topic} is lost any more; {_were(facts.lost)} in all')
        if facts.pause_s > PAUSE_S and facts.silent_s < PAUSE_S:
            restarted = facts.restarts > self._restarts
            self._log.info(f'messages come on {topic} again after {facts.pause_s:.0f} s without'
                           f'{": their publisher has restarted" if restarted else ""}',
                           f'pause {topic}')
        self._restarts = facts.restarts
        self._see_thermometer(facts)

    def _see_thermometer(self, facts: Facts) -> None:
        topic = facts.temperature_topic
        if not topic:
            return
        self._turn('thermometer', facts.temperature_missing,
                   f'nothing publishes {topic}: there is no temperature',
                   f'the thermometer on {topic} is there')
        silent = facts.temperature_silent_s
        self._turn('thermometer silent', silent > 0 and not facts.temperature_missing,
                   f'no temperature on {topic} for {silent:.0f} s',
                   f'temperatures come on {topic} again')

    def _turn(self, what: str, present: bool, begins: str, over: str) -> None:
        """Say that something begins, and that it is over if its beginning was said."""
        if not present:
            if self._present.pop(what, False):
                self._log.info(over)
        elif not self._present.get(what):
            self._present[what] = self._log.warning(begins, f'{what} {self._topic}', REPEAT_S)

    def see_timeline(self, now: float, facts: Facts, summary: TimelineSummary) -> None:
        """Tell of the first sample, of faults of clock and samples, and of motion."""
        timeline = summary.timeline
        if timeline.samples and self._began is None:
            self._began, self._progress_at = now, now + PROGRESS_S
            frame = f'frame_id {summary.frame_id!r}, ' if summary.frame_id else ''
            rate = f'{timeline.sample_rate_hz:.4g} Hz, ' if timeline.sample_rate_hz else ''
            self._log.info(f'first samples on {self._topic}: {frame}{rate}'
                           f'{summary.clock or "no"} stamps')
        for remark in presented(summary.remarks):
            self._say_once(remark.code, message_of(remark, live=True))
        self._turn('moving', summary.moving,
                   'the IMU moves: what it measures meanwhile is left out',
                   'the IMU is at rest again')
        if summary.clock_jumps > self._jumps:
            self._log.warning(f'the {summary.clock} clock jumped: no difference is taken across '
                              'the jump', f'jumped {self._topic}', REPEAT_S)
        self._jumps = summary.clock_jumps
        rejected = facts.recent['rejected']
        self._turn('rejected', rejected > 0 and not _REJECTING & {
            remark.code for remark in summary.remarks},
            f'{counted(rejected, "message")} rejected: NaN, infinite or declared absent',
            f'no message is rejected any more; {_were(timeline.rejected)} in all')
        wrong = off_rate(facts, summary)
        self._turn('expected_rate', bool(wrong),
                   f'{wrong}; check expected_rate, or the setting of the driver',
                   'the rate is the expected one again')

    def see_result(self, result: Result) -> None:
        """Tell of coefficients that become observable, or no longer are, and what was found."""
        fresh: dict[str, list[str]] = {}
        gone: dict[str, list[str]] = {}
        for name, axis in result.axes.items():
            for key, coefficient in axis.coefficients.items():
                if coefficient.observable == ((name, key) in self._observable):
                    continue
                if not coefficient.observable:
                    self._observable.remove((name, key))
                    bound = ('' if coefficient.upper95 is None else
                             f' (below {coefficient.upper95:.2g})')
                    gone.setdefault(f'{key.replace("_", " ")} ({coefficient.unit})', []).append(
                        f'{spoken(name)}{bound}')
                    continue
                self._observable.add((name, key))
                if coefficient.value is not None and coefficient.ci95 is not None:
                    value, low, high = measured(coefficient.value, *coefficient.ci95)
                    fresh.setdefault(f'{key.replace("_", " ")} ({coefficient.unit})', []).append(
                        f'{spoken(name)} {value} ({low} .. {high})')
        for what, axes in fresh.items():
            self._log.info(f'observable: {what} of {"; ".join(axes)}')
        for what, axes in gone.items():
            self._log.warning(f'no longer observable: {what} of {"; ".join(axes)}: the longer '
                              'record is explained as well without it', f'gone {what}')
        for remark in result.warnings:
            self._say_once(remark.code, message_of(remark, live=True))

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
        self._log.info(progress_line(result, facts.moved_s, comes=facts.silent_s < PAUSE_S))

    def _say_once(self, code: str, text: str) -> None:
        # Where the queue overruns, all that is odd about the samples may come of it.
        if not self._overrun and code not in self._said_codes and code not in _TOLD_ELSEWHERE:
            self._said_codes.add(code)
            self._log.warning(text, f'{code} {self._topic}', REPEAT_S)


def progress_line(result: Result, moved_s: float = 0.0, *, comes: bool = True) -> str:
    """Say how much has come, what is observable and, while more comes, what is next."""
    timeline = result.timeline
    rate = f' at {timeline.sample_rate_hz:.4g} Hz' if timeline.sample_rate_hz else ''
    used = f', {duration(rest_s(timeline, moved_s))} of it at rest' if moved_s else ''
    counts = {key: sum(axis.coefficients[key].observable for axis in result.axes.values())
              for key in TERMS}
    shown = [f'{key.replace("_", " ")} of {count}' for key, count in counts.items() if count]
    text = (f'{counted(timeline.samples, "sample")}{rate} in {duration(timeline.duration_s)}'
            f'{used}; observable of {counted(len(result.axes), "axis", "axes")}: '
            f'{", ".join(shown) or "nothing yet"}')
    following = waiting_for(result)
    if following is None or not comes:
        return text
    axis, key, seconds = following
    return (f'{text}; next: {key.replace("_", " ")} of {spoken(axis)} in about '
            f'{duration(seconds)}')


def _were(count: int) -> str:
    return f'{count:,} {"was" if count == 1 else "were"}'
