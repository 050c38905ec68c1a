# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Comparison of a running IMU with its datasheet and with an earlier result."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.datasheet import check, check_state, CheckState, next_look, Verdict, zero_bias
from imu_allan.node.parameters import at_home, naming_parameter
from imu_allan.noise.terms import AXES
from imu_allan.result import Result
from imu_allan.sensor.noise_model import load_model, NoiseModel
from imu_allan.wording import counted, duration, number
from imu_allan.writers.datasheet import summary
from imu_allan.writers.result_files import load_result

Level = Literal['ok', 'warn', 'error']


@dataclass(frozen=True)
class Comparison:
    """How the IMU compares with one standard."""

    standard: str
    level: Level
    message: str


class DatasheetLooks:
    """
    Looks at one run against its datasheet, rare enough for verdicts to be as certain as stated.

    With frequent looks, a good unit is above its limit at some of them. The sequential test allows
    for that if each look waits until the record has the length given by `next_look`.
    """

    def __init__(self) -> None:
        self._next = next_look(0)
        self._decided: CheckState | None = None

    def decided(self, result: Result, records: Sequence[FinishedRecord | None],
                specification: NoiseModel) -> CheckState | None:
        """Look again if it is time to; return the verdict once it is certain, else None."""
        samples = result.timeline.samples
        if self._decided is None and samples >= self._next:
            self._next = next_look(samples)
            now = check_state(result, records, specification)
            self._decided = now if now.decided else None
        return self._decided


class Standards:
    """The standards that the parameters of the node name."""

    def __init__(self, spec_file: str = '', reference: str = '') -> None:
        with naming_parameter('spec_file'):
            self._specification = load_model(at_home(spec_file)) if spec_file else None
        with naming_parameter('reference'):
            self._reference = load_result(at_home(reference)) if reference else None

    def judge(self, result: Result, records: Sequence[FinishedRecord | None],
              looks: DatasheetLooks) -> list[Comparison]:
        """Compare a result with every standard."""
        said: dict[str, tuple[Level, str]] = {}
        nothing: tuple[Level, str] = 'warn', 'cannot tell yet: no axis has a result'
        if self._specification is not None:
            said['specification'] = nothing if not result.axes else _against_specification(
                check(result, self._specification),
                looks.decided(result, records, self._specification))
        if self._reference is not None:
            said['reference'] = (nothing if not result.axes else
                                 _against_reference(result, self._reference))
        return [Comparison(standard, *found) for standard, found in said.items()]


def _against_specification(verdicts: Sequence[Verdict], decided: CheckState | None
                           ) -> tuple[Level, str]:
    outcome, sentences = summary(verdicts)
    if decided is None:
        return 'warn', f'not certain yet: {"; ".join(sentences) or "no limit is broken so far"}'
    if outcome != 'fail':
        # An IMU that has passed may break a limit later; until then the verdict holds.
        outcome, sentences = summary(decided.verdicts)
    if outcome == 'pass':
        return 'ok', ('every limit of the specification is kept, certain after '
                      f'{duration(decided.recorded_s)}')
    return 'error' if outcome == 'fail' else 'warn', '; '.join(sentences)


def _against_reference(result: Result, reference: Result) -> tuple[Level, str]:
    shared = [axis for axis in AXES if axis in result.axes and axis in reference.axes]
    if not shared:
        return 'warn', 'cannot tell: the reference has none of these axes'
    if departures := [text for axis in shared for text in _departures(axis, result, reference)]:
        return 'warn', '; '.join(departures)
    compared = sum(result.axes[axis].coefficients['noise_density'].ci95 is not None
                   for axis in shared)
    if not compared:
        return 'warn', 'cannot tell yet: no noise density is observable'
    return 'ok', f'as in the reference: {counted(compared, "axis", "axes")}'


def _departures(name: str, result: Result, reference: Result) -> Iterator[str]:
    """Yield what of an axis differs from the reference by more than both are uncertain."""
    now, before = result.axes[name], reference.axes[name]
    a, b = now.coefficients['noise_density'], before.coefficients['noise_density']
    if (a.value is not None and b.value is not None and a.ci95 and b.ci95
            and (a.ci95[0] > b.ci95[1] or a.ci95[1] < b.ci95[0])):
        yield (f'{name}: noise density {number(a.value)} {a.unit}, '
               f'{number(b.value)} in the reference')
    # The reading of an accelerometer at rest depends on its orientation.
    if not name.startswith('gyro') or now.mean is None or before.mean is None:
        return
    apart = zero_bias(result, name, before.mean), zero_bias(reference, name, now.mean)
    errors = [found.ci95[1] - found.value for found in apart
              if found.ci95 is not None and found.value is not None]
    if len(errors) == len(apart) and abs(now.mean - before.mean) > sum(errors):
        yield f'{name}: bias {number(now.mean)} {now.unit}, {number(before.mean)} in the reference'
