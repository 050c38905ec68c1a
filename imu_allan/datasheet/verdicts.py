# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Verdicts on the quantities that a datasheet limits.

A specification gives an upper limit for a quantity. The measured 95 % interval decides, not the
value. If the interval, or the upper bound of an unobservable term, is below the limit, the
quantity passes. If the interval is above the limit, it fails; otherwise this recording cannot
tell. An axis that measures nothing fails all its limits.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from imu_allan.datasheet.measured import fault_of, Measured, of_limit, stopped
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.sensor.noise_model import LIMITS, NoiseModel
from imu_allan.wording import duration

Outcome = Literal['pass', 'fail', 'cannot tell']


@dataclass(frozen=True)
class Verdict:
    """
    One quantity of one axis compared with its limit.

    Attributes
    ----------
    axis, key, symbol, unit : str
        The quantity, and the SI unit of `limit`, `value`, `ci95` and `upper95`.
    limit : float
        The largest value that the specification allows.
    specified : str
        The limit as written in the file.
    value, ci95, upper95 : optional
        Measured magnitudes; None as in the result.
    ratio : float or None
        `value` divided by `limit`.
    verdict : 'pass', 'fail' or 'cannot tell'
    reason : str
        Reason in one sentence.

    """

    axis: str
    key: str
    symbol: str
    unit: str
    limit: float
    specified: str
    value: float | None
    ci95: tuple[float, float] | None
    upper95: float | None
    ratio: float | None
    verdict: Outcome
    reason: str

    def judged(self, verdict: Outcome, why: str) -> 'Verdict':
        """Return the comparison with another outcome, and why it has that."""
        return replace(self, verdict=verdict, reason=f'{self.axis} {self.symbol}: {why}')


def check(result: Result, specification: NoiseModel, *, shortest_s: float = 0.0) -> list[Verdict]:
    """Compare a result with a specification; nothing passes that is shorter than `shortest_s`."""
    verdicts = [_verdict(result, specification, axis, key, limit)
                for axis, key, limit in _limits(specification)]
    if not verdicts:
        raise ImuAllanError('the specification limits no coefficient; write for instance '
                            'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    recorded = result.timeline.rest_s
    if recorded < shortest_s:
        short = f'{duration(recorded)} of data, and no less than {duration(shortest_s)} may pass'
        verdicts = [one.judged('cannot tell', short) if one.verdict == 'pass' else one
                    for one in verdicts]
    return verdicts


def overall(verdicts: Sequence[Verdict]) -> Outcome:
    """Return 'fail' if any quantity fails, else 'cannot tell' if any is undecided, else 'pass'."""
    outcomes = {verdict.verdict for verdict in verdicts}
    return 'fail' if 'fail' in outcomes else 'cannot tell' if 'cannot tell' in outcomes else 'pass'


def _limits(specification: NoiseModel) -> Iterator[tuple[str, str, float]]:
    """Yield axis, key and limit, in order."""
    for axis in AXES:
        terms, others = specification.axes.get(axis, {}), specification.limits.get(axis, {})
        yield from ((axis, key, abs(terms[key])) for key in TERMS if key in terms)
        yield from ((axis, key, others[key]) for key in LIMITS if key in others)


def _verdict(result: Result, specification: NoiseModel, axis: str, key: str, limit: float
             ) -> Verdict:
    quantity = AXES[axis]
    symbol = TERMS[key].symbol if key in TERMS else key.replace('_', ' ').replace(
        'turn on', 'turn-on')
    unit = TERMS[key].unit(quantity) if key in TERMS else quantity.unit + LIMITS[key]
    written = specification.as_written.get(axis, {}).get(key) or f'{limit!r} {unit}'
    fault = stopped(result) or fault_of(
        result.axes.get(axis), specification.axes.get(axis, {}).get('noise_density'))
    measured = Measured() if fault is not None else of_limit(result, axis, key, specification)
    outcome, reason = _decide(measured, limit, printable(written), fault)
    value = measured.value
    # With a limit close to zero, the ratio would overflow.
    ratio = None if value is None or limit <= 0 or value > limit * 1e300 else value / limit
    return Verdict(axis, key, symbol, unit, limit, written, value, measured.ci95, measured.upper95,
                   ratio, outcome, f'{axis} {symbol}: {reason}')


def _decide(measured: Measured, limit: float, shown: str, fault: str | None
            ) -> tuple[Outcome, str]:
    if fault is not None:
        return 'fail', fault
    if measured.undecided is not None:
        return 'cannot tell', measured.undecided
    if measured.ci95 is None:
        if measured.upper95 is not None and measured.upper95 <= limit:
            return 'pass', f'not observable, and with 95 % confidence below {shown}'
        return 'cannot tell', 'not observable in this recording; record for longer'
    low, high = measured.ci95
    if high <= limit:
        return 'pass', f'the 95 % interval is below {shown}'
    if low > limit:
        return 'fail', f'the 95 % interval is above {shown}'
    return 'cannot tell', f'the 95 % interval reaches across {shown}; record for longer'
