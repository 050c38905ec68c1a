# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Motion and knocks, in one class because the verdicts move the baseline that they rest on.

They are found against the axis's own noise, and left out. Half-second windows are compared with
the windows before them, in the terms of `imu_allan.timeline.sensor_at_rest`. A last test knows
physics: no sensor at rest changes its mean by 3 deg/s or 0.5 m/s^2 within two seconds, unless its
white noise does it.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
import json
from math import log, sqrt
from typing import Any

from imu_allan.block import EvenBlock
from imu_allan.timeline.excursions import Excursions
from imu_allan.timeline.messages import EvenPiece
from imu_allan.timeline.sensor_at_rest import (
    Baseline,
    baseline_of,
    describe,
    QUIETER,
    resolution_of,
    settle,
)
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PART_S = 0.02
"""Loudness is told within such parts of a window, fast noise, and between them, slow noise."""
START_WINDOWS = 128
"""Windows held back at the start, of which the quieter ones make the first baseline."""

_PARTS = 25
"""Half a second: a shorter window knows its noise worse, a longer one cuts more for a knock."""
_MARGIN = 2
"""Windows cut on each side of one in motion: a second, to settle. A judgment."""
_LAGS = (1, 4)
"""Windows apart that are held against each other: a jerk, and a slow turn of two seconds."""
_LONGEST_LAG_S = 6.0
"""Of a slow sensor windows are longer: beyond this, drift is no motion. A judgment."""
_MOST_RECENT = 64
"""Windows of stretches before a gap that those behind it are held against."""
_CONTEXT = _MARGIN + max(_LAGS) + 1
"""Windows before the ones to be judged that these are held against."""
_REMEMBERED = 512
"""Windows at rest that make the baseline: four minutes. Of fewer the threshold scatters."""
_REFRESH = 256
"""New windows, two minutes: half of the next baseline. It follows temperature, not a slow turn."""
_PERSISTENT = 128
"""Windows after which a new level may be the sensor's own: a minute. A judgment."""
_PERSISTENT_SHARE = 0.25
"""Of those so many must have been called motion: below, what was seen is knocks."""
_PLAUSIBLE_CHANGE = np.array([0.05] * 3 + [0.5] * 3)
"""rad/s and m/s^2 in two seconds: what moves less is judged by its noise alone."""
_PLAUSIBLE_SIGMAS = 10.0
"""A noisy sensor's mean changes as much by chance: so many standard deviations it does not."""
_ADOPTED_RATIO = 3.0
"""What is so much louder than rest may be is an engine, not the sensor. A judgment."""
_ADOPTED_SHARE = 0.9
"""Of the windows of a new level that have to be alike: motion is not."""
_FEWEST_WINDOWS = 8
"""Below, the spread of loudness is not measured: `_FEW_SPREAD` stands in."""
_FEW_WINDOWS = 32
"""Below, the quietest eighth is fewer than four windows, whose spread says nothing."""
_FEW_SPREAD = 0.1
"""Of the cube root of a variance from 25 samples: a third of sqrt(2 / 25)."""
_FIFTH_SPREAD = 0.2
"""The same where fifths of windows tell it: their variance has about three degrees of freedom."""
_TOLD_RATIO = 3.0
"""Noise that has become so many times louder or quieter is told. A judgment."""
_LATELY_S = 5.0
"""The word "moving" stays for so long, or it would flicker between the steps of who walks by."""
_REST_WINDOWS = 6
"""Three seconds in a row: between two bumps of a road there is less."""

LISTED_SPANS = 1000
"""Spans that are listed one by one."""


