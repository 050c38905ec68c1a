# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Search for the models that matter: first the fast end of the spectrum, then the slow noise.

All axes are searched together, so that each step is one batch.
"""

from collections.abc import Iterator, Mapping, Sequence

from imu_allan.arrays import Array, Bools
from imu_allan.noise.posterior.evidence import distinct, inside, maximise_rows, sees_pass_band
from imu_allan.noise.posterior.judgments import PER_HALF_OCTAVE, TOP
from imu_allan.noise.posterior.likelihood import (
    GENTLE_FAMILY,
    half_octaves,
    HIGH,
    LOW,
    PLAIN,
    Rows,
    SLOTS,
    Spectra,
    structure_prior,
)
from imu_allan.noise.posterior.prepared import Start
from imu_allan.noise.posterior.shapes import FEWEST_GROUPS, LOW_PASSES
import numpy as np

Q, N, B, K, OUTPUT, SMOOTH = range(PLAIN)
LAW, ALPHA, PROCESS, TIME = range(PLAIN, PLAIN + 4)
KEPT = 7.0
"""Nats below the best at which a model is dropped: e^-7 is negligible."""
MOST = 16
"""Most models per axis."""
FAST = (Q, OUTPUT, LOW)
"""Slots of the shapes that change the fast end of the spectrum."""


class Proposals:
    """Collects models of one axis to be fitted."""

    def __init__(self, spectra: Spectra, of: int) -> None:
        self._spectra, self._of = spectra, of
        self._found: list[tuple[Bools, int, int, Array, float]] = []

    def add(self, slots: Sequence[int], x: Array, family: int = 0, edge: int | None = None,
            prior: float = 0.0) -> None:
        """Add a model with the shapes in `slots`, to be fitted from `x`."""
        has = np.zeros(SLOTS, dtype=bool)
        has[list(slots)] = True
        total = prior + structure_prior(self._spectra.tables,
                                        float(self._spectra.gentle[self._of]), has, family)
        groups = self._spectra.dof.shape[1]
        self._found.append((has, family, groups if edge is None else edge, x, total))

    def rows(self) -> Rows:
        """Return the collected models as rows that are not fitted yet."""
        has, family, edge, x, prior = zip(*self._found, strict=True)
        count = len(has)
        nothing = np.zeros(count)
        return Rows(np.full(count, self._of), np.array(x), np.array(has), np.array(family),
                    np.array(edge), np.array(prior), nothing,
                    np.zeros((count, SLOTS, SLOTS)), nothing)


def search_models(spectra: Spectra, starts: Sequence[Start], dt: float) -> Rows:
    """
    Fit every model that may matter, for all axes.

    Parameters
    ----------
    spectra : Spectra
        Spectra of all axes.
    starts : sequence of Start
        Starting point for each spectrum.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    Rows
        At most `MOST` per axis, the best first.

    """
    fast = Rows.joined([_fast_ends(spectra, axis, start, dt)
                        for axis, start in enumerate(starts)])
    fast = maximise_rows(spectra, fast, hopeless=16.0, on_grid=True)
    # Nats below the best at which a fast end, or a slow noise, is dropped.
    kept = 12.0
    fast = best_of(spectra, fast, kept, 12)
    behind = _behind_filters(spectra, starts, fast, dt)
    if len(behind):
        behind = maximise_rows(spectra, behind, hopeless=16.0, on_grid=True)
        fast = best_of(spectra, Rows.joined([fast, behind]), kept, 12)
    ends = [_ends(spectra, fast, axis, start) for axis, start in enumerate(starts)]
    slow = Rows.joined([_slow_noises(spectra, axis, start, own.take(np.array([0])))
                        for axis, (start, own) in enumerate(zip(starts, ends, strict=True))])
    slow = maximise_rows(spectra, slow, hopeless=16.0, on_grid=True)
    found = best_of(spectra, slow, kept, 8)
    crossed = [rows for axis, own in enumerate(ends) for rows in _crossed(
        spectra, axis, own, of_axis(found, axis))]
    if crossed:
        more = maximise_rows(spectra, Rows.joined(crossed), hopeless=16.0)
        found = Rows.joined([found, more])
    return best_of(spectra, found, KEPT, MOST)


def of_axis(rows: Rows, axis: int) -> Rows:
    """Return the rows of one axis."""
    return rows.take(np.flatnonzero(rows.of == axis))


def best_of(spectra: Spectra, rows: Rows, within: float, most: int) -> Rows:
    """Return up to `most` distinct rows per axis `within` nats of its best, the best first."""
    kept = []
    for axis in np.unique(rows.of).tolist():
        own = of_axis(rows, axis)
        own = own.take(np.flatnonzero(own.evidence > own.evidence.max() - within - 4))
        within_range = np.flatnonzero(inside(spectra, own) & sees_pass_band(spectra, own))
        own = distinct(own.take(within_range) if len(within_range) else own)
        near = np.flatnonzero(own.evidence > own.evidence[0] - within)
        kept.append(own.take(near[:most]))
    return Rows.joined(kept)


def _with(x: Array, values: Mapping[int, float]) -> Array:
    """Return a copy of a starting point with other values of some slots."""
    new = x.copy()
    for slot, value in values.items():
        new[slot] = value
    return new


def _fast_ends(spectra: Spectra, axis: int, start: Start, dt: float) -> Rows:
    """Propose models of the fast end of one axis, combined with the usual slow noise."""
    nu = np.minimum(spectra.frequency * dt, 0.5)
    own = Proposals(spectra, axis)
    # From far below, a maximum is out of sight: half the power at the top may be quantization.
    top = 0.5 * np.log(0.5 * spectra.power[axis, -1] / spectra.columns[axis, Q, -1])
    x = _with(start.x, {Q: max(start.x[Q], top)})
    slow, law = (N, B, K), (N, K, LAW, ALPHA)
    table = spectra.tables.low_pass
    for more in ((), (Q,)):
        own.add((*slow, *more), x)
        for alpha in (0.5, 0.8, 1.3):
            own.add((*law, *more), _with(x, {ALPHA: alpha, LAW: x[B]}))
    process = spectra.tables.terms[1]
    for time in np.linspace(process.first[0] + 0.5, process.last[0] - 0.5, 5):
        own.add((*slow, PROCESS, TIME), _with(x, {TIME: time, PROCESS: 1.5}))

    unit = float(spectra.unit[axis, N])**2
    _filtered(own, spectra, axis, start, dt, (*slow, LOW), {})
    for half, edge in _edges(nu):
        prior = TOP + PER_HALF_OCTAVE * half
        below = _with(x, {N: 0.5 * np.log(
            start.white[int(np.searchsorted(nu, nu[edge] / 3))] / unit)})
        own.add(slow, below, edge=edge, prior=prior)
        # These filters may begin to roll off below an edge.
        for key in ('recursive_mean', 'butterworth_2'):
            family = next(k for k, shape in enumerate(LOW_PASSES) if shape.key == key)
            corner = _corner_at(key, float(nu[edge]))
            corner = np.clip(np.log(corner), table.first[family], table.last[family])
            own.add((*slow, LOW), _with(below, {LOW: corner}), family, edge, prior)
    return own.rows()


def _behind_filters(spectra: Spectra, starts: Sequence[Start], fast: Rows, dt: float) -> Rows:
    """Propose output noise after a filter, for axes whose best model has an unexplained top."""
    found = fast.take(np.zeros(0, np.int64))
    for axis, start in enumerate(starts):
        if of_axis(fast, axis).edge[0] < spectra.dof.shape[1]:
            own = Proposals(spectra, axis)
            last = 0.5 * np.log(spectra.power[axis, -1] / spectra.columns[axis, OUTPUT, -1])
            _filtered(own, spectra, axis, start, dt, (N, B, K, OUTPUT, LOW),
                      {OUTPUT: last})
            found = Rows.joined([found, own.rows()])
    return found


def _filtered(own: Proposals, spectra: Spectra, axis: int, start: Start, dt: float,
              slots: Sequence[int], values: Mapping[int, float]) -> None:
    """Propose every filter at several corners."""
    nu, table = np.minimum(spectra.frequency * dt, 0.5), spectra.tables.low_pass
    unit = float(spectra.unit[axis, N])**2
    for family in range(len(LOW_PASSES)):
        first, last = table.first[family], table.last[family]
        last = min(spectra.gentle[axis], last) if family == GENTLE_FAMILY else last
        # Each notch of a moving mean may be a maximum of its own.
        count = 13 if LOW_PASSES[family].key == 'moving_mean' else 7
        for corner in np.linspace(first + 0.5, max(last - 0.3, first + 0.6), count):
            at = int(np.searchsorted(nu, 0.25 * min(np.exp(corner), 1.0)))
            # Start with white noise at the level of the spectrum in the pass band.
            white = 0.5 * np.log(start.white[min(at, len(nu) - 1)] / unit)
            own.add(slots, _with(start.x, {LOW: corner, N: white, **values}), family)


def _edges(nu: Array) -> Iterator[tuple[int, int]]:
    """Yield possible edges as (half-octaves from the top, first group above the edge)."""
    halves = half_octaves(nu)
    # Farther from the top, every other half-octave is enough.
    for half in (1, 2, 3, 4, *range(5, 21, 2)):
        edge = int(np.searchsorted(halves, -half))
        if edge < FEWEST_GROUPS:
            return
        yield half, edge


def _corner_at(key: str, nu: float) -> float:
    """Return a starting value for the corner of a filter that rolls off near frequency `nu`."""
    if key == 'recursive_mean':
        return float(2 * np.sin(np.pi * nu))
    return float(np.tan(min(np.pi * nu, 1.2))) if key == 'butterworth_2' else 2.5 * nu


def _ends(spectra: Spectra, fast: Rows, axis: int, start: Start) -> Rows:
    """Return the best row for each of the best fast ends of an axis, and one without any."""
    own = of_axis(fast, axis)
    seen: dict[tuple[int, ...], int] = {}
    for i, end in enumerate(fast_ends(own)):
        seen.setdefault(end, i)
    kept = own.take(np.array(list(seen.values())[:5]))
    if any(_fast_part(kept.take(np.array([i]))) == [] and kept.edge[i] == spectra.dof.shape[1]
           for i in range(len(kept))):
        return kept
    # The effect of a high-pass can pass for an edge, so a plain fast end is fitted as well.
    plain = Proposals(spectra, axis)
    plain.add((N, B, K), start.x)
    return Rows.joined([kept, plain.rows()])


def fast_ends(rows: Rows) -> list[tuple[int, ...]]:
    """Return what describes the fast end of the spectrum: the shapes, the filter and the edge."""
    family = np.where(rows.has[:, LOW], rows.family, -1)
    return [*map(tuple, np.column_stack((family, rows.edge, rows.has[:, FAST])).tolist())]


def _fast_part(row: Rows) -> list[int]:
    """Return the slots of a row that change the fast end of the spectrum."""
    return [slot for slot in FAST if row.has[0, slot]]


def extra_prior(spectra: Spectra, row: Rows) -> float:
    """Return the part of the prior of a row that is not of its structure: that of an edge."""
    return float(row.prior[0]) - structure_prior(
        spectra.tables, float(spectra.gentle[row.of[0]]), row.has[0], int(row.family[0]))


def _slow_noises(spectra: Spectra, axis: int, start: Start, end: Rows) -> Rows:
    """Propose every kind of slow noise, combined with one fast end."""
    own, fast, prior = Proposals(spectra, axis), _fast_part(end), extra_prior(spectra, end)
    x = end.x[0].copy()
    for slot in (B, K):
        if not end.has[0, slot] or x[slot] < 0:
            x[slot] = max(start.x[slot], 0.3)

    def add(*slots: int, begin: Mapping[int, float] = {}) -> None:
        own.add((N, *slots, *fast), _with(x, begin), int(end.family[0]), int(end.edge[0]), prior)

    process, high = spectra.tables.terms[1], spectra.tables.high_pass
    for random_walk in ((), (K,)):
        for flicker in ((), (B,)):
            add(*flicker, *random_walk)
            for smooth in (1.0, 4.0):
                add(*flicker, SMOOTH, *random_walk, begin={SMOOTH: smooth})
        for time in np.linspace(process.first[0] + 0.4, process.last[0] - 0.2, 6):
            add(PROCESS, TIME, *random_walk, begin={TIME: time, PROCESS: 1.5})
            add(B, PROCESS, TIME, *random_walk, begin={TIME: time, PROCESS: 1.0})
        for alpha in (0.55, 0.8, 1.2, 1.5):
            add(LAW, ALPHA, *random_walk, begin={ALPHA: alpha, LAW: x[B]})
    for corner in np.linspace(high.first[0] + 0.4, high.last[0] - 0.3, 7):
        add(HIGH, begin={HIGH: corner})
        add(B, HIGH, begin={HIGH: corner})
    return own.rows()


def _crossed(spectra: Spectra, axis: int, ends: Rows, slow: Rows) -> list[Rows]:
    """Propose the best slow noises, combined with each of the other fast ends."""
    if len(ends) < 2:
        return []
    own = Proposals(spectra, axis)
    for k in range(1, len(ends)):
        end = ends.take(np.array([k]))
        prior, fast = extra_prior(spectra, end), _fast_part(end)
        seen = set()
        for i in range(len(slow)):
            has = slow.has[i].copy()
            has[[*FAST]] = False
            if has.tobytes() in seen:
                continue
            seen.add(has.tobytes())
            x = slow.x[i].copy()
            for slot in (N, *FAST):
                x[slot] = end.x[0, slot]
            own.add((*np.flatnonzero(has).tolist(), *fast), x, int(end.family[0]),
                    int(end.edge[0]), prior)
    return [own.rows()]
