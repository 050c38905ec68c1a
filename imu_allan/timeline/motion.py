# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Motion and knocks are found and left out.

Windows go into stretches, are measured, judged against the level of rest with their neighbours
known, and given or cut with a margin.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import replace
from itertools import pairwise
import json
from math import log
from typing import Any

from imu_allan.block import EvenBlock
from imu_allan.timeline.excluded import Excluded, MotionSummary
from imu_allan.timeline.excursions import Excursions
from imu_allan.timeline.pieces import EvenPiece
from imu_allan.timeline.rest_level import RestLevel
from imu_allan.timeline.sensor_at_rest import QUIETER
from imu_allan.timeline.windows import FARTHEST_LAG, Stretch, Windows
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

START_WINDOWS = 128
"""Windows held back at the start, of which the quieter ones make the first baseline."""

_MARGIN = 2
"""Windows cut on each side of one in motion: a second, to settle. A judgment."""
_CONTEXT = _MARGIN + FARTHEST_LAG + 1
"""Windows before the ones to be judged that these are held against."""


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
        self._windows = Windows(interval_s)
        self._size = self._windows.size
        self._level = RestLevel(self._windows)
        self._excluded = Excluded(interval_s)
        self._excursions = Excursions()
        self._held: list[Stretch] = []
        self._run_pending = False
        self._void = False

    @property
    def summary(self) -> MotionSummary:
        """Tell what was cut out so far; it changes with the next rows."""
        return self._excluded.summary

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
        return self._level.is_known

    def copy(self) -> 'MotionDetector':
        """Give an independent copy; arrays are shared, for they are never written to."""
        twin = shallow_copy(self)
        twin._windows = shallow_copy(self._windows)
        twin._level = self._level.copy(twin._windows)
        twin._excluded = self._excluded.copy()
        twin._held = [replace(stretch, rows=list(stretch.rows)) for stretch in self._held]
        twin._excursions = self._excursions.copy()
        return twin

    def follow(self, before: 'MotionDetector') -> None:
        """Go on with what another detector, of other axes, has told; it is flushed."""
        self._excluded.follow(before._excluded)
        self._excursions.found = before._excursions.found
        self._run_pending, self._void = before._run_pending, before._void

    def to_state(self) -> dict[str, NDArray[Any]]:
        """Everything needed to go on later, as a flat dict of arrays."""
        held = self._held
        stretches = [{'first_index': s.first_index, 'start_s': s.start_s, 'new_run': s.new_run,
                      'closed': s.closed, 'given': s.given, 'base': s.base, 'held': s.held,
                      'windows': len(s.means), 'judged': len(s.moving),
                      'bridged': len(s.bridged)} for s in held]
        text = json.dumps({
            'interval_s': self.interval_s, **self._excluded.to_plain(),
            'run_pending': self._run_pending, 'void': self._void,
            'quieter': self._level.quieter, 'stretches': stretches,
            'excursions': self._excursions.to_plain()})
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
            'motion_recent': self._windows.recent,
            **self._level.to_state()}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> 'MotionDetector':
        """Go on from `to_state`; KeyError, TypeError or ValueError if it is damaged."""
        plain = json.loads(str(state['motion']))
        detector = cls(float(plain['interval_s']))
        detector._excluded = Excluded.from_plain(plain, detector.interval_s)
        detector._run_pending = bool(plain['run_pending'])
        detector._void = bool(plain['void'])

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
            detector._held.append(Stretch(
                int(stretch['first_index']), float(stretch['start_s']),
                bool(stretch['new_run']), [rows[:held]], held, bridged[:filled],
                bool(stretch['closed']), int(stretch['given']), int(stretch['base']),
                means[:windows], loudness[:windows], moving[:judged]))
            rows, means, loudness = rows[held:], means[windows:], loudness[windows:]
            moving, bridged = moving[judged:], bridged[filled:]
        detector._windows.recent = table('recent', 14)
        detector._level = RestLevel.from_state(state, int(plain['quieter']), detector._windows)
        detector._excursions = Excursions.from_plain(plain['excursions'])
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
            last = Stretch(piece.first_index, piece.start_s, piece.new_run)
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
        if self._level.baseline is None:
            windows = sum(stretch.held // self._size for stretch in self._held)
            rows = sum(stretch.held for stretch in self._held)
            if (windows < START_WINDOWS and rows < 2 * START_WINDOWS * self._size
                    and not final):
                return []
            for stretch in self._held:
                self._windows.measure(stretch)
            self._level.begin(self._held)
        blocks: list[EvenBlock] = []
        for stretch in self._held:
            self._windows.measure(stretch)
            self._judge(stretch)
            blocks += self._give(stretch)
        self._held = [stretch for stretch in self._held if not stretch.closed]
        return blocks

    def _judge(self, stretch: Stretch) -> None:
        """Decide on the windows whose neighbours are known."""
        windows, level = self._windows, self._level
        first = len(stretch.moving)
        last = len(stretch.means) - (0 if stretch.closed else 1)
        if last <= first:
            return
        loudness = stretch.loudness[first:last]
        wander = stretch.wander()[first:last]
        short = stretch.given == 0 and stretch.held < self._size
        shorter = self._size / stretch.held if short else 1.0
        beyond = windows.implausible(stretch, first)[:last - first]
        if stretch.closed or stretch.base + first < windows.farthest:
            beyond |= windows.beyond_before(stretch, first, last)
        level.refine_where_awake(stretch, first, last)
        moving = beyond | level.unlike(loudness, wander, shorter)
        if moving.any() and level.refine_resolution(stretch, np.flatnonzero(moving) + first):
            moving = beyond | level.unlike(loudness, wander, shorter)
        stretch.moving = np.concatenate([stretch.moving, moving])
        if not short and (begins := level.deeper_rest(stretch, first, last)) is not None:
            self._begin_at_rest(stretch, begins, last)
            return
        rest = stretch.means[first:last]
        if moving.any():
            rest = rest[~moving]
            contrast = level.contrast(loudness[moving])
            if contrast is not None:
                self._excluded.add_contrast(*contrast)
        if len(rest) and not short:
            self._excursions.take(rest, windows.time(stretch, stretch.base + first),
                                  self._size * self.interval_s)
        if not short:
            level.learn(np.hstack([loudness, wander]), moving, beyond,
                        windows.time(stretch, stretch.base + last), self._excluded)

    def _begin_at_rest(self, stretch: Stretch, first: int, last: int) -> None:
        """Take windows from number `first` of the arrays on for rest, all before for motion."""
        self._level.begin_at(stretch, first, last)
        self._void = True
        self._excursions = Excursions()
        stretch.moving[:first] = True
        stretch.moving[first:] = (
            self._windows.implausible(stretch, first)[:last - first]
            | self._level.unlike(stretch.loudness[first:last], stretch.wander()[first:last], 1.0))
        self._excluded.cut_all(stretch.first_index + stretch.given * self._size)
        windows = max(self._excluded.summary.seen // self._size, 1)
        self._excluded.add_contrast(windows * log(QUIETER), windows)

    def _give(self, stretch: Stretch) -> list[EvenBlock]:
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
            start_s = self._windows.time(stretch, stretch.given + left)
            if cut[left]:
                self._excluded.cut(first + begin, end - begin, start_s)
                self._run_pending |= stretch.new_run
            else:
                bridged = stretch.bridged
                if len(bridged):
                    bridged = bridged[np.searchsorted(bridged, first + begin):
                                      np.searchsorted(bridged, first + end)] - (first + begin)
                blocks.append(EvenBlock(rows[begin:end], first + begin, bridged,
                                        stretch.new_run or self._run_pending, self._void,
                                        start_s))
                self._run_pending = self._void = False
                self._excluded.keep(first + begin, end - begin, start_s)
            stretch.new_run = False
        struck = int(np.count_nonzero(stretch.moving[context:context + count])) * size
        newest = self._windows.time(stretch, stretch.given) + length * self.interval_s
        self._excluded.count(length, struck, newest)
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
