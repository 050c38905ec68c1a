# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The topics on which the node publishes, and the messages that ROS tools read of a Result."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
import json
import math
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3, Vector3Stamped
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.finding_messages import message_of, of_axis
from imu_allan.noise.terms import LASTING_TERMS
from imu_allan.result import AxisResult, Coefficient, Result, TurnOnBias
from imu_allan.tuning.tune import tune
from imu_allan.wording import duration, SENSORS, spoken
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout, String

VECTORS = ('filter_random_walk', *(f'{term}{part}' for term in LASTING_TERMS
                                   for part in ('', '/interval/low', '/interval/high')))
"""Topics of a sensor published as vectors; 95 % intervals as two, which every tool can plot."""
_PLOT = 'plot/compressed'


def result_messages(result: Result, node_name: str, stamp: Time, aiding_s: float = 0.1,
                    coast_s: float = 60.0, accel_frame_id: str | None = None) -> dict[str, Any]:
    """
    Return all messages of a result by topic below ``~/``; unknown values are NaN.

    `aiding_s` and `coast_s` are the aiding interval of a filter and its longest unaided time.
    `accel_frame_id`: of an accelerometer on a topic of its own.
    """
    document = json.dumps(result.to_dict(), separators=(',', ':'), allow_nan=False)
    messages = {'result': String(data=document),
                'coefficients': coefficients_message(result, node_name, stamp)}
    for sensor in SENSORS:
        own = accel_frame_id if sensor == 'accel' else None
        header = Header(stamp=stamp, frame_id=own or result.source.frame_id or '')
        axes = {letter: result.axes.get(f'{sensor}_{letter}') for letter in 'xyz'}
        numbers = {letter: {} if axis is None else _numbers(axis, aiding_s, coast_s)
                   for letter, axis in axes.items()}
        for topic in VECTORS:
            vector = Vector3(**{letter: found.get(topic, math.nan)
                                for letter, found in numbers.items()})
            messages[f'{sensor}/{topic}'] = Vector3Stamped(header=header, vector=vector)
        messages[f'{sensor}/allan_deviation'] = _curve_message(axes.values())
    return messages


def coefficients_message(result: Result, node_name: str, stamp: Time) -> DiagnosticArray:
    """Return one status per axis, with value, interval and unit of every coefficient."""
    array = DiagnosticArray()
    array.header.stamp = stamp
    array.header.frame_id = result.source.frame_id or ''
    for name, axis in result.axes.items():
        # Every filter needs these two.
        missing = [_not_observable(key, axis.coefficients[key])
                   for key in ('noise_density', 'rate_random_walk')
                   if not axis.coefficients[key].observable]
        message = '; '.join(missing) or 'noise density and rate random walk are observable'
        fits_well = axis.goodness_of_fit.acceptable
        remarks = [of_axis(remark, name) for remark in result.warnings if name in remark.axes]
        array.status.append(DiagnosticStatus(
            level=DiagnosticStatus.OK if fits_well and not missing else DiagnosticStatus.WARN,
            name=f'{node_name}: {name}', hardware_id=result.source.topic or '',
            message=message if fits_well else f'{message}; no noise model fits this axis well',
            values=_axis_values(axis, remarks, result.turn_on_bias.get(name))))
    return array


def _numbers(axis: AxisResult, aiding_s: float, coast_s: float) -> dict[str, float]:
    """Return the known components of an axis in the vectors of its sensor, by topic."""
    numbers: dict[str, float | None] = {}
    if axis.coefficients['noise_density'].observable:
        # Without a drift model, or noise, the status of the axis says why there is none.
        with suppress(ImuAllanError):
            # Tuned, not measured: for a filter that models the bias as a random walk alone.
            numbers['filter_random_walk'] = tune(axis, aiding_s, coast_s).random_walk
    for term in LASTING_TERMS:
        found = axis.coefficients[term]
        # The interval of a term that is not observable is from zero to its upper bound.
        low, high = found.ci95 or (None if found.upper95 is None else 0.0, found.upper95)
        numbers |= {term: found.value, f'{term}/interval/low': low, f'{term}/interval/high': high}
    return {topic: number for topic, number in numbers.items() if number is not None}


def _curve_message(axes: Iterable[AxisResult | None]) -> Float64MultiArray:
    """Return the Allan deviation of a sensor: rows tau (s), x, y, z, padded with NaN."""
    curves = [{} if axis is None else dict(zip(axis.curve.tau_s, axis.curve.adev, strict=True))
              for axis in axes]
    octaves = 25   # the longest; PlotJuggler ignores arrays of more than 100 numbers
    taus = sorted({tau for curve in curves for tau in curve})[-octaves:]
    rows = [taus, *([curve.get(tau, math.nan) for tau in taus] for curve in curves)]
    data = [number for row in rows for number in row + [math.nan] * (octaves - len(row))]
    size = len(data)
    return Float64MultiArray(data=data, layout=MultiArrayLayout(dim=[
        MultiArrayDimension(label='tau,x,y,z', size=len(rows), stride=size),
        MultiArrayDimension(label='octave', size=octaves, stride=octaves)]))


