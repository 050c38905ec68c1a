# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Search for the models that matter: first the fast end of the spectrum, then the slow noise.

All axes are searched together, so that each step is one batch.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from imu_allan.arrays import Array
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.evidence import distinct, inside, maximise_rows
from imu_allan.noise.posterior.likelihood import (
    ALPHA,
    B,
    HIGH,
    K,
    LAW,
    LOW,
    N,
    OUTPUT,
    PROCESS,
    Q,
    Rows,
    SLOTS,
    SMOOTH,
    Spectra,
    TIME,
)
from imu_allan.noise.posterior.prepared_spectra import Start
from imu_allan.noise.posterior.shapes import EXPONENTIAL_AVERAGE, FEWEST_GROUPS, LOW_PASSES
from imu_allan.noise.record.groups import half_octaves
import numpy as np

KEPT = 7.0
"""Nats below the best at which a model is dropped: e^-7 is negligible."""
FAST = (Q, OUTPUT, LOW)
"""Slots of the shapes that change the fast end of the spectrum."""


class Model(NamedTuple):
    """A model to be fitted."""

    slots: Sequence[int]    # parameters that it has
    x: Array    # (SLOTS,): where to begin
    low_pass: int = 0
    edge: int | None = None    # the first group that is left unexplained


def rows_of(spectra: Spectra, spectrum: int, models: Iterable[Model]) -> Rows:
    """Return models of one spectrum as rows that are not fitted yet."""
    slots, x, low_pass, edge = zip(*models, strict=True)
    present = np.zeros((len(slots), SLOTS), np.bool_)
    for row, own in zip(present, slots, strict=True):
        row[list(own)] = True
    unset = np.zeros(len(slots))
    rows = Rows(np.full(len(slots), spectrum), np.array(x), present, np.array(low_pass),
                np.array([len(spectra.frequency) if one is None else one for one in edge]),
                unset, unset, np.zeros((len(slots), SLOTS, SLOTS)), unset)
    return replace(rows, prior=likelihood.structure_prior(spectra, rows))


def search_models(spectra: Spectra, starts: Sequence[Start]) -> Rows:
    """
    Fit every model that may matter, for all axes.

    `starts`: starting point for each spectrum. Returns: at most 16 rows per axis, the best first.
    """
    def maximised(models: Mapping[int, Iterable[Model]]) -> Rows:
        rows = [rows_of(spectra, axis, own) for axis, own in models.items()]
        return maximise_rows(spectra, Rows.joined(rows), hopeless=16.0, on_grid=True)

    axes = range(len(starts))
    # Nats below the best at which a fast end, or a slow noise, is dropped.
    kept = 12.0
    fast = best_of(spectra, maximised(
        {axis: _fast_ends(spectra, axis, starts[axis]) for axis in axes}), kept, 12)
    # Output noise after a filter
    with_output = {axis: _filtered(
        spectra, axis, starts[axis], (N, B, K, OUTPUT, LOW),
        {OUTPUT: _amplitude_at_top(spectra, axis, OUTPUT)})
        for axis in axes if _may_have_output_noise(spectra, starts[axis])}
    if with_output:
        fast = best_of(spectra, Rows.joined([fast, maximised(with_output)]), kept, 12)
    ends = [_distinct_ends(of_axis(fast, axis)) for axis in axes]
    slow = best_of(spectra, maximised(
        {axis: _slow_noises(spectra, starts[axis], ends[axis]) for axis in axes}), kept, 8)
    crossed = [_crossed(spectra, of_axis(slow, axis), ends[axis].take([number]))
               for axis in axes for number in range(1, len(ends[axis]))]
    if crossed:
        slow = Rows.joined([slow, maximise_rows(spectra, Rows.joined(crossed), hopeless=16.0)])
    return best_of(spectra, slow, KEPT, 16)


def of_axis(rows: Rows, axis: int) -> Rows:
    """Return the rows of one axis."""
    return rows.take(rows.spectrum == axis)


