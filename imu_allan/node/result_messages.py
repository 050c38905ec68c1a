# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A Result as the messages that ROS tools can read."""

from collections.abc import Mapping
from dataclasses import dataclass
import math

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3, Vector3Stamped
from imu_allan.result import AxisResult, Coefficient, Result
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

SENSORS = ('gyro', 'accel')
VECTOR_TERMS = ('noise_density', 'bias_instability', 'rate_random_walk')
"""Terms that have a topic of their own."""
FILTER_TERMS = ('noise_density', 'rate_random_walk')
"""What every filter asks for: a WARN stands while one is not observable."""
OCTAVES = 25
"""Columns of the Allan deviation array: PlotJuggler leaves out arrays beyond 100 numbers."""


@dataclass(frozen=True)
class ResultMessages:
    """What is published of one result; `vectors` and `curves` by topic below ``~/``."""

    coefficients: DiagnosticArray
    vectors: Mapping[str, Vector3Stamped]
    curves: Mapping[str, Float64MultiArray]


def result_messages(result: Result, node_name: str, stamp: Time) -> ResultMessages:
    """
    Every message of a result.

    Parameters
    ----------
    result : Result
        What was fitted.
    node_name : str
        In front of the names of the statuses.
    stamp : builtin_interfaces.msg.Time
        Time of the last sample.

    """
    vectors = {f'{sensor}/{term}': vector_message(result, sensor, term, stamp)
               for sensor in SENSORS for term in VECTOR_TERMS}
    curves = {f'{sensor}/allan_deviation': curve_message(result, sensor) for sensor in SENSORS}
    return ResultMessages(coefficients_message(result, node_name, stamp), vectors, curves)


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
        array.status.append(DiagnosticStatus(
            level=level, name=f'{node_name}: {name}', message=message,
            hardware_id=result.source.topic or '', values=_axis_values(axis)))
    return array


def vector_message(result: Result, sensor: str, term: str, stamp: Time) -> Vector3Stamped:
    """One coefficient of the three axes of a sensor; NaN where it is not observable."""
    message = Vector3Stamped()
    message.header.stamp = stamp
    message.header.frame_id = result.source.frame_id or ''
    values = {}
    for letter in 'xyz':
        axis = result.axes.get(f'{sensor}_{letter}')
        value = axis.coefficients[term].value if axis is not None else None
        values[letter] = math.nan if value is None else value
    message.vector = Vector3(**values)
    return message


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
        text += f', expected in {spoken_duration(coefficient.observable_in_s)}'
    return text


def spoken_duration(seconds: float) -> str:
    """Write a duration in the unit in which it is easiest to read."""
    for size, unit in ((86400.0, 'd'), (3600.0, 'h'), (60.0, 'min')):
        if seconds >= 2 * size:
            return f'{seconds / size:.1f} {unit}'
    return f'{seconds:.0f} s'


def _axis_values(axis: AxisResult) -> list[KeyValue]:
    entries: dict[str, object] = {'unit': axis.unit, 'mean': axis.mean,
                                  'band_limit_s': axis.band_limit_s}
    for key, coefficient in axis.coefficients.items():
        low, high = coefficient.ci95 or (None, None)
        entries |= {f'{key}/value': coefficient.value, f'{key}/ci95_low': low,
                    f'{key}/ci95_high': high, f'{key}/upper95': coefficient.upper95,
                    f'{key}/observable': coefficient.observable,
                    f'{key}/observable_in_s': coefficient.observable_in_s,
                    f'{key}/unit': coefficient.unit}
    fit = axis.goodness_of_fit
    entries |= {'goodness_of_fit/acceptable': fit.acceptable,
                'goodness_of_fit/p_value': fit.p_value,
                'goodness_of_fit/worst_relative_misfit': fit.worst_relative_misfit}
    for i, tone in enumerate(axis.tones):
        entries |= {f'tones/{i}/frequency_hz': tone.frequency_hz,
                    f'tones/{i}/amplitude': tone.amplitude}
    return [KeyValue(key=key, value=as_text(value)) for key, value in entries.items()
            if value is not None]


def as_text(value: object) -> str:
    """Write a value as tools parse it back, numbers to the last digit."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(float(value)) if isinstance(value, float) else str(value)
