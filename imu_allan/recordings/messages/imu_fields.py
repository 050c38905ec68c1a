# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which fields are an IMU's, in one module because both ways to them, search and name, agree.

Of a message: the samples, their units and their clock.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import re

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.recordings.messages.definitions import Field, Types

_MOST_IMUS = 16
"""Imus that are looked for in one message."""
_MOST_VISITED = 1000
"""Messages within a message that are looked into; a robot's state has some fifty."""
_TIME = ('sec', 'nanosec')


@dataclass(frozen=True)
class Vector:
    """
    Three numbers of a message.

    Attributes
    ----------
    paths : tuple of str
        Of x, y, z; ``gyro[0]`` is an element of an array of numbers.
    factor : float
        To rad/s or m/s^2.
    scale : str or None
        A field that holds a further factor.
    per : str or None
        A field that holds the duration in microseconds of which the numbers are the increments;
        ``''`` where the step of the stamps is that duration.
    covariance : str or None
        A field that is -1 where the numbers are not provided.

    """

    paths: tuple[str, str, str]
    factor: float = 1.0
    scale: str | None = None
    per: str | None = None
    covariance: str | None = None


@dataclass(frozen=True)
class Stamp:
    """
    The time of a message.

    Attributes
    ----------
    path : str
        A number, or a message of seconds and nanoseconds.
    unit_ns : int
        Nanoseconds in one unit of the number; 0 for seconds and nanoseconds in two fields.

    """

    path: str
    unit_ns: int = 0

    @property
    def paths(self) -> tuple[str, ...]:
        """Return the fields it is read from."""
        return (self.path,) if self.unit_ns else tuple(f'{self.path}.{part}' for part in _TIME)


@dataclass(frozen=True)
class Burst:
    """
    Many samples in one message: the fields of a vector are arrays.

    Attributes
    ----------
    samples : str
        A field with the number of samples that are filled.
    step_us : str
        A field with the time between two of them; the stamp is that of the last.

    """

    samples: str
    step_us: str


@dataclass(frozen=True)
class ImuFields:
    """
    Where the samples of an IMU stand in messages of one type.

    Attributes
    ----------
    gyro, accel : Vector or None
        None where the message has no such half.
    stamps : tuple of Stamp
        The first of them that is valid and advances finely is used; none where it has no stamp.
    frame_id : str or None
        A field that names the frame.
    burst : Burst or None
        Where a message holds many samples.
    what : str
        In words for the user: which field is read.
    temperature : str or None
        A field with the temperature of the sensor; it is read on its own, by `thermometer`.

    """

    gyro: Vector | None
    accel: Vector | None
    stamps: tuple[Stamp, ...] = ()
    frame_id: str | None = None
    burst: Burst | None = None
    what: str = ''
    temperature: str | None = None

    def thermometer(self) -> 'ImuFields | None':
        """Return how the temperature alone is read: as the first three columns of the samples."""
        if self.temperature is None:
            return None
        return ImuFields(Vector((self.temperature,) * 3), None, self.stamps, self.frame_id,
                         what=f'its field {self.temperature}')

    def vectors(self) -> Iterator[tuple[int, Vector]]:
        """Give the halves that there are, each with its first column in the samples."""
        for first, vector in ((0, self.gyro), (3, self.accel)):
            if vector is not None:
                yield first, vector

    def numbers(self) -> set[str]:
        """Name every number that is read; those of a burst are arrays."""
        found = {path for stamp in self.stamps for path in stamp.paths}
        for _, vector in self.vectors():
            found |= {*vector.paths, vector.scale or '', vector.per or '',
                      vector.covariance or ''}
        if self.burst is not None:
            found |= {self.burst.samples, self.burst.step_us}
        return found - {''}

    def paths(self) -> set[str]:
        """Name every field that is read, without the element of an array of numbers."""
        return {split_path(path)[0] for path in self.numbers()} | (
            set() if self.frame_id is None else {self.frame_id})