def best_of(spectra: Spectra, rows: Rows, within: float, most: int) -> Rows:
    """Return up to `most` distinct rows per axis `within` nats of its best, the best first."""
    kept = []
    for axis in np.unique(rows.spectrum).tolist():
        own = of_axis(rows, axis)
        own = own.take(own.evidence > own.evidence.max() - within - 4)
        sound = inside(spectra, own)
        own = distinct(own.take(sound) if sound.any() else own)
        near = np.flatnonzero(own.evidence > own.evidence[0] - within)
        kept.append(own.take(near[:most]))
    return Rows.joined(kept)


def _with(x: Array, values: Mapping[int, float]) -> Array:
    """Return a copy of a starting point with other values of some slots."""
    new = x.copy()
    new[list(values)] = list(values.values())
    return new


def _fast_ends(spectra: Spectra, axis: int, start: Start) -> Iterator[Model]:
    """Propose models of the fast end of one axis, combined with the usual slow noise."""
    # From far below, a maximum is out of sight: half the power at the top may be quantization.
    x = _with(start.x, {Q: max(start.x[Q], _amplitude_at_top(spectra, axis, Q, 0.5))})
    slow, law = (N, B, K), (N, K, LAW, ALPHA)
    for more in ((), (Q,)):
        yield Model((*slow, *more), x)
        for alpha in (0.5, 0.8, 1.3):
            yield Model((*law, *more), _with(x, {ALPHA: alpha, LAW: x[B]}))
    process = spectra.tables.terms[1]
    for time in np.linspace(process.first[0] + 0.5, process.last[0] - 0.5, 5):
        yield Model((*slow, PROCESS, TIME), _with(x, {TIME: time, PROCESS: 1.5}))
    yield from _filtered(spectra, axis, start, (*slow, LOW), {})
    # Only a fast high-pass, which hides what is below it, takes the place of all slow noise.
    if start.white[0] < 0.5 * start.white.max():
        high = spectra.tables.high_pass
        level = _white(spectra, axis, start, int(start.white.argmax()))
        for corner in np.linspace(high.first[0] + 0.4, high.last[0] - 0.3, 9):
            for more in ((), (Q,)):
                yield Model((N, HIGH, *more), _with(x, {HIGH: corner, N: level}))
    nu, table = spectra.nu, spectra.tables.low_pass
    keys = [shape.key for shape in LOW_PASSES]
    for edge in _edges(nu):
        below = _with(x, {N: _white(spectra, axis, start, int(np.searchsorted(nu, nu[edge] / 3)))})
        yield Model(slow, below, edge=edge)
        # These filters may begin to roll off below an edge.
        for key, corner in (('exponential_average', 2 * np.sin(np.pi * nu[edge])),
                            ('butterworth_2', np.tan(min(np.pi * nu[edge], 1.2)))):
            low_pass = keys.index(key)
            corner = np.clip(np.log(corner), table.first[low_pass], table.last[low_pass])
            yield Model((*slow, LOW), _with(below, {LOW: corner}), low_pass, edge)


def _amplitude_at_top(spectra: Spectra, axis: int, slot: int, share: float = 1.0) -> float:
    """Return the log amplitude of a term with a share of the power at the highest frequency."""
    return float(0.5 * np.log(share * spectra.power[axis, -1] / spectra.design[axis, slot, -1]))


def _may_have_output_noise(spectra: Spectra, start: Start) -> bool:
    """Return whether the level at the top is less than half of the mean level."""
    # With more variance than what it rounds, rounding would be no noise: the output would stand
    # still.
    passed = spectra.nu >= np.exp(spectra.tables.low_pass.first.min())
    mean = np.average(start.white[passed], weights=np.gradient(spectra.nu)[passed])
    return bool(start.white[-1] < 0.5 * mean)


def _white(spectra: Spectra, axis: int, start: Start, group: int) -> float:
    """Return a starting value for white noise: the level of the spectrum at a group."""
    return float(0.5 * np.log(start.white[group]) - np.log(spectra.limit[axis, N]))