@dataclass
class _Stretch:
    """
    Even rows without a gap between them, of which the verdict is still open.

    Windows are numbered from the start of the stretch. `rows` begins with window `given`; the
    arrays of windows begin with window `base`, a few before, which are needed as context.
    """

    first_index: int
    start_s: float
    new_run: bool
    rows: list[Floats] = field(default_factory=list)
    held: int = 0
    bridged: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    closed: bool = False
    given: int = 0
    base: int = 0
    means: Floats = field(default_factory=lambda: np.empty((0, 6)))
    loudness: Floats = field(default_factory=lambda: np.empty((0, 12)))
    moving: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))

    def joined(self) -> Floats:
        """Give all rows held, as one array."""
        if len(self.rows) > 1:
            self.rows = [np.concatenate(self.rows)]
        return self.rows[0]

    def describe(self, rows: Floats, part: int) -> None:
        """Add windows of `rows`."""
        means, loudness = describe(rows, part)
        self.means = np.concatenate([self.means, means])
        self.loudness = np.concatenate([self.loudness, loudness])

    def wander(self) -> Floats:
        """Second difference of window means, NaN for the first and the last window."""
        second = np.full(self.means.shape, np.nan)
        second[1:-1] = self.means[2:] - 2 * self.means[1:-1] + self.means[:-2]
        return second


@dataclass
class MotionSummary:
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


