# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of both nodes, with descriptions, ranges, and reasons for refusal."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import difflib
import math
from os import PathLike
from pathlib import Path
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.node.rclpy_inside import given_parameters
from imu_allan.writers.filters import CONSUMERS
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

TOPIC = 'imu/data_raw'
"""The name that REP-145 defines."""
DEFAULT_OUTPUT_DIR = '~/.ros/imu_allan'
"""Next to the logs of ROS, which belong to the same user."""
DEFAULT_STATE_FILE = '$ROS_HOME/imu_allan/<name>.state'
"""``<name>`` is the fully qualified name of the node; ROS_HOME defaults to ~/.ros."""


@dataclass(frozen=True)
class Setting:
    """One parameter of a node."""

    name: str
    default: str | int | float | tuple[str, ...]
    description: str
    lowest: float | None = None
    highest: float | None = None
    choices: Sequence[str] = ()
    may_be_empty: bool = True
    read_only: bool = True

    def reason_against(self, value: Any) -> str:
        """Return why `value` is refused, apart from type and range; empty if it is accepted."""
        if value is None:
            # Not set; `declare` decides by the type whether that is allowed.
            return ''
        if isinstance(value, float) and not math.isfinite(value):
            return f'{self.name}: {value} is not a finite number'
        if isinstance(value, str) and not value and not self.may_be_empty:
            return f'{self.name}: must not be empty'
        if self.choices:
            # ROS has no empty list as a parameter, so [''] is used instead.
            for text in [value] if isinstance(value, str) else filter(None, value):
                if text not in self.choices:
                    return f'{self.name}: {text!r} is not one of {", ".join(self.choices)}'
        return ''

    @property
    def kind(self) -> str:
        """Say in words what ROS has to give as its value."""
        return {int: 'a whole number', str: 'a text in quotes', tuple: 'a list of texts',
                float: f'a number with a decimal point, such as {self.default!r}'
                }[type(self.default)]

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor, which rclpy enforces and shows."""
        descriptor = ParameterDescriptor(
            name=self.name, description=self.description, read_only=self.read_only,
            additional_constraints=f'one of: {", ".join(self.choices)}' if self.choices else '')
        if self.lowest is not None and self.highest is not None:
            limits = {'from_value': self.lowest, 'to_value': self.highest}
            if isinstance(self.default, float):
                descriptor.floating_point_range = [FloatingPointRange(**limits)]
            else:
                descriptor.integer_range = [IntegerRange(**limits)]
        return descriptor


CHARACTERIZATION = (
    Setting('publish_period', 10.0, 'Shortest time between fits and publications, in seconds',
            0.5, 86_400.0, read_only=False),
    Setting('output_dir', DEFAULT_OUTPUT_DIR, 'Folder that ~/save and shutdown write to. '
            'Every run gets its own folder in it', may_be_empty=False),
    Setting('state_file', DEFAULT_STATE_FILE, 'File that keeps the state of the run over '
            'every restart; the default resumes only after a crash; none or '
            'empty keeps nothing'),
    Setting('checkpoint_period', 60.0, 'Seconds between checkpoints: the most that a crash '
            'can lose', 1.0, 86_400.0, read_only=False),
    Setting('motion', 'exclude', 'What to do with knocks and motion',
            choices=('exclude', 'keep')),
    Setting('clock', 'auto', 'Stamps to trust; auto takes the header stamps unless they are '
            'unusable', choices=('auto', 'header', 'receive')),
    Setting('expected_rate', 0.0, 'Rate of the IMU in Hz: sets the queue size, and a '
            'different measured rate is reported; 0 is unknown', 0.0, 100_000.0),
    Setting('gap_tolerance', 5, 'Most missing samples in a row that are interpolated; a '
            'longer gap begins a new segment', 0, 1000),
    Setting('export_for', ('kalibr',), "Filters whose configuration ~/save writes; [''] "
            'writes none', choices=tuple(CONSUMERS), read_only=False),
    Setting('aiding_interval', 0.1, 'Seconds between corrections of the filter, for '
            '~/gyro/filter_random_walk and ~/accel/filter_random_walk', 0.001, 3600.0),
    Setting('coast', 60.0, 'The longest unaided time of the filter, in seconds', 0.01, 86_400.0),
    Setting('temperature_topic', '', "Topic (sensor_msgs/Temperature) of the IMU's "
            "thermometer; empty finds the only one in the IMU's namespace"),
    Setting('imu_type', 'sensor_msgs/msg/Imu', 'Type of the messages: one that contains an '
            "Imu, or a driver's own, such as px4_msgs/msg/SensorCombined", may_be_empty=False),
    Setting('gyro_field', '', 'Field of the messages that holds the angular velocity and its '
            'unit, such as twist.angular or imu.gyro[0:3] deg/s; empty finds it'),
    Setting('accel_field', '', 'Field of the messages that holds the acceleration and its '
            'unit; empty finds it'),
    Setting('stamp_field', '', 'Field of the messages that holds their time, beside '
            'gyro_field or accel_field, with a unit if it is a number (t us); empty finds it'),
    Setting('gyro_unit', '', 'Unit of the angular velocity, such as deg/s; empty is rad/s'),
    Setting('accel_unit', '', 'Unit of the acceleration: m/s^2 or g; empty takes it as g if '
            'its magnitude at rest is near 1'),
    Setting('gyro_topic', '', 'Topic of the gyroscope, for an IMU on two topics; empty takes '
            'both sensors from imu/data_raw'),
    Setting('accel_topic', '', 'Topic of the accelerometer, for an IMU on two topics'),
    Setting('accel_type', '', 'Type of the messages on accel_topic, such as '
            'px4_msgs/msg/SensorAccel, if other than imu_type; empty is imu_type'),
    Setting('spec_file', '', 'Datasheet (YAML) to check the IMU against; empty is none'),
    Setting('reference', '', 'Earlier result file of the same IMU; a difference from it is '
            'reported; empty is none'),
)
"""Parameters of `imu_allan_node`."""
READING = ('imu_type', 'gyro_field', 'accel_field', 'stamp_field', 'gyro_unit', 'accel_unit',
           'accel_type')
"""Those of them that say how messages are read."""

SIMULATOR = (
    Setting('model', 'consumer_mems', 'Noise model: a YAML file, or the name of one that the '
            'package ships in config/', may_be_empty=False),
    Setting('rate', 100.0, 'Samples per second of simulated time', 0.1, 100_000.0),
    Setting('speed', 1.0, 'Simulated seconds per second; 0 publishes as fast as reliable '
            'subscriptions that keep all take the samples', 0.0, 1e6),
    Setting('duration', 0.0, 'Simulated seconds until the node ends; 0 means never', 0.0, 1e9),
    Setting('seed', 0, 'Seed of the random numbers: the same seed gives the same noise', 0,
            2**31 - 1),
    Setting('frame_id', 'imu_link', 'header.frame_id of the messages'),
    Setting('wait_for_subscriptions', 0, 'Publish nothing before this many subscriptions '
            'are matched', 0, 100),
)
"""Parameters of `imu_simulator`."""


@contextmanager
def naming_parameter(name: str) -> Iterator[None]:
    """Let an error about the value of a parameter begin with its name."""
    try:
        yield
    except ImuAllanError as error:
        raise ImuAllanError(f'parameter {name}: {error}') from error


def at_home(path: str | PathLike[str], parameter: str = '') -> Path:
    """Return the path that a parameter names, with ``~`` expanded to the home folder."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        named = f'{parameter} {path}'.lstrip()
        raise ImuAllanError(f'{named}: this user has no home folder; write the path without ~'
                            ) from error


