# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Search for the IMUs in the messages of a topic, by type name or by definition."""

from contextlib import suppress
from dataclasses import replace
import re

from imu_allan.cdr import IMU_TYPE, Serialization
from imu_allan.errors import brief, ImuAllanError
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.definitions import (
    Definition,
    Field,
    find_definition,
    imu_types,
    normal_name,
    parse,
    Types,
)
from imu_allan.recordings.messages.imu_fields import (
    IMU_FIELDS,
    ImuFields,
    KNOWN,
    split_path,
    Stamp,
    TIME,
    Vector,
)
from imu_allan.recordings.messages.type_names import may_hold_imu
from imu_allan.recordings.options import factor, M_PER_S2, RAD_PER_S, RecordingOptions

IMU_MESSAGES = ImuMessages(IMU_TYPE, IMU_FIELDS, imu_types('cdr'))
"""How sensor_msgs/Imu is read."""


def imus_in(
    topic: str, type_name: str, serialization: Serialization,
    definition: Definition | Types | None, options: RecordingOptions,
) -> dict[str, ImuMessages]:
    """
    Find the IMUs in the messages of a topic; an error says why one might be there unread.

    They have the name of the topic or, if its messages hold several, of topic and field, such as
    ``/imus.left``.
    """
    kind = normal_name(type_name)
    gyro = options.gyro if options.gyro_topic in (None, topic) else None
    accel = options.accel if options.accel_topic in (None, topic) else None
    if gyro is not None or accel is not None:
        types = _types(kind, serialization, definition, options)
        found = {topic: _chosen(types, kind, gyro, accel, options.stamp)}
    elif kind == IMU_TYPE:
        types = imu_types(serialization)
        found = {topic: IMU_FIELDS.scaled(options.factors)}
    elif kind in KNOWN:
        types = _types(kind, serialization, definition, options)
        found = {topic: _present(KNOWN[kind], types, kind).scaled(options.factors)}
    elif may_hold_imu(kind) and _shows_imu(
            known := _definition_of(kind, serialization, definition, options)):
        types = parse(kind, known, serialization)
        by_path = found_by_shape(types, kind)
        found = {topic if len(by_path) == 1 else f'{topic}.{path}': fields.scaled(options.factors)
                 for path, fields in by_path.items()}
    else:
        return {}
    if options.temperature is not None:
        # The temperature may be a topic instead of a field.
        with suppress(ImuAllanError):
            _number_at(types, kind, options.temperature, '--temperature')
            found = {name: replace(fields, temperature=options.temperature)
                     for name, fields in found.items()}
    return {name: ImuMessages(kind, fields, types, serialization)
            for name, fields in found.items()}


def _shows_imu(definition: Definition | Types) -> bool:
    # Fields that are already parsed are cheap to search. Every definition of an Imu, or of a
    # message with its fields, contains one of these texts.
    return not isinstance(definition, Definition) or any(sign in definition.text for sign in (
        'linear_acceleration', 'sensor_msgs/Imu', 'sensor_msgs/msg/Imu', 'sensor_msgs::msg::Imu'))


def thermometer_in(type_name: str, serialization: Serialization,
                   definition: Definition | Types | None) -> ImuMessages:
    """Describe how to read sensor_msgs/Temperature messages, in degrees Celsius."""
    kind = normal_name(type_name)
    types = _types(kind, serialization, definition, RecordingOptions())
    stamps, frame_id = _own_clock(types, kind)
    fields = ImuFields(Vector(('temperature',) * 3), None, stamps, frame_id)
    return ImuMessages(kind, fields, types, serialization)


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
            f'type {_shown(type_name)} holds {len(found)} IMUs '
            f'({", ".join(name[1:] for name in found)}); name the fields of one with --gyro and '
            '--accel')
    if not found:
        raise ImuAllanError(f'type {_shown(type_name)} holds no samples of an IMU that are known; '
                            'name the fields that hold them with --gyro and --accel')
    [messages] = found.values()
    return messages


def _types(kind: str, serialization: Serialization, carried: Definition | Types | None,
           options: RecordingOptions) -> Types:
    return parse(kind, _definition_of(kind, serialization, carried, options), serialization)


def _definition_of(kind: str, serialization: Serialization, carried: Definition | Types | None,
                   options: RecordingOptions) -> Definition | Types:
    """Return the definition in the recording, or else that of the user, of a package or of ROS."""
    found = carried or find_definition(kind, options.definitions)
    if found is None and not may_hold_imu(kind):
        # `parse` supplies ROS types only as nested fields, so wrap the type in another message.
        outer = parse('imu_allan/msg/Outer', Definition(f'{kind} message'), serialization)
        found = outer if kind in outer else None
    if found is None:
        raise ImuAllanError(
            f'the definition of {_shown(kind)} is not in the recording (sqlite3 bags before ROS 2 '
            'Iron carry none); name its .msg files with --definitions')
    return found