def _filtered(spectra: Spectra, axis: int, start: Start, slots: Sequence[int],
              values: Mapping[int, float]) -> Iterator[Model]:
    """Propose every filter at several corners."""
    nu, table = spectra.nu, spectra.tables.low_pass
    for low_pass, shape in enumerate(LOW_PASSES):
        first, last = table.first[low_pass], table.last[low_pass]
        if low_pass == EXPONENTIAL_AVERAGE:
            last = min(spectra.gentlest_corner[axis], last)
        # Each notch of a moving average may be a maximum of its own.
        count = 13 if shape.key == 'moving_average' else 7
        for corner in np.linspace(first + 0.5, max(last - 0.3, first + 0.6), count):
            # Start with white noise at the level of the spectrum in the pass band.
            group = min(int(np.searchsorted(nu, 0.25 * min(np.exp(corner), 1.0))), len(nu) - 1)
            white = _white(spectra, axis, start, group)
            yield Model(slots, _with(start.x, {LOW: corner, N: white, **values}), low_pass)


def _edges(nu: Array) -> Iterator[int]:
    """Yield possible edges: the first group of half-octaves from the top."""
    halves = half_octaves(nu)
    # Farther from the top, every other half-octave is enough.
    for half in (1, 2, 3, 4, *range(5, 21, 2)):
        edge = int(np.searchsorted(halves, -half))
        if edge < FEWEST_GROUPS:
            return
        yield edge


def _distinct_ends(rows: Rows) -> Rows:
    """Return the best row for each of the five best fast ends, given rows with the best first."""
    low_pass = np.where(rows.present[:, LOW], rows.low_pass, -1)
    ends = np.column_stack((low_pass, rows.edge, rows.present[:, FAST]))
    first = np.unique(ends, axis=0, return_index=True)[1]
    return rows.take(np.sort(first)[:5])


def _slow_noises(spectra: Spectra, start: Start, ends: Rows) -> Iterator[Model]:
    """Propose every kind of slow noise, combined with the first of the fast ends of an axis."""
    x, has = ends.x[0].copy(), ends.present[0]
    fast = [slot for slot in FAST if has[slot]]
    low_pass, edge = int(ends.low_pass[0]), int(ends.edge[0])
    for slot in (B, K):
        if not has[slot] or x[slot] < 0:
            x[slot] = max(start.x[slot], 0.3)

    def model(*slots: int, begin: Mapping[int, float] = {}) -> Model:
        return Model((N, *slots, *fast), _with(x, begin), low_pass, edge)

    process, high = spectra.tables.terms[1], spectra.tables.high_pass
    for random_walk in ((), (K,)):
        for flicker in ((), (B,)):
            yield model(*flicker, *random_walk)
            for smooth in (1.0, 4.0):
                yield model(*flicker, SMOOTH, *random_walk, begin={SMOOTH: smooth})
        for time in np.linspace(process.first[0] + 0.4, process.last[0] - 0.2, 6):
            yield model(PROCESS, TIME, *random_walk, begin={TIME: time, PROCESS: 1.5})
            yield model(B, PROCESS, TIME, *random_walk, begin={TIME: time, PROCESS: 1.0})
        for alpha in (0.55, 0.8, 1.2, 1.5):
            yield model(LAW, ALPHA, *random_walk, begin={ALPHA: alpha, LAW: x[B]})
    for corner in np.linspace(high.first[0] + 0.4, high.last[0] - 0.3, 7):
        yield model(HIGH, begin={HIGH: corner})
        yield model(B, HIGH, begin={HIGH: corner})


def _crossed(spectra: Spectra, slow: Rows, end: Rows) -> Rows:
    """Combine the best row of each slow noise with another fast end."""
    noises = slow.present.copy()
    noises[:, FAST] = False
    rows = slow.take(np.sort(np.unique(noises, axis=0, return_index=True)[1]))
    other = end.take(np.zeros(len(rows), np.int64))
    x, present = rows.x.copy(), rows.present.copy()
    x[:, [N, *FAST]], present[:, FAST] = other.x[:, [N, *FAST]], other.present[:, FAST]
    rows = replace(rows, x=x, present=present, low_pass=other.low_pass, edge=other.edge)
    return replace(rows, prior=likelihood.structure_prior(spectra, rows))
