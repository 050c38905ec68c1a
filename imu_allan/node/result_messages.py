# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A Result as the messages that ROS tools can read."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
import json
import math
from typing import Any, Literal

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3, Vector3Stamped
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.noise.terms import LASTING_TERMS
from imu_allan.result import AxisResult, Coefficient, Result, TurnOnBias
from imu_allan.tuning.forecast import FORECAST_S, predicted_drift
from imu_allan.tuning.tune import tune
from imu_allan.wording import duration
from imu_allan.writers.words import message_of, of_axis
from std_msgs.msg import (
    Float64MultiArray,
    Header,
    MultiArrayDimension,
    MultiArrayLayout,
    String,
)

SENSORS = ('gyro', 'accel')
TUNED_TERM = 'filter_random_walk'
"""Not measured but chosen, for a filter with a random walk and nothing else."""
FILTER_TERMS = ('noise_density', 'rate_random_walk')
"""What every filter asks for: a WARN stands while one is not observable."""
ENDS: tuple[Literal['low', 'high'], ...] = ('low', 'high')
"""The 95 % interval of each of these terms is two vectors, which every tool plots as they are."""
OCTAVES = 25
"""Columns of the Allan deviation array: PlotJuggler leaves out arrays beyond 100 numbers."""


@dataclass(frozen=True)
class Filter:
    """How often something else corrects a filter, and the longest that it is unaided, in s."""

    aiding_interval_s: float = 0.1
    coast_s: float = 60.0


def result_messages(result: Result, node_name: str, stamp: Time,
                    filter_of: Filter = Filter()) -> dict[str, Any]:
    """Every message of a result, by its topic below ``~/``; NaN is what is not known."""
    of_axis: dict[str, Callable[[AxisResult], float | None]] = {
        TUNED_TERM: partial(_tuned, filter_of)}
    for term in LASTING_TERMS:
        of_axis[term] = partial(_value, term)
        of_axis |= {f'{term}/interval/{end}': partial(_bound, term, end) for end in ENDS}
    document = json.dumps(result.to_dict(), separators=(',', ':'), allow_nan=False)
    return {'result': String(data=document),
            'coefficients': coefficients_message(result, node_name, stamp),
            **{f'{sensor}/{topic}': _vector(result, sensor, stamp, number)
               for sensor in SENSORS for topic, number in of_axis.items()},
            **{f'{sensor}/allan_deviation': curve_message(result, sensor) for sensor in SENSORS}}


def coefficients_message(result: Result, node_name: str, stamp: Time) -> DiagnosticArray:
    """One status per axis, with value, interval and unit of every coefficient."""
    array = DiagnosticArray()
    array.header.stamp = stamp
    array.header.frame_id = result.source.frame_id or ''
    for name, axis in result.axes.items():
        missing = [key for key in FILTER_TERMS if not axis.coefficients[key].observable]
        level, message = DiagnosticStatus.OK, 'noise density and rate random walk are observable'
        if missing:
            level = DiagnosticStatus.WARN
            message = '; '.join(_not_observable(key, axis.coefficients[key]) for key in missing)
        if not axis.goodness_of_fit.acceptable:
            level = DiagnosticStatus.WARN
            message += '; no noise model fits this axis well'
        remarks = [of_axis(remark, name) for remark in result.warnings
                   if name in remark.axes]
        array.status.append(DiagnosticStatus(
            level=level, name=f'{node_name}: {name}', message=message,
            hardware_id=result.source.topic or '',
            values=_axis_values(axis, remarks, result.turn_on_bias.get(name))))
    return array


def _value(term: str, axis: AxisResult) -> float | None:
    return axis.coefficients[term].value


def _tuned(filter_of: Filter, axis: AxisResult) -> float | None:
    """Random walk that makes a filter consistent."""
    if not axis.coefficients['noise_density'].observable:
        return None
    try:
        return tune(axis, filter_of.aiding_interval_s, filter_of.coast_s).random_walk
    except ImuAllanError:
        # No drift model, or no noise at all: the axis's own status says why.
        return None


def _bound(term: str, end: Literal['low', 'high'], axis: AxisResult) -> float | None:
    """One end of a 95 % interval, which of a hidden term is from zero to its upper bound."""
    coefficient = axis.coefficients[term]
    if coefficient.ci95 is not None:
        return coefficient.ci95[ENDS.index(end)]
    return coefficient.upper95 if end == 'high' or coefficient.upper95 is None else 0.0


def _vector(result: Result, sensor: str, stamp: Time,
            number: Callable[[AxisResult], float | None]) -> Vector3Stamped:
    """Give a number of each of the three axes of a sensor."""
    values = {letter: None if axis is None else number(axis) for letter in 'xyz'
              for axis in [result.axes.get(f'{sensor}_{letter}')]}
    return Vector3Stamped(
        header=Header(stamp=stamp, frame_id=result.source.frame_id or ''),
        vector=Vector3(**{letter: math.nan if value is None else value
                          for letter, value in values.items()}))