def split_path(path: str) -> tuple[str, int]:
    """Take the element off a path: ``a.gyro[1]`` is number 1 of field ``a.gyro``."""
    if path.endswith(']'):
        field, _, number = path[:-1].rpartition('[')
        return field, int(number)
    return path, 0


def found_by_shape(types: Types, type_name: str) -> list[ImuFields]:
    """
    Find messages with vectors `angular_velocity` and `linear_acceleration` in a type.

    A sensor_msgs/Imu is one, wherever it is nested; so is a message of its own with these fields.

    Returns
    -------
    list of ImuFields
        In the order of the definition. The stamps of the message itself come first, then those
        of the messages around it.

    Raises
    ------
    ImuAllanError
        If there are too many messages within messages to look into: a few lines can define
        billions.

    """
    found: list[ImuFields] = []
    _search(types, type_name, '', (), None, found, 0, iter(range(_MOST_VISITED)))
    return found


def _search(types: Types, type_name: str, path: str, stamps: tuple[Stamp, ...],
            frame_id: str | None, found: list[ImuFields], depth: int, visits: Iterator[int],
            heat: str | None = None) -> None:
    if next(visits, None) is None:
        if found:
            return
        raise ImuAllanError(f'its type holds more than {_MOST_VISITED} messages, too many to '
                            'search for an IMU; name the fields with --gyro and --accel')
    fields = {field.name: field for field in types.get(type_name, ())}
    own, own_frame_id = own_clock(types, type_name, path)
    stamps, frame_id = own + stamps, own_frame_id or frame_id
    heat = next((f'{path}{name}'
                 for name in ('imu_temperature', 'temperature', 'imu_temp', 'temp')
                 if name in fields and _is_number(fields[name])), heat)
    if all(_is_vector(types, fields.get(name)) for name in _HALVES):
        gyro, accel = (Vector(
            _components(f'{path}{name}'),
            covariance=(f'{path}{name}_covariance[0]' if _is_covariance(
                fields.get(f'{name}_covariance')) else None)) for name in _HALVES)
        what = f'its field {path[:-1]} ({type_name})' if path else 'its own fields'
        found.append(ImuFields(gyro, accel, stamps, frame_id, what=what, temperature=heat))
        return
    # Nobody nests messages as deep, and a hostile definition may without end.
    if depth == 8:
        return
    for field in fields.values():
        if not field.is_message or field.count == 0:
            continue
        names = [field.name] if field.count is None else [
            f'{field.name}[{number}]' for number in range(min(field.count, _MOST_IMUS))]
        for name in names:
            if len(found) < _MOST_IMUS:
                _search(types, field.kind, f'{path}{name}.', stamps, frame_id, found,
                        depth + 1, visits, heat)


_HALVES = ('angular_velocity', 'linear_acceleration')


def _components(path: str) -> tuple[str, str, str]:
    return f'{path}.x', f'{path}.y', f'{path}.z'


def _is_vector(types: Types, field: Field | None) -> bool:
    if field is None or not field.is_message or field.count is not None:
        return False
    numbers = {part.name for part in types.get(field.kind, ()) if _is_number(part)}
    return {'x', 'y', 'z'} <= numbers


def _is_number(field: Field) -> bool:
    return not field.is_message and field.kind != 'string' and field.count is None


def _is_covariance(field: Field | None) -> bool:
    return field is not None and field.kind == 'f8' and field.count == 9


def own_clock(types: Types, type_name: str, path: str = '',
              ) -> tuple[tuple[Stamp, ...], str | None]:
    """Find stamps and frame_id among the fields of the message itself."""
    stamps: list[Stamp] = []
    frame_id = None
    for field in types.get(type_name, ()):
        if field.is_message and field.count is None:
            parts = tuple(part.name for part in types.get(field.kind, ()))
            if parts == _TIME:
                stamps.append(Stamp(f'{path}{field.name}'))
            # In ROS 1 a sequence number stands first in a header.
            elif parts[-2:] == ('stamp', 'frame_id'):
                stamps.append(Stamp(f'{path}{field.name}.stamp'))
                frame_id = frame_id or f'{path}{field.name}.frame_id'
    return tuple(stamps), frame_id


