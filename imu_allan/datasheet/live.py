# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A check of a unit on the test bench that ends as soon as the verdict is certain."""

from collections.abc import Mapping
from dataclasses import dataclass

from imu_allan.characterization import Characterization
from imu_allan.datasheet.measured import hidden_by_steps
from imu_allan.datasheet.verdicts import check, Outcome, overall, Verdict
from imu_allan.noise.axis_fit import AxisFit
from imu_allan.noise.sequential import decide, Decision, SMALLEST_RECORD
from imu_allan.noise.terms import LASTING_TERMS
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.wording import duration

GROWTH = 1.15
"""Growth of the record between looks; on average half of it is recorded in vain."""
MARGIN = 0.1
"""A unit whose value is nearer to its limit, by this share, is called neither good nor bad."""


@dataclass(frozen=True)
class CheckState:
    """
    State of a check.

    Attributes
    ----------
    decided : bool
        Whether the verdicts are final.
    verdicts : tuple of Verdict
        The current verdicts; open ones are 'cannot tell'.
    recorded_s : float
        Length of the record in seconds.

    """

    decided: bool
    verdicts: tuple[Verdict, ...]
    recorded_s: float


def check_state(stream: Characterization | Mapping[str, Characterization],
                specification: NoiseModel, *, shortest_s: float = 0.0,
                result: Result | None = None, fits: Mapping[str, AxisFit | None] | None = None
                ) -> CheckState:
    """Compare a unit with its datasheet while it is recorded, each time `next_look` says so."""
    # A mapping has the halves of an IMU whose sensors have different rates, and comes with result
    # and fits.
    halves = {'': stream} if isinstance(stream, Characterization) else stream
    if result is None or fits is None:
        [alone] = halves.values()
        own, fits, _ = alone.fitted()
        result = result or own
    verdicts = check(result, specification, shortest_s=shortest_s)
    recorded = float('inf')
    for record in [each.record() for each in halves.values()]:
        if record is None or record.samples < SMALLEST_RECORD:
            return CheckState(False, tuple(_open(verdict) for verdict in verdicts),
                              result.timeline.duration_s)
        recorded = min(recorded, record.samples / record.rate_hz)
    tested = ('quantization_noise', *LASTING_TERMS)   # keys of the sequential test
    limited = sum(verdict.key in tested for verdict in verdicts)
    # The test applies to the terms of the sensor, not to what a high-pass filter leaves of them.
    raw = {name: fit for name, fit in fits.items()
           if name in result.axes and result.axes[name].high_passed_hz is None}
    settled = []
    for verdict in verdicts:
        axis = result.axes.get(verdict.axis)
        # The output resolution hides the quantity, however long the record is.
        hidden = axis is not None and hidden_by_steps(axis, verdict.key, verdict.limit) is not None
        settled.append(
            _settled(verdict, raw.get(verdict.axis), max(limited, 1), recorded)
            if verdict.key in tested and not hidden
            else (verdict, hidden or verdict.verdict != 'cannot tell'))
    found = [verdict for verdict, _ in settled]
    if recorded < shortest_s:
        found = [_open(verdict) if verdict.verdict == 'pass' else verdict for verdict in found]
        return CheckState(overall(found) == 'fail', tuple(found), recorded)
    if overall(found) == 'fail':
        # One failure decides. Other limits may be exceeded as well, but need more data to show it.
        why = 'left open, as the unit fails already'
        found = [verdict if done else _open(verdict, why) for verdict, done in settled]
        return CheckState(True, tuple(found), recorded)
    return CheckState(all(done for _, done in settled), tuple(found), recorded)


def _settled(verdict: Verdict, fitted: AxisFit | None, limited: int, recorded_s: float
             ) -> tuple[Verdict, bool]:
    """Apply the sequential test to one coefficient; return the verdict and whether it is final."""
    if fitted is None:
        # A missing, constant or dead axis has already failed.
        return verdict, verdict.verdict == 'fail'
    if verdict.value is None and verdict.ci95 is None and verdict.verdict == 'fail':
        return verdict, True
    if fitted.fit.power_law is not None and verdict.key == 'bias_instability':
        # Without flicker there is nothing to test but the curve.
        return verdict, verdict.verdict != 'cannot tell'
    if not fitted.fit.acceptable or verdict.limit <= 0:
        return _open(verdict), False
    # A good unit may fail at any of its limits by chance, so these share the error. A bad unit
    # passes only if its bad term passes.
    decision = decide(fitted.fit.estimates[verdict.key], verdict.limit, margin=MARGIN,
                      pass_error=0.05, fail_error=0.05 / limited)
    if decision == 'open':
        return _open(verdict), False
    after = f'after {duration(recorded_s)}'
    said: dict[Decision, tuple[Outcome, str]] = {
        'below': ('pass', f'below {verdict.specified}, certain {after}'),
        'above': ('fail', f'above {verdict.specified}, certain {after}'),
        'near': ('cannot tell', f'within {100 * MARGIN:.0f} % of {verdict.specified} {after}')}
    return verdict.judged(*said[decision]), True


def _open(verdict: Verdict, why: str = 'nothing is certain yet; record for longer') -> Verdict:
    faulty = verdict.verdict == 'fail' and verdict.value is None
    return verdict if faulty else verdict.judged('cannot tell', why)


def next_look(samples: int) -> int:
    """Return the number of samples at which to look again."""
    return max(SMALLEST_RECORD, round(samples * GROWTH))