def _meant(value: Any) -> Any:
    """Return the value of a parameter; ROS gives the null of YAML as a text."""
    return '' if isinstance(value, str) and value.casefold() == 'null' else value


def declare(node: Node, settings: Sequence[Setting]) -> dict[str, Any]:
    """Declare `settings`; return their values, which follow changes that pass the checks."""
    known = {setting.name: setting for setting in settings}

    def check(parameters: Iterable[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in known and (
                    reason := known[parameter.name].reason_against(_meant(parameter.value))):
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def apply(parameters: Iterable[Parameter]) -> None:
        values.update({one.name: _meant(one.value) for one in parameters if one.name in known})

    values: dict[str, Any] = {}
    node.add_on_set_parameters_callback(check)
    for setting in settings:
        value = list(setting.default) if isinstance(setting.default, tuple) else setting.default
        expected = f'parameter {setting.name}: expected {setting.kind}'
        try:
            declared = node.declare_parameter(setting.name, value, setting.descriptor()).value
        except InvalidParameterTypeException as error:
            raise ImuAllanError(expected) from error
        except InvalidParameterValueException as error:
            reason = str(error).partition('Reason: ')[2] or str(error)
            if 'out of range' in reason:
                reason = f'must lie between {setting.lowest:g} and {setting.highest:g}'
            # rclpy appends the name to the reason once more.
            reason = reason.removesuffix(f': {setting.name}').removeprefix(f'{setting.name}: ')
            raise ImuAllanError(f'parameter {setting.name}: {reason}') from error
        if declared is None and not isinstance(value, list):
            raise ImuAllanError(expected)
        # An empty list on a command line has no type, so ROS gives None.
        values[setting.name] = [] if declared is None else _meant(declared)
    node.add_post_set_parameters_callback(apply)
    return values


def warn_of_unknown(node: Node, *, qos: bool = False) -> None:
    """Warn of given parameters that the node lacks; with `qos`, of overrides of other topics."""
    names = list(node.list_parameters([], 0).names)
    for name in given_parameters(node):
        if not node.has_parameter(name) and name.startswith('qos_overrides.') == qos:
            close = difflib.get_close_matches(name, names, 1)
            hint = f', did you mean {close[0]}?' if close else ''
            node.get_logger().warning(f'unknown parameter {name} is ignored{hint}')
