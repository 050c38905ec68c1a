# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What may be published of the fits of a growing record, in one place because each is a look at it.

A test that is made sixty times is passed by chance more often than one that is made once. The
odds for a term that is not there are a martingale: they ever reach n to 1 with a probability of
1/n at most, however often one looks (Ville). So where a fit tells how probable a term is, it is
observable once that is sure enough for all terms of a run together. Where it does not, once every
fit has shown it since the record was `GROWTH` times shorter: a record has few such stretches.
"""

from dataclasses import replace

from imu_allan.result import Coefficient, Result

FALSE_RUNS = 0.01
"""Share of runs that may show any term that is not there."""
GROWTH = 3.0
"""The record grows by this while every fit has to show a term, which costs as much time. Of 44
runs of 60 fits of drawn records 31 showed a term that is not there or an interval that misses, and
99 of 134 terms vanished again; with 2 it were 10 runs and 12 of 45 terms, with 3 5 and 5 of 26."""
ONE_LOOK_S = 600.0
"""The first look at a record of so long, as after a restart, is one; a shorter one is followed by
others at once."""
RECEDES = 1.25
"""A time that is expected may move so much while the record grows by `GROWTH`, as by chance."""
_LEAST_USED = 0.1
"""Of the messages: where fewer become part of the record, nothing is to be expected of time."""
_AT_ONCE = 'noise_density'
"""Shows in the shortest record, and has nothing to be mistaken for."""
_Key = tuple[str, str]


class SequentialLooks:
    """Looks at the results of one run, one after the other."""

    def __init__(self) -> None:
        self._messages = 0
        self._record_s = 0.0
        self._first_s = 0.0
        self._growing = True
        self._doubt = 0.0
        self._hidden_s: dict[_Key, float] = {}
        self._shown: set[_Key] = set()
        self._expected: dict[_Key, list[tuple[float, float]]] = {}

    def judged(self, result: Result, *, more_comes: bool = True) -> Result:
        """Return the result as it may be published; nothing is expected where no more comes."""
        self._see_growth(result)
        self._growing &= more_comes
        self._doubt = FALSE_RUNS / max(1, sum(
            term != _AT_ONCE for axis in result.axes.values() for term in axis.coefficients))
        return replace(result, axes={name: replace(axis, coefficients={
            term: self._coefficient((name, term), found)
            for term, found in axis.coefficients.items()})
            for name, axis in result.axes.items()})

    def _see_growth(self, result: Result) -> None:
        """Note whether what comes makes the record longer: not in motion, nor on held values."""
        timeline = result.timeline
        messages = (timeline.samples + timeline.duplicates + timeline.out_of_order
                    + timeline.rejected)
        rate, record_s = timeline.sample_rate_hz, used_s(result)
        if rate and messages > self._messages:
            added = (record_s - self._record_s) * rate
            self._growing = added > _LEAST_USED * (messages - self._messages)
        if not self._messages:
            self._first_s = record_s if record_s < ONE_LOOK_S else 0.0
        self._messages, self._record_s = messages, record_s

    def _coefficient(self, key: _Key, found: Coefficient) -> Coefficient:
        if not found.observable:
            self._hidden_s[key] = self._record_s
            self._shown.discard(key)
            return replace(found, observable_in_s=self._steady_wait(key, found.observable_in_s))
        presence: float | None = getattr(found, 'presence', None)
        wait_s = GROWTH * self._hidden_s.get(key, self._first_s) - self._record_s
        sure = wait_s <= 0 if presence is None else 1 - presence <= self._doubt
        if sure or key in self._shown or key[1] == _AT_ONCE:
            self._shown.add(key)
            return found
        bound = None if found.ci95 is None else max(map(abs, found.ci95))
        return replace(found, observable=False, value=None, ci95=None, upper95=bound,
                       observable_in_s=wait_s if self._growing and presence is None else None,
                       ci_halves_in_s=None, between=None)

    def _steady_wait(self, key: _Key, wait_s: float | None) -> float | None:
        """Give a wait whose end has not receded since the record was `GROWTH` times shorter."""
        if wait_s is None:
            self._expected.pop(key, None)
            return None
        now_s, looks = self._record_s, self._expected.setdefault(key, [])
        looks.append((now_s, now_s + wait_s))
        while len(looks) > 1 and GROWTH * looks[1][0] <= now_s:
            looks.pop(0)
        known = GROWTH * looks[0][0] <= now_s
        steady = now_s + wait_s <= RECEDES * min(end_s for _, end_s in looks)
        return wait_s if self._growing and known and steady else None


def used_s(result: Result) -> float:
    """Time of the samples that a result was made of: neither in a gap nor in motion."""
    timeline = result.timeline
    if not timeline.sample_rate_hz:
        return 0.0
    moved_s = sum(span.duration_s for span in timeline.motion)
    return max(timeline.samples / timeline.sample_rate_hz - moved_s, 0.0)
