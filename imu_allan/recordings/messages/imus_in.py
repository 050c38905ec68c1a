# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Search for the IMUs in the messages of a topic, by type name or by definition."""

from contextlib import suppress
from dataclasses import replace

from imu_allan.cdr import Serialization
from imu_allan.errors import ImuAllanError
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.definitions import (
    Definition,
    definition_files,
    find_definition,
    normal_name,
    parse,
    Types,
)
from imu_allan.recordings.messages.imu_fields import (
    field_at,
    found_by_shape,
    ImuFields,
    number_at,
    own_clock,
    shown,
    split_path,
    stamp_of,
    vector_of,
)
from imu_allan.recordings.messages.known_types import KNOWN
from imu_allan.recordings.options import M_PER_S2, RAD_PER_S, RecordingOptions

IMU_TYPES = frozenset({'sensor_msgs/msg/Imu', 'sensor_msgs/Imu'})
"""Type names in ROS 2 and ROS 1."""

TEMPERATURE_TYPES = frozenset({'sensor_msgs/msg/Temperature', 'sensor_msgs/Temperature'})


def may_hold_imu(type_name: str) -> bool:
    """Return whether messages of a type might hold IMU samples, judged by its name."""
    # None of the types of ROS itself, other than Imu, holds IMU samples.
    of_ros = frozenset({
        'action_msgs', 'actionlib_msgs', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs',
        'lifecycle_msgs', 'map_msgs', 'nav_msgs', 'rcl_interfaces', 'rosbag2_interfaces',
        'rosgraph_msgs', 'sensor_msgs', 'shape_msgs', 'statistics_msgs', 'std_msgs', 'stereo_msgs',
        'tf', 'tf2_msgs', 'trajectory_msgs', 'unique_identifier_msgs', 'visualization_msgs'})
    return type_name.partition('/')[0] not in of_ros


def imus_in(
    topic: str, type_name: str, serialization: Serialization,
    definition: Definition | Types | None, options: RecordingOptions,
) -> dict[str, ImuMessages]:
    """
    Find the IMUs in the messages of a topic; an error says why one might be there unread.

    They have the name of the topic or, if its messages hold several, of topic and field, such as
    ``/imus.left``.
    """
    kind, factors = normal_name(type_name), options.factors
    gyro = options.gyro if options.gyro_topic in (None, topic) else None
    accel = options.accel if options.accel_topic in (None, topic) else None
    if gyro is not None or accel is not None:
        types, factors = _types(kind, serialization, definition, options), (1.0, 1.0)
        found = {topic: _chosen(types, kind, gyro, accel, options.stamp)}
    elif kind in IMU_TYPES:
        return {topic: ImuMessages(kind, serialization, factors=factors)}
    elif kind in KNOWN:
        types = _types(kind, serialization, definition, options)
        found = {topic: _present(KNOWN[kind], types, kind)}
    elif may_hold_imu(kind) and _shows_imu(
            known := _definition_of(kind, serialization, definition, options)):
        types = parse(kind, known, serialization)
        by_path = found_by_shape(types, kind)
        found = {topic if len(by_path) == 1 else f'{topic}.{path}': fields
                 for path, fields in by_path.items()}
    else:
        return {}
    if options.temperature is not None:
        # The temperature may be a topic instead of a field.
        with suppress(ImuAllanError):
            number_at(types, kind, options.temperature, '--temperature')
            found = {name: replace(fields, temperature=options.temperature)
                     for name, fields in found.items()}
    return {name: ImuMessages(kind, serialization, fields, types, factors)
            for name, fields in found.items()}


def _shows_imu(definition: Definition | Types) -> bool:
    # Fields that are already parsed are cheap to search. Every definition of an Imu, or of a
    # message with its fields, contains one of these texts.
    return not isinstance(definition, Definition) or any(sign in definition.text for sign in (
        'linear_acceleration', 'sensor_msgs/Imu', 'sensor_msgs/msg/Imu', 'sensor_msgs::msg::Imu'))


def thermometer_in(type_name: str, serialization: Serialization, definition: Definition | None,
                   ) -> ImuMessages:
    """Describe how to read sensor_msgs/Temperature messages, in degrees Celsius."""
    kind = normal_name(type_name)
    types = _types(kind, serialization, definition, RecordingOptions())
    stamps, frame_id = own_clock(types, kind)
    fields = ImuFields(None, None, stamps, frame_id, temperature='temperature').thermometer()
    return ImuMessages(kind, serialization, fields, types)


