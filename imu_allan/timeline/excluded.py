# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What was cut out as motion, what was kept as rest, and how much louder the one is."""

from dataclasses import dataclass, field

from imu_allan.state import Record

LISTED_SPANS = 1000
"""Spans that are listed one by one."""

_LATELY_S = 5.0
"""The word "moving" stays for so long, or it would flicker between the steps of who walks by."""
_LISTED_CHANGES = 9
"""Changes of the noise that are told: a sensor with more has no level at all."""


@dataclass
class MotionSummary(Record):
    """
    What was cut out, brought up to date in place by its detector: every window counts.

    Attributes
    ----------
    spans : tuple of (float, float)
        Start and duration in seconds of the first spans.
    count : int
        Number of all spans.
    excluded, excluded_s : int, float
        Rows cut out, and their duration.
    seen, struck : int
        Rows decided on, and those of them in windows that moved, without the margins.
    moving : bool
        The newest span ended less than five seconds before the newest row.
    rests : tuple of (float, float)
        Start and duration in seconds of the first stretches that were kept.
    rest_s, longest_rest_s : float
        What was kept in all, and the longest stretch of it.
    contrast : float, contrasted : int
        By how much the windows that moved are louder than rest, as the mean of a logarithm, and
        how many these are.
    changes : tuple of (float, float)
        When the noise level changed for good, and the ratio of new to old standard deviation.

    """

    spans: tuple[tuple[float, float], ...] = ()
    count: int = 0
    excluded: int = 0
    excluded_s: float = 0.0
    seen: int = 0
    struck: int = 0
    moving: bool = False
    rests: tuple[tuple[float, float], ...] = ()
    rest_s: float = 0.0
    longest_rest_s: float = 0.0
    contrast: float = 0.0
    contrasted: int = 0
    changes: tuple[tuple[float, float], ...] = ()


@dataclass
class Excluded(Record):
    """
    Keeps the account of spans and rests.

    Attributes
    ----------
    interval_s : float
        Sample interval.
    summary : MotionSummary
        Brought up to date in place.
    rest_end, span_end : int
        Grid places at which the newest rest and the newest span end; -1 before the first.
    rest_lasts : float
        Duration of the newest rest in seconds.
    span_end_s : float
        When the newest span ended, in seconds.

    """

    interval_s: float
    summary: MotionSummary = field(default_factory=MotionSummary)
    rest_end: int = -1
    rest_lasts: float = 0.0
    span_end: int = -1
    span_end_s: float = -_LATELY_S

    def keep(self, first: int, rows: int, start_s: float) -> None:
        """Note rows at rest, as part of the stretch before if they follow it."""
        summary = self.summary
        duration = rows * self.interval_s
        rests = summary.rests
        if first == self.rest_end and rests:
            self.rest_lasts += duration
            if len(rests) < LISTED_SPANS:
                rests = (*rests[:-1], (rests[-1][0], self.rest_lasts))
        else:
            self.rest_lasts = duration
            if len(rests) < LISTED_SPANS:
                rests = (*rests, (start_s, duration))
        self.rest_end = first + rows
        summary.rests = rests
        summary.rest_s += duration
        summary.longest_rest_s = max(summary.longest_rest_s, self.rest_lasts)

    def cut(self, first: int, rows: int, start_s: float) -> None:
        """Note rows that are left out, as part of the span before if they follow it."""
        summary = self.summary
        duration = rows * self.interval_s
        spans, count = summary.spans, summary.count
        if first == self.span_end and count:
            if count == len(spans):
                begun, lasted = spans[-1]
                spans = (*spans[:-1], (begun, lasted + duration))
        else:
            count += 1
            if len(spans) < LISTED_SPANS:
                spans = (*spans, (start_s, duration))
        self.span_end = first + rows
        self.span_end_s = start_s + duration
        summary.spans, summary.count = spans, count
        summary.excluded += rows
        summary.excluded_s += duration

    def count(self, rows: int, struck: int, newest_s: float) -> None:
        """Count rows decided on, those in windows that moved, and tell if it moved lately."""
        summary = self.summary
        summary.seen += rows
        summary.struck += min(struck, rows)
        summary.moving = newest_s - self.span_end_s < _LATELY_S

    def add_contrast(self, total: float, windows: int) -> None:
        """Bring the mean contrast of windows that moved up to date."""
        summary = self.summary
        count = summary.contrasted + windows
        summary.contrast = (summary.contrast * summary.contrasted + total) / count
        summary.contrasted = count

    def note_change(self, time_s: float, ratio: float) -> None:
        """Note that the noise changed for good."""
        self.summary.changes = (*self.summary.changes[:_LISTED_CHANGES], (time_s, ratio))

    def cut_all(self, end: int) -> None:
        """Call all rows so far motion, up to a grid place: rest begins only now."""
        summary = self.summary
        excluded_s = summary.excluded_s + summary.rest_s
        self.summary = MotionSummary(
            spans=((0.0, excluded_s),), count=1, excluded=summary.seen, excluded_s=excluded_s,
            seen=summary.seen, struck=summary.seen, moving=summary.moving)
        self.span_end = end
        self.rest_end, self.rest_lasts = -1, 0.0