def curve_message(result: Result, sensor: str) -> Float64MultiArray:
    """
    Allan deviation of a sensor: rows tau (s), x, y, z, each of 25 octaves, padded with NaN.

    A curve of more octaves leaves out its shortest averaging times.
    """
    curves = []
    for letter in 'xyz':
        axis = result.axes.get(f'{sensor}_{letter}')
        curves.append({} if axis is None else
                      dict(zip(axis.curve.tau_s, axis.curve.adev, strict=True)))
    taus = sorted({tau for curve in curves for tau in curve})[-OCTAVES:]
    rows = [taus, *([curve.get(tau, math.nan) for tau in taus] for curve in curves)]
    data = [number for row in rows for number in row + [math.nan] * (OCTAVES - len(row))]
    size = len(data)
    return Float64MultiArray(data=data, layout=MultiArrayLayout(dim=[
        MultiArrayDimension(label='tau,x,y,z', size=len(rows), stride=size),
        MultiArrayDimension(label='octave', size=OCTAVES, stride=OCTAVES)]))


def _not_observable(key: str, coefficient: Coefficient) -> str:
    text = f'{key.replace("_", " ")} not observable yet'
    if coefficient.observable_in_s is not None:
        text += f', expected in {duration(coefficient.observable_in_s)}'
    return text


def _axis_values(axis: AxisResult, remarks: Sequence[Finding],
                 spread: TurnOnBias | None) -> list[KeyValue]:
    entries: dict[str, object] = {'unit': axis.unit, 'mean': axis.mean,
                                  'band_limit_s': axis.band_limit_s}
    for key, coefficient in axis.coefficients.items():
        low, high = coefficient.ci95 or (None, None)
        entries |= {f'{key}/value': coefficient.value, f'{key}/ci95_low': low,
                    f'{key}/ci95_high': high, f'{key}/upper95': coefficient.upper95,
                    f'{key}/observable': coefficient.observable,
                    f'{key}/observable_in_s': coefficient.observable_in_s,
                    f'{key}/unit': coefficient.unit}
    if spread is not None:
        entries |= {'turn_on_bias/value': spread.sigma, 'turn_on_bias/ci95_low': spread.ci95[0],
                    'turn_on_bias/ci95_high': spread.ci95[1], 'turn_on_bias/unit': axis.unit}
    fit = axis.goodness_of_fit
    entries |= {'goodness_of_fit/acceptable': fit.acceptable,
                'goodness_of_fit/p_value': fit.p_value,
                'goodness_of_fit/worst_relative_misfit': fit.worst_relative_misfit}
    for i, tone in enumerate(axis.tones):
        entries |= {f'tones/{i}/frequency_hz': tone.frequency_hz,
                    f'tones/{i}/amplitude': tone.amplitude}
    for i, tone in enumerate(axis.weaker_tones):
        entries |= {f'weaker_tones/{i}/frequency_hz': tone.frequency_hz,
                    f'weaker_tones/{i}/amplitude': tone.amplitude,
                    f'weaker_tones/{i}/lines': tone.lines}
    entries |= _forecast_values(axis)
    entries |= remark_values(remarks)
    return [KeyValue(key=key, value=as_text(value)) for key, value in entries.items()
            if value is not None]


def remark_values(remarks: Sequence[Finding]) -> dict[str, str]:
    """Give what was found in the order of the result, by code; the second of one has a number."""
    values: dict[str, str] = {}
    codes = [remark.code for remark in remarks]
    for number, (code, remark) in enumerate(zip(codes, remarks, strict=True)):
        again = codes[:number].count(code)
        values[f'remarks/{code}' + (f'/{again + 1}' if again else '')] = message_of(
            remark, live=True)
    return values


def _forecast_values(axis: AxisResult) -> dict[str, object]:
    """Predict the unaided drift after a minute at rest; nothing before it is known."""
    if axis.drift_model is None:
        return {}
    found = predicted_drift(axis, FORECAST_S)
    entries: dict[str, object] = {'predicted_drift/calibration_s': found.calibration_s,
                                  'predicted_drift/known_to_s': found.known_to_s}
    parts = [('angle', 'rad', found.integral, found.integral_ci95)]
    if found.position is not None and found.position_ci95 is not None:
        parts = [('velocity', 'm/s', found.integral, found.integral_ci95),
                 ('position', 'm', found.position, found.position_ci95)]
    for what, unit, sigmas, bands in parts:
        for horizon, sigma, (low, high) in zip(found.horizons_s, sigmas, bands, strict=True):
            key = f'predicted_drift/{horizon:g}s/{what}'
            entries |= {f'{key}/value': sigma, f'{key}/ci95_low': low, f'{key}/ci95_high': high,
                        f'{key}/unit': unit}
    return entries


def as_text(value: object) -> str:
    """Write a value as tools parse it back, numbers to the last digit."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(float(value)) if isinstance(value, float) else str(value)
