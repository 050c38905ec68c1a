# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node: described, ranged, refused with a reason when they make no sense."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
import difflib
import math
from typing import Any

from imu_allan.errors import ImuAllanError
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

Value = str | int | float | bool | Sequence[str]


@dataclass(frozen=True)
class Setting:
    """
    One parameter.

    Attributes
    ----------
    name : str
    default : str, int, float, bool or sequence of str
        Its type is the parameter's.
    description : str
        What `ros2 param describe` shows.
    lowest, highest : float, optional
        Range of a number, both ends included.
    choices : sequence of str, optional
        What a text, or each text of a sequence, may be.
    may_be_empty : bool
        Whether a text may be empty.
    read_only : bool
        Whether it can only be set when the node starts.

    """

    name: str
    default: Value
    description: str
    lowest: float | None = None
    highest: float | None = None
    choices: Sequence[str] = ()
    may_be_empty: bool = True
    read_only: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """Make the descriptor that rclpy enforces and shows."""
        descriptor = ParameterDescriptor(
            name=self.name, description=self.description, read_only=self.read_only,
            additional_constraints=f'one of: {", ".join(self.choices)}' if self.choices else '')
        if self.lowest is not None and self.highest is not None:
            if isinstance(self.default, float):
                descriptor.floating_point_range = [FloatingPointRange(
                    from_value=float(self.lowest), to_value=float(self.highest))]
            else:
                descriptor.integer_range = [IntegerRange(
                    from_value=int(self.lowest), to_value=int(self.highest))]
        return descriptor

    def reason_against(self, value: Any) -> str:
        """Why `value` is refused beyond type and range; empty if it is not."""
        if isinstance(value, float) and not math.isfinite(value):
            return f'{self.name}: {value} is not a finite number'
        if isinstance(value, str) and not value and not self.may_be_empty:
            return f'{self.name}: must not be empty'
        texts = [value] if isinstance(value, str) else value
        if self.choices:
            for text in texts:
                # A parameter cannot be an empty list: [''] stands for it.
                if text not in self.choices and (text or isinstance(value, str)):
                    return f'{self.name}: {text!r} is not one of {", ".join(self.choices)}'
        return ''


def declare(node: Node, settings: Sequence[Setting],
            applied: Callable[[str, Any], None] | None = None) -> dict[str, Any]:
    """
    Declare `settings` on `node`; later changes are checked, then handed to `applied`.

    Parameters
    ----------
    node : rclpy.node.Node
        The node that gets them.
    settings : sequence of Setting
        What to declare.
    applied : callable, optional
        Called with name and value of each parameter after it has changed.

    Returns
    -------
    dict
        Value by name at the start.

    Raises
    ------
    ImuAllanError
        If a value the node was started with is refused.

    """
    known = {setting.name: setting for setting in settings}

    def check(parameters: Iterable[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in known:
                reason = known[parameter.name].reason_against(parameter.value)
                if reason:
                    return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def apply(parameters: Iterable[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name in known and applied is not None:
                applied(parameter.name, parameter.value)

    node.add_on_set_parameters_callback(check)
    values = {}
    for setting in settings:
        default = setting.default
        value = list(default) if isinstance(default, tuple) else default
        try:
            values[setting.name] = node.declare_parameter(
                setting.name, value, setting.descriptor()).value
        except InvalidParameterTypeException as error:
            raise ImuAllanError(f'parameter {setting.name}: expected {_kind(default)}') from error
        except InvalidParameterValueException as error:
            reason = str(error).partition('Reason: ')[2] or str(error)
            raise ImuAllanError(f'parameter {setting.name} is refused: {reason}') from error
    node.add_post_set_parameters_callback(apply)
    return values


def warn_of_unknown(node: Node) -> None:
    """Tell of parameters that were given to the node but that it does not have."""
    given: Mapping[str, Any] = getattr(node, '_parameter_overrides', {})
    names = list(node.list_parameters([], 0).names)
    for name in given:
        if not node.has_parameter(name) and not name.startswith('qos_overrides.'):
            close = difflib.get_close_matches(name, names, 1)
            hint = f', did you mean {close[0]}?' if close else ''
            node.get_logger().warning(f'unknown parameter {name} is ignored{hint}')


def _kind(default: Value) -> str:
    if isinstance(default, bool):
        return 'true or false'
    if isinstance(default, int):
        return 'a whole number'
    if isinstance(default, float):
        return f'a number with a decimal point, such as {default!r}'
    return 'a text' if isinstance(default, str) else 'a list of texts'