def _present(fields: ImuFields, types: Types, kind: str) -> ImuFields:
    """Remove optional fields that this version of the type lacks; an error if samples lack."""
    arrays = {path for _, vector in fields.vectors() for path in vector.paths if fields.burst}

    def has(path: str) -> bool:
        try:
            field = _field_at(types, kind, path, '')
        except ImuAllanError:
            return False
        return path == fields.frame_id or (
            not field.is_message and field.kind != 'string'
            and (field.count is not None) == (path in arrays))

    for path in sorted(fields.needed()):
        if not has(path):
            raise ImuAllanError(
                f'{_shown(kind)} has no field {split_path(path)[0]} in the definition that comes '
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
    stamps, frame_id = _own_clock(types, kind)
    if stamp is not None:
        stamps = (_stamp_of(types, kind, stamp),)
    return ImuFields(
        None if gyro is None else _vector_of(types, kind, gyro, '--gyro', RAD_PER_S),
        None if accel is None else _vector_of(types, kind, accel, '--accel', M_PER_S2),
        stamps, frame_id,
        what='its fields ' + ' and '.join(
            _shown(text) for text in (gyro, accel) if text is not None))


def found_by_shape(types: Types, type_name: str) -> dict[str, ImuFields]:
    """Find messages with vectors `angular_velocity` and `linear_acceleration`, by their path."""
    found: dict[str, ImuFields] = {}
    # Nested messages; the state message of a robot has some fifty.
    most = 1000
    visits = iter(range(most))
    most_imus = 16

    def search(kind: str, path: str, around: ImuFields) -> None:
        """Search a message; those `around` it may have a stamp, a frame and a temperature."""
        if next(visits, None) is None:
            if found:
                return
            raise ImuAllanError(f'its type holds more than {most} messages, too many to '
                                'search for an IMU; name the fields with --gyro and --accel')
        fields = {field.name: field for field in types.get(kind, ())}
        stamps, frame_id = _own_clock(types, kind, path)
        here = replace(
            around, stamps=stamps + around.stamps, frame_id=frame_id or around.frame_id,
            temperature=next((f'{path}{name}' for name in (
                'imu_temperature', 'temperature', 'imu_temp', 'temp')
                if name in fields and _is_number(fields[name])), around.temperature))
        halves = ('angular_velocity', 'linear_acceleration')
        if all(_is_vector(types, fields.get(name)) for name in halves):
            covariances = {name: f'{path}{name}[0]' for name, field in fields.items()
                           if field.kind == 'f8' and field.count == 9}
            gyro, accel = (Vector(
                _components(f'{path}{name}'), covariance=covariances.get(f'{name}_covariance'))
                for name in halves)
            found[path[:-1]] = replace(here, gyro=gyro, accel=accel, what=(
                f'its field {path[:-1]} ({kind})' if path else 'its own fields'))
            return
        # Real messages are not nested this deep; a hostile definition may be nested endlessly.
        if path.count('.') == 8:
            return
        for field in fields.values():
            if not field.is_message or field.count == 0:
                continue
            for number in range(min(field.count or 1, most_imus)):
                name = field.name if field.count is None else f'{field.name}[{number}]'
                if len(found) < most_imus:
                    search(field.kind, f'{path}{name}.', here)

    search(type_name, '', ImuFields(None, None))
    return found


def _components(path: str) -> tuple[str, str, str]:
    return f'{path}.x', f'{path}.y', f'{path}.z'


def _is_vector(types: Types, field: Field | None) -> bool:
    if field is None or not field.is_message or field.count is not None:
        return False
    numbers = {part.name for part in types.get(field.kind, ()) if _is_number(part)}
    return {'x', 'y', 'z'} <= numbers


def _is_number(field: Field) -> bool:
    """Return whether a field is a single number."""
    return not field.is_message and field.kind != 'string' and field.count is None


def _own_clock(types: Types, type_name: str, path: str = '',
               ) -> tuple[tuple[Stamp, ...], str | None]:
    """Find the stamps and the frame_id among the direct fields of a message."""
    stamps: list[Stamp] = []
    frame_id = None
    for field in types.get(type_name, ()):
        if field.is_message and field.count is None:
            parts = tuple(part.name for part in types.get(field.kind, ()))
            if parts == TIME:
                stamps.append(Stamp(f'{path}{field.name}'))
            # In ROS 1 a header begins with a sequence number.
            elif parts[-2:] == ('stamp', 'frame_id'):
                stamps.append(Stamp(f'{path}{field.name}.stamp'))
                frame_id = frame_id or f'{path}{field.name}.frame_id'
    return tuple(stamps), frame_id


def _vector_of(types: Types, type_name: str, text: str, what: str, si_unit: str) -> Vector:
    """Find the vector that a user names, and perhaps its unit, such as ``imu.rate deg/s``."""
    path, _, unit = text.strip().partition(' ')
    return Vector(_three_numbers(types, type_name, path, what),
                  factor(what, unit.strip() or None, si_unit))


def _three_numbers(types: Types, type_name: str, text: str, what: str) -> tuple[str, str, str]:
    """Find the paths in ``imu.rate``, which has x, y and z, ``gyro[0:3]``, or ``gx,gy,gz``."""
    parts = tuple(part.strip() for part in text.split(','))
    if len(parts) == 3:
        for part in parts:
            _number_at(types, type_name, part, what)
        return parts[0], parts[1], parts[2]
    match = re.fullmatch(r'(.*)\[(\d{1,6}):(\d{1,6})\]', text)
    path = match[1] if match else text
    start, stop = (int(match[2]), int(match[3])) if match else (0, 3)
    field = _field_at(types, type_name, path, what)
    if match is None and _is_vector(types, field):
        return _components(path)
    is_array = not field.is_message and field.kind != 'string' and field.count is not None
    if not is_array or stop - start != 3 or (field.count and stop > field.count) or (
            match is None and field.count != 3):
        raise ImuAllanError(
            f'{what} {_shown(text)}: not three numbers in {_shown(type_name)}; name a field with '
            'x, y, z, three elements such as gyro[0:3], or three fields such as gx,gy,gz')
    return f'{path}[{start}]', f'{path}[{start + 1}]', f'{path}[{start + 2}]'


def _stamp_of(types: Types, kind: str, text: str) -> Stamp:
    """Find the time that a user names: a number with its unit, or seconds and nanoseconds."""
    path, _, unit = text.strip().partition(' ')
    field = _field_at(types, kind, path, '--stamp')
    if field.is_message:
        if {part.name for part in types.get(field.kind, ())} == {*TIME}:
            return Stamp(path)
        raise ImuAllanError(f'--stamp {_shown(text)}: not a time in {_shown(kind)}')
    unit_ns = {'s': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}.get(unit.strip())
    if unit_ns is None or not _is_number(field):
        raise ImuAllanError(f'--stamp {_shown(text)}: name a number and its unit (s, ms, us or '
                            'ns), or a field with seconds and nanoseconds')
    return Stamp(path, unit_ns)


def _number_at(types: Types, type_name: str, path: str, what: str) -> None:
    """Raise ImuAllanError unless `path` is a single number."""
    if not _is_number(_field_at(types, type_name, path, what)):
        raise ImuAllanError(f'{what} {_shown(path)}: not a number in {_shown(type_name)}')


def _field_at(types: Types, type_name: str, path: str, what: str) -> Field:
    """Return the field at a dotted path; ImuAllanError lists the existing fields."""
    # Generous for eight levels of names with 100 characters.
    if len(path) > 1000 or re.fullmatch(
            r'[A-Za-z_]\w*(\[\d{1,6}\])?(\.[A-Za-z_]\w*(\[\d{1,6}\])?)*', path) is None:
        raise ImuAllanError(f'{what} {_shown(path)}: not a field path such as imu.gyro[0:3]')
    field = Field('', type_name, True, None)
    for part in path.split('.'):
        if not field.is_message or field.count is not None:
            raise ImuAllanError(f'{what} {_shown(path)}: {_shown(field.name)} has no fields of '
                                'its own')
        name, number = split_path(part)
        fields = {each.name: each for each in types.get(field.kind, ())}
        if name not in fields:
            known = ', '.join(_shown(name) for name in list(fields)[:10])
            raise ImuAllanError(f'{what} {_shown(path)}: {_shown(field.kind)} has no field '
                                f'{_shown(name)}; it has {known or "none"}')
        field = fields[name]
        if name != part:
            if field.count is None or (field.count and number >= field.count):
                raise ImuAllanError(f'{what} {_shown(path)}: {_shown(name)} has no such element')
            field = replace(field, count=None)
    return field


def _shown(text: str) -> str:
    """Format text from elsewhere so that it is printable and short."""
    return brief(text, 80)