class MotionDetector:
    """
    Leaves out motion and knocks, some windows late, in constant memory.

    Parameters
    ----------
    interval_s : float
        Sample interval; a window is half a second, 25 rows at least.

    """

    def __init__(self, interval_s: float) -> None:
        self.interval_s = interval_s
        self._part = max(round(PART_S / interval_s), 1)
        self._size = _PARTS * self._part
        self._lags = tuple(lag for lag in _LAGS
                           if lag * self._size * interval_s < _LONGEST_LAG_S)
        self._farthest = max(self._lags, default=0)
        self._held: list[_Stretch] = []
        self._baseline: Baseline | None = None
        self._first_loudness: Floats | None = None
        self._past = np.empty((0, 18))
        self._news: list[Floats] = []
        self._lately = np.empty((0, 19))
        self._excursions = Excursions()
        self._recent = np.empty((0, 14))
        self._summary = MotionSummary()
        self._run_pending = False
        self._quieter = 0
        self._void = False
        self._rest_end = -1
        self._rest_lasts = 0.0
        self._span_end = -1
        self._span_end_s = -_LATELY_S

    @property
    def summary(self) -> MotionSummary:
        """Tell what was cut out so far; it changes with the next rows."""
        return self._summary

    @property
    def excursions(self) -> list[list[float]]:
        """Return slow turns that were not cut out, as `Excursions.found`."""
        return self._excursions.found

    @property
    def holds_back(self) -> bool:
        """Whether there are rows not yet decided on."""
        return bool(self._held)

    @property
    def knows_rest(self) -> bool:
        """Whether the baseline rests on enough windows to be gone on with another time."""
        return len(self._past) >= _FEW_WINDOWS

    def copy(self) -> 'MotionDetector':
        """Give an independent copy; arrays are shared, for they are never written to."""
        twin = shallow_copy(self)
        twin._summary = replace(self._summary)
        twin._held = [replace(stretch, rows=list(stretch.rows)) for stretch in self._held]
        twin._news = list(self._news)
        twin._excursions = self._excursions.copy()
        return twin

    def follow(self, before: 'MotionDetector') -> None:
        """Go on with what another detector, of other axes, has told; it is flushed."""
        self._summary, self._excursions.found = before._summary, before._excursions.found
        self._run_pending, self._void = before._run_pending, before._void
        self._rest_end, self._rest_lasts = before._rest_end, before._rest_lasts
        self._span_end, self._span_end_s = before._span_end, before._span_end_s

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Everything needed to go on later, as a flat dict of arrays."""
        held = self._held
        stretches = [{'first_index': s.first_index, 'start_s': s.start_s, 'new_run': s.new_run,
                      'closed': s.closed, 'given': s.given, 'base': s.base, 'held': s.held,
                      'windows': len(s.means), 'judged': len(s.moving),
                      'bridged': len(s.bridged)} for s in held]
        text = json.dumps({
            'interval_s': self.interval_s, 'summary': asdict(self._summary),
            'run_pending': self._run_pending, 'span_end': self._span_end,
            'quieter': self._quieter, 'void': self._void, 'rest_end': self._rest_end,
            'rest_lasts': self._rest_lasts,
            'span_end_s': self._span_end_s, 'stretches': stretches,
            'excursions': self._excursions.to_plain()})
        baseline, first = self._baseline, self._first_loudness
        empty = np.empty((0, 6))
        return {
            'motion': np.array(text),
            'motion_rows': np.concatenate([empty, *(s.joined() for s in held)]),
            'motion_means': np.concatenate([empty, *(s.means for s in held)]),
            'motion_loudness': np.concatenate(
                [np.empty((0, 12)), *(s.loudness for s in held)]),
            'motion_moving': np.concatenate(
                [np.empty(0, dtype=bool), *(s.moving for s in held)]),
            'motion_bridged': np.concatenate(
                [np.empty(0, dtype=np.int64), *(s.bridged for s in held)]),
            'motion_past': self._past,
            'motion_news': np.concatenate([np.empty((0, 18)), *self._news]),
            'motion_lately': self._lately,
            'motion_recent': self._recent,
            'motion_baseline': empty if baseline is None else np.concatenate(
                [baseline.loudness, baseline.spread, baseline.wander, baseline.resolution]),
            'motion_first': empty if first is None else first}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> 'MotionDetector':
        """Go on from `to_state`; KeyError, TypeError or ValueError if it is damaged."""
        plain = json.loads(str(state['motion']))
        detector = cls(float(plain['interval_s']))
        summary = plain['summary']
        for name in ('spans', 'rests', 'changes'):
            summary[name] = tuple((float(a), float(b)) for a, b in summary[name])
        detector._summary = MotionSummary(**summary)
        detector._run_pending = bool(plain['run_pending'])
        detector._quieter, detector._void = int(plain['quieter']), bool(plain['void'])
        detector._rest_end = int(plain['rest_end'])
        detector._rest_lasts = float(plain['rest_lasts'])
        detector._span_end = int(plain['span_end'])
        detector._span_end_s = float(plain['span_end_s'])

        def table(name: str, columns: int) -> Floats:
            return np.asarray(state[f'motion_{name}'], dtype=np.float64).reshape(-1, columns)

        rows, means, loudness = table('rows', 6), table('means', 6), table('loudness', 12)
        moving = np.asarray(state['motion_moving'], dtype=bool).reshape(-1)
        bridged = np.asarray(state['motion_bridged'], dtype=np.int64).reshape(-1)
        for stretch in plain['stretches']:
            held, windows = int(stretch['held']), int(stretch['windows'])
            judged, filled = int(stretch['judged']), int(stretch['bridged'])
            if (len(rows) < held or len(means) < windows or len(loudness) < windows
                    or len(moving) < judged or len(bridged) < filled):
                raise ValueError('rows are missing')
            detector._held.append(_Stretch(
                int(stretch['first_index']), float(stretch['start_s']),
                bool(stretch['new_run']), [rows[:held]], held, bridged[:filled],
                bool(stretch['closed']), int(stretch['given']), int(stretch['base']),
                means[:windows], loudness[:windows], moving[:judged]))
            rows, means, loudness = rows[held:], means[windows:], loudness[windows:]
            moving, bridged = moving[judged:], bridged[filled:]
        detector._past, detector._lately = table('past', 18), table('lately', 19)
        detector._recent = table('recent', 14)
        detector._excursions = Excursions.from_plain(plain['excursions'])
        news = table('news', 18)
        detector._news = [news] if len(news) else []
        baseline, first = table('baseline', 36), table('first', 12)
        if len(baseline):
            detector._baseline = Baseline(*np.split(baseline[0], [12, 24, 30]))
        if len(first):
            detector._first_loudness = first[0]
        return detector

    def push(self, piece: EvenPiece) -> list[EvenBlock]:
        """Take even rows, give those decided to be at rest."""
        last = self._held[-1] if self._held else None
        if last is not None and (
                piece.new_run or last.closed
                or piece.first_index != last.first_index + last.given * self._size + last.held):
            last.closed = True
            last = None
        if last is None:
            last = _Stretch(piece.first_index, piece.start_s, piece.new_run)
            self._held.append(last)
        else:
            grown = piece.first_index - last.first_index
            last.start_s = piece.start_s - grown * self.interval_s
        last.rows.append(piece.samples)
        last.held += len(piece.samples)
        if len(piece.bridged):
            last.bridged = np.concatenate([last.bridged, piece.bridged])
        return self._decide(final=False)

    def flush(self) -> list[EvenBlock]:
        """Decide on all that is held back."""
        if self._held:
            self._held[-1].closed = True
        return self._decide(final=True)

    def _decide(self, final: bool) -> list[EvenBlock]:
        if self._baseline is None:
            windows = sum(stretch.held // self._size for stretch in self._held)
            rows = sum(stretch.held for stretch in self._held)
            if (windows < START_WINDOWS and rows < 2 * START_WINDOWS * self._size
                    and not final):
                return []
            self._begin()
        blocks: list[EvenBlock] = []
        for stretch in self._held:
            self._measure(stretch)
            self._judge(stretch)
            blocks += self._give(stretch)
        self._held = [stretch for stretch in self._held if not stretch.closed]
        return blocks

    def _measure(self, stretch: _Stretch) -> None:
        """Work out mean and loudness of the windows that are complete by now."""
        size = self._size
        known = stretch.base + len(stretch.means)
        done = (known - stretch.given) * size
        complete = (stretch.held - done) // size
        if complete < 0:
            return
        if complete:
            rows = stretch.joined()[done:done + complete * size].reshape(complete, size, 6)
            stretch.describe(rows, self._part)
        left = stretch.held - done - complete * size
        if stretch.closed and left:
            stretch.describe(stretch.joined()[None, -size:], self._part)

    def _begin(self) -> None:
        """Find the first baseline in the windows held back."""
        for stretch in self._held:
            self._measure(stretch)
        size = self._size
        full = [stretch for stretch in self._held if stretch.held >= size]
        quiet = Baseline(*np.split(np.full(36, np.inf), [12, 24, 30]))
        # Between frequent gaps no stretch may last a window: then each is one.
        full = full or [stretch for stretch in self._held if len(stretch.loudness) == 1]
        if not full:
            self._baseline = quiet
            return
        loudness = np.concatenate([stretch.loudness for stretch in full])
        wander = np.concatenate([stretch.wander() for stretch in full])
        resolution = np.full(6, np.inf)
        for stretch in full[:4]:
            resolution = np.minimum(resolution, resolution_of(stretch.joined()[:8 * 1024]))
        still = ~np.concatenate([self._implausible(stretch, 0) for stretch in full])
        if np.count_nonzero(still) < _FEWEST_WINDOWS:
            still[:] = True
        if len(loudness) < _FEWEST_WINDOWS and full[0].held < size:
            self._baseline = _of_few(loudness, resolution)
            return
        if len(loudness) < _FEWEST_WINDOWS:
            # Of so few windows one knock spoils the half: fifths of them are told apart.
            fifths = [stretch.joined()[:stretch.held // size * size].reshape(-1, size // 5, 6)
                      for stretch in full]
            centre = np.median(describe(np.concatenate(fifths), self._part)[1], axis=0)
            self._baseline = Baseline(centre, _FIFTH_SPREAD * centre, np.full(6, np.inf),
                                      resolution)
            return
        if np.count_nonzero(still) < _FEW_WINDOWS:
            # Of so few the quietest eighth is one or two, whose spread says nothing.
            few = _of_few(loudness[still], resolution)
            still &= np.all(loudness <= few.loudest(), axis=1)
            found = baseline_of(loudness[still], wander[still], resolution)
            self._baseline = replace(
                few, wander=found.wander if np.count_nonzero(still) >= _FEWEST_WINDOWS
                else few.wander)
            self._first_loudness = self._baseline.loudness
            self._past = np.hstack([loudness, wander])[still]
            self._past = self._past[~np.isnan(self._past).any(axis=1)]
            return
        self._baseline, rest = settle(loudness[still], wander[still], resolution)
        self._first_loudness = self._baseline.loudness
        self._past = np.hstack([loudness, wander])[still][rest]
        self._past = self._past[~np.isnan(self._past).any(axis=1)]

    def _implausible(self, stretch: _Stretch, first: int) -> Bools:
        """Tell windows from number `first` of the arrays on whose mean moved beyond belief."""
        means = stretch.means
        beyond = np.zeros(len(means), dtype=bool)
        for lag in self._lags:
            change = np.abs(means[lag:] - means[:-lag])
            large = change > _PLAUSIBLE_CHANGE
            if large.any():
                sigma = stretch.loudness ** 1.5
                sigma = np.maximum(sigma[:, :6], sqrt(self._part) * sigma[:, 6:])
                white = np.minimum(sigma[lag:], sigma[:-lag]) * sqrt(2 / self._size)
                beyond[lag:] |= np.any(large & (change > _PLAUSIBLE_SIGMAS * white), axis=1)
        return beyond[first:]

    def _beyond_before(self, stretch: _Stretch, first: int, last: int) -> Bools:
        """Tell windows whose mean is beyond belief beside those of stretches just before."""
        beyond = np.zeros(last - first, dtype=bool)
        reach, size = self._farthest * self._size, self._size
        begins = stretch.first_index + (stretch.base + first) * size
        near = self._recent[self._recent[:, 0] >= begins - reach]
        if stretch.base + first < self._farthest and not stretch.new_run and len(near):
            there = min(last - first, self._farthest - stretch.base - first)
            sigma = stretch.loudness[first:first + there, :6] ** 1.5
            change = np.abs(stretch.means[first:first + there, None] - near[:, 2:8])
            white = _PLAUSIBLE_SIGMAS * np.minimum(sigma[:, None], near[:, 8:]) * np.sqrt(
                1 / near[:, 1:2] + 1 / min(size, max(stretch.held, 1)))
            close = (begins + np.arange(there)[:, None] * size - near[:, 0]) <= reach
            beyond[:there] = np.any(
                close & np.any((change > _PLAUSIBLE_CHANGE) & (change > white), axis=2), axis=1)
        if stretch.closed:
            newest = max(last - self._farthest, 0)
            count = last - newest
            places = begins + (np.arange(newest, last) - first) * size
            rows = np.full((count, 1), float(min(size, max(stretch.held, 1))))
            self._recent = np.concatenate([self._recent, np.hstack([
                places[:, None], rows, stretch.means[newest:last],
                stretch.loudness[newest:last, :6] ** 1.5])])[-_MOST_RECENT:]
        return beyond

    def _judge(self, stretch: _Stretch) -> None:
        """Decide on the windows whose neighbours are known."""
        assert self._baseline is not None
        first = len(stretch.moving)
        last = len(stretch.means) - (0 if stretch.closed else 1)
        if last <= first:
            return
        loudness = stretch.loudness[first:last]
        wander = stretch.wander()[first:last]
        short = stretch.given == 0 and stretch.held < self._size
        shorter = self._size / stretch.held if short else 1.0
        beyond = self._implausible(stretch, first)[:last - first]
        if stretch.closed or stretch.base + first < self._farthest:
            beyond |= self._beyond_before(stretch, first, last)
        if self._baseline.any_constant:
            constant = np.isinf(self._baseline.resolution)
            awake = np.any(loudness[:, :6][:, constant] > 0, axis=1)
            if awake.any():
                self._refine_resolution(stretch, np.flatnonzero(awake) + first)
        moving = beyond | self._unlike_rest(loudness, wander, shorter)
        if moving.any() and self._refine_resolution(stretch, np.flatnonzero(moving) + first):
            moving = beyond | self._unlike_rest(loudness, wander, shorter)
        stretch.moving = np.concatenate([stretch.moving, moving])
        if not short and self._seek_rest(stretch, first, last):
            return
        rest = stretch.means[first:last]
        if moving.any():
            rest = rest[~moving]
            self._note_contrast(loudness[moving])
        if len(rest) and not short:
            self._excursions.take(rest, self._time(stretch, stretch.base + first),
                                  self._size * self.interval_s)
        if not short:
            self._learn(np.hstack([loudness, wander]), moving, beyond,
                        self._time(stretch, stretch.base + last))

    def _note_contrast(self, loudness: Floats) -> None:
        """Bring the mean contrast of windows that moved up to date."""
        assert self._baseline is not None
        rest = self._baseline.loudness
        known = (rest > 0) & np.isfinite(rest)
        if not len(loudness) or not known.any():
            return
        louder = np.log(np.maximum(np.max(loudness[:, known] / rest[known], axis=1), 1.0))
        self._add_contrast(float(louder.sum()), len(louder))

    def _add_contrast(self, total: float, windows: int) -> None:
        summary = self._summary
        count = summary.contrasted + windows
        summary.contrast = (summary.contrast * summary.contrasted + total) / count
        summary.contrasted = count

    def _seek_rest(self, stretch: _Stretch, first: int, last: int) -> bool:
        """
        Take windows far quieter than the baseline for the rest, and all before them for motion.

        A recording may begin while its vehicle drives: then the first baseline is that of driving.
        """
        assert self._baseline is not None
        if not (stretch.loudness[first:last] < self._baseline.far_quieter).any():
            self._quieter = 0
            return False
        loud = self._baseline.loudness
        known = (loud > 0) & np.isfinite(loud)
        quiet = stretch.loudness[first:last, known] < self._baseline.far_quieter[known]
        # A coarse or constant axis may be as it was.
        quieter = (np.mean(quiet, axis=1) > 0.5) & ~np.any(
            stretch.loudness[first:last] > self._baseline.loudest(), axis=1) if known.any() else (
            np.zeros(last - first, dtype=bool))
        for at in range(first, last):
            self._quieter = self._quieter + 1 if quieter[at - first] else 0
            if self._quieter == _REST_WINDOWS and at + 1 >= _REST_WINDOWS:
                self._begin_at_rest(stretch, at + 1 - _REST_WINDOWS, last)
                return True
        return False

    def _begin_at_rest(self, stretch: _Stretch, first: int, last: int) -> None:
        """Begin anew with the windows from number `first` of the arrays on."""
        assert self._baseline is not None
        found = baseline_of(stretch.loudness[first:last], stretch.wander()[first:last],
                            self._baseline.resolution)
        # A few windows tell a spread to a factor of two.
        self._baseline = replace(found, spread=2 * found.spread,
                                 wander=2 * found.wander)
        self._first_loudness = found.loudness
        self._quieter, self._void = 0, True
        self._excursions = Excursions()
        self._past, self._news, self._lately = np.empty((0, 18)), [], self._lately[:0]
        stretch.moving[:first] = True
        stretch.moving[first:] = (self._implausible(stretch, first)[:last - first]
                                  | self._unlike_rest(stretch.loudness[first:last],
                                                      stretch.wander()[first:last], 1.0))
        summary = self._summary
        excluded_s = summary.excluded_s + summary.rest_s
        self._summary = MotionSummary(
            spans=((0.0, excluded_s),), count=1, excluded=summary.seen, excluded_s=excluded_s,
            seen=summary.seen, struck=summary.seen, moving=summary.moving)
        windows = max(summary.seen // self._size, 1)
        self._add_contrast(windows * log(QUIETER), windows)
        self._span_end = stretch.first_index + stretch.given * self._size
        self._rest_end, self._rest_lasts = -1, 0.0

    def _unlike_rest(self, loudness: Floats, wander: Floats, shorter: float) -> Bools:
        assert self._baseline is not None
        loudest, widest = self._baseline.limits
        if shorter > 1:
            loudest = self._baseline.loudest(shorter)
        # NaN, where a window has no neighbour, compares as not wide.
        unlike = (loudness > loudest).any(axis=1) | (np.abs(wander) > widest).any(axis=1)
        return np.asarray(unlike)

    def _refine_resolution(self, stretch: _Stretch, windows: Ints) -> bool:
        """
        Look for smaller steps in the rows of `windows`; tell whether there are any.

        A change by one step of a coarse output is no motion, and some outputs rest for minutes
        before they show how small their step is.
        """
        assert self._baseline is not None
        rows, size = stretch.joined(), self._size
        known = self._baseline.resolution
        smaller = known
        for window in (windows + stretch.base - stretch.given).tolist():
            near = rows[max(window - 1, 0) * size:(window + 2) * size]
            smaller = np.minimum(smaller, resolution_of(near))
        if np.array_equal(smaller, known):
            return False
        self._baseline = replace(self._baseline, resolution=smaller)
        return True

    def _learn(self, windows: Floats, moving: Bools, beyond: Bools, time_s: float) -> None:
        """Let the baseline follow the windows at rest, or a level that has changed for good."""
        assert self._baseline is not None
        inner = ~np.isnan(windows[:, 12])
        rest = windows[inner & ~moving]
        if len(rest):
            self._news.append(rest)
        if sum(map(len, self._news)) >= _REFRESH:
            self._past = np.concatenate([self._past, *self._news])[-_REMEMBERED:]
            self._news = []
            self._adopt(baseline_of(self._past[:, :12], self._past[:, 12:],
                                    self._baseline.resolution), time_s)
        if len(self._lately) or moving.any():
            verdict = np.where(beyond, 2.0, moving)
            self._lately = np.concatenate(
                [self._lately, np.column_stack([windows, verdict])[inner]])
            if len(self._lately) >= _PERSISTENT:
                self._accept_change(time_s)
                self._lately = self._lately[:0]

    def _accept_change(self, time_s: float) -> None:
        """Take a new steady level for the sensor's own, if it is not much louder."""
        assert self._baseline is not None
        verdict = self._lately[:, 18]
        if np.any(verdict > 1) or np.mean(verdict) < _PERSISTENT_SHARE:
            return
        baseline, still = settle(self._lately[:, :12], self._lately[:, 12:18],
                                 self._baseline.resolution)
        little = _ADOPTED_RATIO ** (2 / 3) * self._baseline.loudest()
        if np.mean(still) > _ADOPTED_SHARE and np.all(baseline.loudness < little):
            self._past = self._lately[still, :18]
            self._news = []
            self._adopt(baseline, time_s)

    def _adopt(self, baseline: Baseline, time_s: float) -> None:
        """Take a new baseline, and tell if the noise has become much louder or quieter."""
        self._baseline = baseline
        if self._first_loudness is None:
            self._first_loudness = baseline.loudness
            return
        known = (self._first_loudness > 0) & (baseline.loudness > 0)
        ratio = (baseline.loudness[known] / self._first_loudness[known]) ** 1.5
        if not len(ratio):
            return
        most = ratio[np.argmax(np.abs(np.log(ratio)))]
        if abs(np.log(most)) > np.log(_TOLD_RATIO):
            self._first_loudness = baseline.loudness
            self._summary.changes = (*self._summary.changes[:9], (time_s, float(most)))

    def _time(self, stretch: _Stretch, window: int) -> float:
        return max(stretch.start_s + window * self._size * self.interval_s, 0.0)

    def _give(self, stretch: _Stretch) -> list[EvenBlock]:
        """Give the rows at rest of the windows whose margin is known."""
        size = self._size
        judged = stretch.base + len(stretch.moving)
        upto = judged if stretch.closed else judged - _MARGIN
        count = upto - stretch.given
        if count <= 0:
            return []
        context = stretch.given - stretch.base
        if stretch.moving.any():
            near = np.convolve(stretch.moving, np.ones(2 * _MARGIN + 1), 'full')[_MARGIN:]
            cut = near[context:context + count] > 0.5
            edges = [0, *(np.flatnonzero(cut[1:] != cut[:-1]) + 1).tolist(), count]
        else:
            cut, edges = np.zeros(1, dtype=bool), [0, count]
        rows = stretch.joined()
        length = min(count * size, stretch.held)
        first = stretch.first_index + stretch.given * size
        blocks = []
        for left, right in pairwise(edges):
            begin, end = left * size, min(right * size, length)
            if cut[left]:
                self._cut(first + begin, end - begin, self._time(stretch, stretch.given + left))
                self._run_pending |= stretch.new_run
            else:
                bridged = stretch.bridged
                if len(bridged):
                    bridged = bridged[np.searchsorted(bridged, first + begin):
                                      np.searchsorted(bridged, first + end)]
                blocks.append(EvenBlock(rows[begin:end], first + begin, len(bridged),
                                        stretch.new_run or self._run_pending, self._void,
                                        self._time(stretch, stretch.given + left)))
                self._run_pending = self._void = False
                self._keep(first + begin, end - begin, self._time(stretch, stretch.given + left))
            stretch.new_run = False
        struck = int(np.count_nonzero(stretch.moving[context:context + count])) * size
        newest = self._time(stretch, stretch.given) + length * self.interval_s
        summary = self._summary
        summary.seen += length
        summary.struck += min(struck, length)
        summary.moving = newest - self._span_end_s < _LATELY_S
        stretch.rows = [rows[length:]]
        stretch.held -= length
        stretch.given = upto
        drop = max(upto - _CONTEXT - stretch.base, 0)
        if drop:
            stretch.base += drop
            stretch.means = stretch.means[drop:]
            stretch.loudness = stretch.loudness[drop:]
            stretch.moving = stretch.moving[drop:]
        if len(stretch.bridged):
            stretch.bridged = stretch.bridged[np.searchsorted(stretch.bridged, first + length):]
        return blocks

    def _keep(self, first: int, rows: int, start_s: float) -> None:
        """Note rows at rest, as part of the stretch before if they follow it."""
        summary = self._summary
        duration = rows * self.interval_s
        rests = summary.rests
        if first == self._rest_end and rests:
            self._rest_lasts += duration
            if len(rests) < LISTED_SPANS:
                rests = (*rests[:-1], (rests[-1][0], self._rest_lasts))
        else:
            self._rest_lasts = duration
            if len(rests) < LISTED_SPANS:
                rests = (*rests, (start_s, duration))
        self._rest_end = first + rows
        summary.rests = rests
        summary.rest_s += duration
        summary.longest_rest_s = max(summary.longest_rest_s, self._rest_lasts)

    def _cut(self, first: int, rows: int, start_s: float) -> None:
        """Note rows that are left out, as part of the span before if they follow it."""
        summary = self._summary
        duration = rows * self.interval_s
        spans, count = summary.spans, summary.count
        if first == self._span_end and count:
            if count == len(spans):
                begun, lasted = spans[-1]
                spans = (*spans[:-1], (begun, lasted + duration))
        else:
            count += 1
            if len(spans) < LISTED_SPANS:
                spans = (*spans, (start_s, duration))
        self._span_end = first + rows
        self._span_end_s = start_s + duration
        summary.spans, summary.count = spans, count
        summary.excluded += rows
        summary.excluded_s += duration


def _of_few(loudness: Floats, resolution: Floats) -> Baseline:
    """Take the quieter half of a few windows for rest, as surely as their samples tell it."""
    order = np.argsort(loudness.sum(axis=1))
    centre = np.median(loudness[order[:(len(order) + 1) // 2]], axis=0)
    return Baseline(centre, _FEW_SPREAD * centre, np.full(6, np.inf), resolution)
