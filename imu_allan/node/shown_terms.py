# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decide which terms and findings of repeated fits to a growing record may be published.

A test that is repeated sixty times is passed by chance more often than a single one. Therefore a
term is observable only if every fit has shown it since the record was `GROWTH` times shorter.
However many fits there are, a record has few such periods. If the fit gives a term a probability,
this has to be high, too.
"""

from dataclasses import dataclass, field, replace

from imu_allan.result import Coefficient, Result
from imu_allan.state import Record

GROWTH = 3.0
"""Every fit has to show a term while the record grows by this factor, which delays the term.
Otherwise 21 of 186 ten-minute axes, fitted 47 times each, show a wrong term at some fit, however
probable. It is absent, or its interval misses by half (`bench_looks.py --fit-growth 0.03`)."""
PROBABLE = 0.99
"""Smallest probability of a term: one in a hundred is wrong if the fit's probabilities are right.
Of 450 terms of 75 IMUs, 29 were shown and 1 was wrong (`bench/bench_looks.py --seeds 100:125`).
With 0.9, 1 of 14 is wrong on the axes above: flicker taken for a random walk."""
BY_CHANCE = frozenset((
    'band_limited', 'bias_step', 'gauss_markov', 'high_passed', 'not_steady', 'poor_fit',
    'power_law', 'slow_cycle', 'thermometer', 'tones', 'trend_or_walk', 'warm_up'))
"""Findings that a fit may have by chance: two in a row have to. Of 12 IMUs, 25 are then published
and 7 of them withdrawn, instead of 31 and 13 (`bench_looks.py --seeds 0:3`, and `--at-once`)."""


@dataclass
class ShownTerms(Record):
    """
    The terms that successive results of one run have shown, also before a restart.

    Another thread may save them meanwhile, so attributes are replaced, never changed in place.
    """

    messages: int = 0
    record_s: float = 0.0
    first_s: float = 0.0
    hidden_s: dict[str, float] = field(default_factory=dict)
    shown: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._growing = True
        self._expected: dict[str, list[tuple[float, float]]] = {}
        self._found: set[tuple[str, str]] = set()

    def judged(self, result: Result, *, more_comes: bool = True) -> Result:
        """Return the result to publish; waiting times are given only if `more_comes`."""
        self._see_growth(result)
        self._growing &= more_comes
        axes, unsure = {}, set()
        for name, axis in result.axes.items():
            trend = axis.trend
            # A dependence on temperature may be chance, too.
            if not self._lasts(f'{name}/temperature',
                               trend is not None and trend.temperature is not None):
                unsure.add(name)
                trend = None if trend is None else replace(trend, temperature=None)
            axes[name] = replace(axis, trend=trend, coefficients={
                term: self._coefficient(f'{name}/{term}', found)
                for term, found in axis.coefficients.items()})
        before, self._found = self._found, {
            (one.code, axis) for one in result.warnings for axis in one.axes or ('',)}
        return replace(result, axes=axes, warnings=tuple(
            one for one in result.warnings
            if (one.code != 'temperature' or not unsure.intersection(one.axes))
            and (one.code not in BY_CHANCE or not more_comes or any(
                (one.code, axis) in before for axis in one.axes or ('',)))))

    def _see_growth(self, result: Result) -> None:
        """Note whether messages make the record longer: not in motion, nor with held values."""
        timeline = result.timeline
        messages = (timeline.samples + timeline.duplicates + timeline.out_of_order
                    + timeline.rejected)
        rate = timeline.sample_rate_hz
        record_s = timeline.rest_s
        if rate and messages > self.messages:
            added = (record_s - self.record_s) * rate
            # If fewer become part of the record, waiting is of no use.
            self._growing = added > 0.1 * (messages - self.messages)
        if not self.messages:
            # A first look at ten minutes counts as one; shorter records are soon looked at again.
            self.first_s = record_s if record_s < 600.0 else 0.0
        self.messages, self.record_s = messages, record_s

    def _coefficient(self, key: str, found: Coefficient) -> Coefficient:
        probable = found.presence is None or found.presence >= PROBABLE
        # Noise density shows in the shortest record and cannot be confused with other terms.
        lasts = self._lasts(key, found.observable, probable, key.endswith('/noise_density'))
        if not found.observable:
            return replace(found, observable_in_s=self._steady_wait(key, found.observable_in_s))
        if lasts:
            return found
        bound = None if found.ci95 is None else max(map(abs, found.ci95))
        return replace(found, observable=False, value=None, ci95=None, upper95=bound,
                       observable_in_s=self._wait_s(key) if self._growing and probable else None,
                       ci_halves_in_s=None, between=None)

    def _lasts(self, key: str, seen: bool, probable: bool = True, at_once: bool = False) -> bool:
        """Note whether a fit shows something, and return whether that may be published."""
        if not seen:
            self.hidden_s = {**self.hidden_s, key: self.record_s}
        lasts = seen and ((probable and self._wait_s(key) <= 0) or key in self.shown or at_once)
        self.shown = [*(one for one in self.shown if one != key), *([key] if lasts else [])]
        return lasts

    def _wait_s(self, key: str) -> float:
        return GROWTH * self.hidden_s.get(key, self.first_s) - self.record_s

    def _steady_wait(self, key: str, wait_s: float | None) -> float | None:
        """Return a wait if its end has not receded since the record was `GROWTH` times shorter."""
        if wait_s is None:
            self._expected.pop(key, None)
            return None
        now_s, looks = self.record_s, self._expected.setdefault(key, [])
        looks.append((now_s, now_s + wait_s))
        while len(looks) > 1 and GROWTH * looks[1][0] <= now_s:
            looks.pop(0)
        known = GROWTH * looks[0][0] <= now_s
        # Allow for random variation by a quarter.
        steady = now_s + wait_s <= 1.25 * min(end_s for _, end_s in looks)
        return wait_s if self._growing and known and steady else None