def imu_messages(type_name: str, definition: str | Types,
                 options: RecordingOptions = RecordingOptions()) -> ImuMessages:  # noqa: B008
    """
    Describe how to read messages of a type that holds one IMU.

    In `definition`, those of nested types follow, each after a line of 80 ``=`` and a line ``MSG:
    package/Name``. It may be empty if the package is sourced.

    Examples
    --------
    >>> import numpy as np
    >>> from imu_allan.cdr import MessageBatch
    >>> definition = 'uint64 timestamp' + chr(10) + 'float32[3] gyro_rad' + chr(10) + (
    ...     'float32[3] accelerometer_m_s2')
    >>> decode = imu_messages('px4_msgs/msg/SensorCombined', definition).decoder()
    >>> message = bytes([0, 1, 0, 0]) + np.array([5], 'u8').tobytes() + np.arange(
    ...     6, dtype='f4').tobytes()
    >>> rows = np.frombuffer(message, np.uint8).reshape(1, -1)
    >>> [block] = decode([MessageBatch(rows, np.zeros(1, np.int64))], print)
    >>> block.samples.tolist(), block.header_ns.tolist()
    ([[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]], [5000])

    """
    known = (definition if not isinstance(definition, str)
             else Definition(definition) if definition.strip() else None)
    found = imus_in('', type_name, 'cdr', known, options)
    if len(found) > 1:
        raise ImuAllanError(
            f'type {shown(type_name)} holds {len(found)} IMUs '
            f'({", ".join(name[1:] for name in found)}); name the fields of one with --gyro and '
            '--accel')
    if not found:
        raise ImuAllanError(f'type {shown(type_name)} holds no samples of an IMU that are known; '
                            'name the fields that hold them with --gyro and --accel')
    [messages] = found.values()
    return messages


def _types(kind: str, serialization: Serialization, carried: Definition | Types | None,
           options: RecordingOptions) -> Types:
    return parse(kind, _definition_of(kind, serialization, carried, options), serialization)


def _definition_of(kind: str, serialization: Serialization, carried: Definition | Types | None,
                   options: RecordingOptions) -> Definition | Types:
    """Return the definition in the recording, or else that of the user, of a package or of ROS."""
    found = carried or find_definition(kind, definition_files(options.definitions))
    if found is None and not may_hold_imu(kind):
        # `parse` supplies ROS types only as nested fields, so wrap the type in another message.
        outer = parse('imu_allan/msg/Outer', Definition(f'{kind} message'), serialization)
        found = outer if kind in outer else None
    if found is None:
        raise ImuAllanError(
            f'the definition of {shown(kind)} is not in the recording (sqlite3 bags before ROS 2 '
            'Iron carry none); name its .msg files with --definitions')
    return found


def _present(fields: ImuFields, types: Types, kind: str) -> ImuFields:
    """Remove optional fields that this version of the type lacks; an error if samples lack."""
    def has(path: str) -> bool:
        try:
            field_at(types, kind, path, '')
        except ImuAllanError:
            return False
        return True

    for path in sorted(fields.needed()):
        if not has(path):
            raise ImuAllanError(
                f'{shown(kind)} has no field {split_path(path)[0]} in the definition that comes '
                'with it; name the fields with --gyro and --accel')
    paths = [vector.paths[0].rpartition('.x')[0] or split_path(vector.paths[0])[0]
             for _, vector in fields.vectors()]
    return replace(
        fields, stamps=tuple(stamp for stamp in fields.stamps if all(map(has, stamp.paths))),
        frame_id=fields.frame_id if fields.frame_id and has(fields.frame_id) else None,
        temperature=fields.temperature if fields.temperature and has(fields.temperature) else None,
        what='its fields ' + ' and '.join(paths) if len(paths) > 1 else f'its field {paths[0]}')


def _chosen(types: Types, kind: str, gyro: str | None, accel: str | None, stamp: str | None,
            ) -> ImuFields:
    """Return the fields that the user names."""
    stamps, frame_id = own_clock(types, kind)
    if stamp is not None:
        stamps = (stamp_of(types, kind, stamp),)
    return ImuFields(
        None if gyro is None else vector_of(types, kind, gyro, '--gyro', RAD_PER_S),
        None if accel is None else vector_of(types, kind, accel, '--accel', M_PER_S2),
        stamps, frame_id,
        what='its fields ' + ' and '.join(
            shown(text) for text in (gyro, accel) if text is not None))