def _not_observable(key: str, coefficient: Coefficient) -> str:
    text = f'{spoken(key)} not observable yet'
    if coefficient.observable_in_s is not None:
        text += f', expected in {duration(coefficient.observable_in_s)}'
    return text


def _axis_values(axis: AxisResult, remarks: Sequence[Finding],
                 spread: TurnOnBias | None) -> list[KeyValue]:
    entries: dict[str, object] = {'unit': axis.unit, 'mean': axis.mean,
                                  'band_limit_s': axis.band_limit_s}
    for key, found in axis.coefficients.items():
        entries |= {**_with_interval(key, found.value, found.ci95, found.unit),
                    f'{key}/upper95': found.upper95, f'{key}/observable': found.observable,
                    f'{key}/observable_in_s': found.observable_in_s}
    if spread is not None:
        entries |= _with_interval('turn_on_bias', spread.sigma, spread.ci95, axis.unit)
    entries |= {f'goodness_of_fit/{key}': value
                for key, value in asdict(axis.goodness_of_fit).items()}
    # More would fill the screen of a monitor.
    for i, tone in enumerate(axis.tones[:32]):
        entries |= {f'tones/{i}/{key}': value for key, value in asdict(tone).items()}
    return key_values({**entries, **remark_values(remarks)})


def _with_interval(name: str, value: float | None, ci95: tuple[float, float] | None, unit: str
                   ) -> dict[str, object]:
    low, high = ci95 or (None, None)
    return {f'{name}/value': value, f'{name}/ci95_low': low, f'{name}/ci95_high': high,
            f'{name}/unit': unit}


def remark_values(remarks: Sequence[Finding]) -> dict[str, str]:
    """Return the findings in the order of the result, by code; repeated codes are numbered."""
    values: dict[str, str] = {}
    codes = [remark.code for remark in remarks]
    for number, (code, remark) in enumerate(zip(codes, remarks, strict=True)):
        again = codes[:number].count(code)
        values[f'remarks/{code}' + (f'/{again + 1}' if again else '')] = message_of(
            remark, live=True)
    return values


def key_values(entries: Mapping[str, object]) -> list[KeyValue]:
    """Format the known values so that tools can parse them back, numbers to the last digit."""
    return [KeyValue(key=key, value=str(value).lower() if isinstance(value, bool) else
                     repr(float(value)) if isinstance(value, float) else str(value))
            for key, value in entries.items() if value is not None]


class OutputTopics:
    """All publishers of the node."""

    def __init__(self, node: Node) -> None:
        latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                             durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # Every event handler adds to the cost of each wake-up of the executor.
        no_events = PublisherEventCallbacks(use_default_callbacks=False)

        def publisher(kind: type, topic: str, qos: QoSProfile | int = latched) -> Publisher:
            return node.create_publisher(kind, topic, qos, event_callbacks=no_events)

        of_sensor = {**dict.fromkeys(VECTORS, Vector3Stamped),
                     'allan_deviation': Float64MultiArray}
        kinds = {'result': String, 'coefficients': DiagnosticArray, _PLOT: CompressedImage,
                 **{f'{sensor}/{topic}': kind for sensor in SENSORS
                    for topic, kind in of_sensor.items()}}
        self._of_result = {topic: publisher(kind, f'~/{topic}') for topic, kind in kinds.items()}
        self._published: dict[str, Any] = {}
        self._volatile: dict[str, set[bytes]] = {topic: set() for topic in self._of_result}
        self._with_newcomers: list[str] = []
        self.diagnostics = publisher(DiagnosticArray, '/diagnostics', 10)
        self._node = node

    def publish(self, by_topic: Mapping[str, Any]) -> None:
        """Publish the messages of a result by topic."""
        # Without the plot of the result before, which shows something else.
        self._published = dict(by_topic)
        for topic, message in by_topic.items():
            self._of_result[topic].publish(message)

    @property
    def plot_is_watched(self) -> bool:
        """Return whether somebody subscribes to the plot."""
        return self._of_result[_PLOT].get_subscription_count() > 0

    def publish_plot(self, image: CompressedImage) -> None:
        """Publish the plot of the latest result."""
        self._published[_PLOT] = image
        self._of_result[_PLOT].publish(image)

    def look_for_newcomers(self) -> None:
        """Find new volatile subscriptions, which have missed the last result."""
        for topic, publisher in self._of_result.items():
            volatile = {
                bytes(info.endpoint_gid)
                for info in self._node.get_subscriptions_info_by_topic(publisher.topic_name)
                if info.qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL}
            if volatile - self._volatile[topic]:
                self._with_newcomers.append(topic)
            self._volatile[topic] = volatile

    def serve_newcomers(self) -> None:
        """Publish again for the newcomers that the last look found, a tick later."""
        # The graph shows a subscription up to some milliseconds before it is matched with the
        # publisher; a message between the two would reach nobody.
        for topic in self._with_newcomers:
            if topic in self._published:
                self._of_result[topic].publish(self._published[topic])
        self._with_newcomers.clear()
