# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decoding of messages that are not sensor_msgs/Imu, or that contain one.

They are read as from a recording: `imu_allan.recordings.messages` knows the types of drivers,
finds an Imu inside other messages, and takes fields that the user names. The fields of a type come
from its Python class, which the subscription needs anyway.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
import re
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import batches_of, blocks_from_messages, IMU_TYPE, OnMalformed
from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.recordings.messages.definitions import Field, field_of, normal_name, Types

Decode = Callable[[Sequence[bytes], Ints, OnMalformed], list[ImuBlock]]


def message_class(type_name: str) -> Any:
    """Return the Python class of a message type."""
    found = re.fullmatch(r'(?P<package>[a-z]\w*)/(?:msg/)?(?P<name>[A-Z]\w*)', type_name)
    shown = brief(type_name, 80)
    if found is None:
        raise ImuAllanError(f'{shown}: not the name of a message type, such as {IMU_TYPE}')
    try:
        return getattr(import_module(f'{found["package"]}.msg'), found['name'])
    except AttributeError:
        raise ImuAllanError(f'{shown}: the package {found["package"]} has no such message'
                            ) from None
    except ImportError as error:
        raise ImuAllanError(f'{shown}: its Python package cannot be imported '
                            f'({printable(error)}); source the workspace that it was built in'
                            ) from error


def types_of(type_name: str) -> Types:
    """Return the fields of a message type and of the types it contains, from their classes."""
    types: dict[str, tuple[Field, ...]] = {}
    waiting = [normal_name(type_name)]
    while waiting:
        name = waiting.pop()
        if name not in types:
            types[name] = tuple(_field(field, kind) for field, kind in (
                message_class(name).get_fields_and_field_types().items()))
            waiting += [field.kind for field in types[name] if '/' in field.kind]
    return types


def _field(name: str, kind: str) -> Field:
    # An element type, bounded or not, alone, in an array or in a sequence.
    found = re.match(
        r'(?:sequence<)?(?P<element>[\w/]+)(?:<\d+>)?(?:\[(?P<count>\d+)\])?', kind)
    assert found is not None, kind
    # Type names of Python classes that differ from those in message definitions.
    base = {'float': 'float32', 'double': 'float64', 'boolean': 'bool'}
    element = base.get(found['element'], found['element'])
    count = int(found['count']) if found['count'] else None
    return field_of(name, normal_name(element), 0 if kind.startswith('sequence') else count)


def decoder(type_name: str, **options: str) -> Decode:
    """Return a function that decodes messages of a type by `RecordingOptions`; none if empty."""
    given: dict[str, Any] = {name: text for name, text in options.items() if text}
    if type_name == IMU_TYPE and not given:
        return blocks_from_messages
    # Imported late: most nodes read sensor_msgs/Imu and do not need these.
    from imu_allan.recordings.messages.imus_in import imu_messages
    from imu_allan.recordings.options import RecordingOptions
    try:
        decode = imu_messages(type_name, types_of(type_name),
                              options=RecordingOptions(**given)).decoder()
    except ImuAllanError as error:
        text = str(error)
        for option, parameter in (
                ('--gyro unit', 'gyro_unit'), ('--accel unit', 'accel_unit'),
                ('--gyro', 'gyro_field'), ('--accel', 'accel_field'), ('--stamp', 'stamp_field')):
            text = text.replace(option, parameter)
        raise ImuAllanError(text) from error

    return lambda messages, receive_ns, on_malformed: decode(
        batches_of(messages, receive_ns), on_malformed)
