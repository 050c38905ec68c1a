# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Declaration of a node's parameters, with descriptions, ranges, and reasons for refusal."""

from collections.abc import Iterable, Sequence
import difflib
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.node.interface import Setting, Value
from imu_allan.node.rclpy_inside import given_parameters
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter


def declare(node: Node, settings: Sequence[Setting]) -> dict[str, Any]:
    """Declare `settings`; return their values, which follow changes that pass the checks."""
    known = {setting.name: setting for setting in settings}

    def check(parameters: Iterable[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in known and (
                    reason := known[parameter.name].reason_against(parameter.value)):
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def apply(parameters: Iterable[Parameter]) -> None:
        values.update({one.name: one.value for one in parameters if one.name in known})

    values: dict[str, Any] = {}
    node.add_on_set_parameters_callback(check)
    for setting in settings:
        default = setting.default
        value = list(default) if isinstance(default, tuple) else default
        expected = f'parameter {setting.name}: expected {_kind(default)}'
        try:
            declared = node.declare_parameter(setting.name, value, _descriptor(setting)).value
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
        values[setting.name] = [] if declared is None else declared
    node.add_post_set_parameters_callback(apply)
    return values


def warn_of_unknown(node: Node) -> None:
    """Warn of parameters that were given to the node but that it does not have."""
    names = list(node.list_parameters([], 0).names)
    for name in given_parameters(node):
        if not node.has_parameter(name) and not name.startswith('qos_overrides.'):
            close = difflib.get_close_matches(name, names, 1)
            hint = f', did you mean {close[0]}?' if close else ''
            node.get_logger().warning(f'unknown parameter {name} is ignored{hint}')


def _kind(default: Value) -> str:
    return {int: 'a whole number', str: 'a text', tuple: 'a list of texts',
            float: f'a number with a decimal point, such as {default!r}'}[type(default)]


def _descriptor(setting: Setting) -> ParameterDescriptor:
    """Return the descriptor of a parameter, which rclpy enforces and shows."""
    descriptor = ParameterDescriptor(
        name=setting.name, description=setting.description, read_only=setting.read_only,
        additional_constraints=f'one of: {", ".join(setting.choices)}' if setting.choices else '')
    if setting.lowest is not None and setting.highest is not None:
        limits = {'from_value': setting.lowest, 'to_value': setting.highest}
        if isinstance(setting.default, float):
            descriptor.floating_point_range = [FloatingPointRange(**limits)]
        else:
            descriptor.integer_range = [IntegerRange(**limits)]
    return descriptor