def vector_of(types: Types, type_name: str, text: str, what: str) -> Vector:
    """
    Find three numbers that the user names.

    Parameters
    ----------
    types : Types
        Fields of all types in the message.
    type_name : str
        Type of the message.
    text : str
        A message with x, y, z (``imu.rate``), three elements of an array (``imu.gyro[0:3]``, or
        ``imu.gyro`` where it has just three), or three numbers (``gx,gy,gz``).
    what : str
        Name of the option, for messages.

    Raises
    ------
    ImuAllanError
        If there is no such field, or it is not three numbers.

    """
    parts = tuple(part.strip() for part in text.split(','))
    if len(parts) == 3:
        for part in parts:
            number_at(types, type_name, part, what)
        return Vector((parts[0], parts[1], parts[2]))
    match = re.fullmatch(r'(.*)\[(\d{1,6}):(\d{1,6})\]', text)
    path = match[1] if match else text
    start, stop = (int(match[2]), int(match[3])) if match else (0, 3)
    field = field_at(types, type_name, path, what)
    if match is None and _is_vector(types, field):
        return Vector(_components(path))
    is_array = not field.is_message and field.kind != 'string' and field.count is not None
    if not is_array or stop - start != 3 or (field.count and stop > field.count) or (
            match is None and field.count != 3):
        raise ImuAllanError(
            f'{what} {shown(text)}: not three numbers in {shown(type_name)}; name a field with '
            'x, y, z, three elements such as gyro[0:3], or three fields such as gx,gy,gz')
    return Vector((f'{path}[{start}]', f'{path}[{start + 1}]', f'{path}[{start + 2}]'))


def number_at(types: Types, type_name: str, path: str, what: str) -> None:
    """Raise ImuAllanError unless a single number stands at `path`."""
    if not _is_number(field_at(types, type_name, path, what)):
        raise ImuAllanError(f'{what} {shown(path)}: not a number in {shown(type_name)}')


def field_at(types: Types, type_name: str, path: str, what: str) -> Field:
    """Find a field by its dotted path; ImuAllanError names those that there are."""
    # Eight levels of names of 100 characters, and room.
    if len(path) > 1000 or re.fullmatch(
            r'[A-Za-z_]\w*(\[\d{1,6}\])?(\.[A-Za-z_]\w*(\[\d{1,6}\])?)*', path) is None:
        raise ImuAllanError(f'{what} {shown(path)}: not a field path such as imu.gyro[0:3]')
    kind = type_name
    parts = path.split('.')
    field = Field('', kind, True, None)
    for place, part in enumerate(parts):
        name, number = split_path(part)
        fields = {field.name: field for field in types.get(kind, ())}
        if name not in fields:
            known = ', '.join(shown(name) for name in list(fields)[:10])
            raise ImuAllanError(f'{what} {shown(path)}: {shown(kind)} has no field '
                                f'{shown(name)}; it has {known or "none"}')
        field = fields[name]
        indexed = name != part
        if indexed and (field.count is None or (field.count and number >= field.count)):
            raise ImuAllanError(f'{what} {shown(path)}: {shown(name)} has no such element')
        if place + 1 < len(parts) and (
                not field.is_message or (field.count is not None) != indexed):
            raise ImuAllanError(f'{what} {shown(path)}: {shown(name)} has no fields of its own')
        kind = field.kind
        if indexed:
            field = Field(name, kind, field.is_message, None)
    return field


def shown(text: str) -> str:
    """Write what somebody else chose so that it fits into a line."""
    return printable(shorten(text, 80))
