# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reasons and figures of verdicts as text, in the units of the datasheet."""

from collections.abc import Sequence

from imu_allan.datasheet.verdicts import Outcome, overall, Verdict
from imu_allan.sensor.units import convert, unit_of
from imu_allan.wording import measured, number


def summary(verdicts: Sequence[Verdict]) -> tuple[Outcome, list[str]]:
    """Return the verdict on the whole sensor, and the reasons against a pass, with figures."""
    outcome = overall(verdicts)
    return outcome, [_with_figures(verdict) for verdict in verdicts
                     if verdict.verdict == outcome != 'pass']


def reasons(verdicts: Sequence[Verdict]) -> tuple[list[str], list[int | None]]:
    """Return why quantities do not pass, failures first, and the number of each one's reason."""
    keys = [None if verdict.verdict == 'pass' else (
        verdict.verdict, _with_figures(verdict).removeprefix(
            f'{verdict.axis} {verdict.symbol}: ')) for verdict in verdicts]
    order = sorted({key for key in keys if key is not None},
                   key=lambda key: (key[0] != 'fail', keys.index(key)))
    sentences = [', '.join(f'{verdict.axis} {verdict.symbol}' for verdict, own in zip(
        verdicts, keys, strict=True) if own == key) + f': {key[1]}' for key in order]
    return sentences, [None if key is None else order.index(key) + 1 for key in keys]


def in_written_unit(verdict: Verdict, value: float) -> str:
    """Return a value in the unit that the specification uses, as text without the unit."""
    return number(convert(value, verdict.unit, unit_of(verdict.specified)))


def with_interval(verdict: Verdict, value: float, bounds: tuple[float, float]
                  ) -> tuple[str, str, str]:
    """Return value and interval in the unit of the specification, with matching digits."""
    unit = unit_of(verdict.specified)
    shown = measured(*(convert(number, verdict.unit, unit) for number in (value, *bounds)))
    limit = convert(verdict.limit, verdict.unit, unit)
    if [_side(float(text), limit) for text in shown[1:]] != [
            _side(bound, verdict.limit) for bound in bounds]:
        # Rounded to or across the limit, the interval would contradict the verdict beside it.
        return (in_written_unit(verdict, value), in_written_unit(verdict, bounds[0]),
                in_written_unit(verdict, bounds[1]))
    return shown


def _side(number: float, limit: float) -> int:
    return (number > limit) - (number < limit)


def _with_figures(verdict: Verdict) -> str:
    if verdict.value is None:
        return verdict.reason
    if verdict.ci95 is None:
        return f'{verdict.reason} (measured {in_written_unit(verdict, verdict.value)})'
    value, low, high = with_interval(verdict, verdict.value, verdict.ci95)
    return f'{verdict.reason} (measured {value}, {low} .. {high})'


def figures(verdict: Verdict) -> tuple[str, str, str]:
    """Return measured value, interval and limit, each in the unit of the specification."""
    limit = in_written_unit(verdict, verdict.limit)
    if verdict.value is not None and verdict.ci95 is not None:
        value, low, high = with_interval(verdict, verdict.value, verdict.ci95)
        return value, f'{low} .. {high}', limit
    value = '' if verdict.value is None else in_written_unit(verdict, verdict.value)
    if verdict.upper95 is not None:
        return '', f'< {in_written_unit(verdict, verdict.upper95)}', limit
    return value, '', limit
