# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The fields of a message that hold the samples of an IMU, their units and their times.

Fields found by a search and fields named by the user have the same representation.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
import re

from imu_allan.errors import brief, ImuAllanError
from imu_allan.recordings.messages.definitions import Field, Types
from imu_allan.recordings.options import factor

_TIME = ('sec', 'nanosec')


@dataclass(frozen=True)
class Vector:
    """
    A vector of three numbers in a message.

    Attributes
    ----------
    paths : tuple of str
        Paths of x, y and z; ``gyro[0]`` is an element of an array of numbers.
    factor : float
        Factor that converts the numbers to rad/s or m/s^2.
    scale : str or None
        Field with a further factor.
    per : str or None
        For increments, the field with their duration in microseconds.
    covariance : str or None
        Field that is -1 if the numbers are not provided.

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
        Path of a number, or of a message with seconds and nanoseconds.
    unit_ns : int
        Nanoseconds in one unit of the number; 0 for seconds and nanoseconds in two fields.

    """

    path: str
    unit_ns: int = 0

    @property
    def paths(self) -> tuple[str, ...]:
        """Return the paths of the fields that make up the stamp."""
        return (self.path,) if self.unit_ns else tuple(f'{self.path}.{part}' for part in _TIME)


@dataclass(frozen=True)
class Burst:
    """
    Fields of a message with many samples, whose vectors consist of arrays.

    Attributes
    ----------
    samples : str
        Field with the number of valid samples.
    step_us : str
        Field with the sampling interval in microseconds; the stamp is that of the last sample.

    """

    samples: str
    step_us: str


@dataclass(frozen=True)
class ImuFields:
    """
    The fields of one message type that hold the samples of an IMU.

    Attributes
    ----------
    gyro, accel : Vector or None
        None if the message has no samples of that sensor.
    stamps : tuple of Stamp
        Candidates for the stamp: the first that is valid and mostly distinct is used. Empty if
        there is no stamp.
    frame_id : str or None
        Field that names the frame.
    burst : Burst or None
        Further fields if a message holds many samples.
    what : str
        Description for the user of the fields that are read.
    temperature : str or None
        Field with the temperature of the sensor, which is read separately, see `thermometer`.

    """

    gyro: Vector | None
    accel: Vector | None
    stamps: tuple[Stamp, ...] = ()
    frame_id: str | None = None
    burst: Burst | None = None
    what: str = ''
    temperature: str | None = None

    def thermometer(self) -> 'ImuFields | None':
        """Return fields that read the temperature alone, as the first three sample columns."""
        if self.temperature is None:
            return None
        return ImuFields(Vector((self.temperature,) * 3), None, self.stamps, self.frame_id,
                         what=f'its field {self.temperature}')

    def vectors(self) -> Iterator[tuple[int, Vector]]:
        """Yield the vectors that exist, each with its first column in the samples."""
        for first, vector in ((0, self.gyro), (3, self.accel)):
            if vector is not None:
                yield first, vector

    def needed(self) -> set[str]:
        """Return the paths of the numbers that make up the samples; in a burst some are arrays."""
        found = {path for _, vector in self.vectors() for path in (
            *vector.paths, vector.scale, vector.per, vector.covariance) if path}
        return found | ({self.burst.samples, self.burst.step_us} if self.burst else set())

    def numbers(self) -> set[str]:
        """Return the paths of all numbers that are read."""
        return self.needed() | {path for stamp in self.stamps for path in stamp.paths}

    def paths(self) -> set[str]:
        """Return the paths of all fields that are read, without array indices."""
        return {split_path(path)[0] for path in self.numbers()} | (
            set() if self.frame_id is None else {self.frame_id})


def split_path(path: str) -> tuple[str, int]:
    """Split the array index off a path: ``a.gyro[1]`` gives ``a.gyro`` and 1."""
    if path.endswith(']'):
        field, _, number = path[:-1].rpartition('[')
        return field, int(number)
    return path, 0


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
        stamps, frame_id = own_clock(types, kind, path)
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


def own_clock(types: Types, type_name: str, path: str = '',
              ) -> tuple[tuple[Stamp, ...], str | None]:
    """Find the stamps and the frame_id among the direct fields of a message."""
    stamps: list[Stamp] = []
    frame_id = None
    for field in types.get(type_name, ()):
        if field.is_message and field.count is None:
            parts = tuple(part.name for part in types.get(field.kind, ()))
            if parts == _TIME:
                stamps.append(Stamp(f'{path}{field.name}'))
            # In ROS 1 a header begins with a sequence number.
            elif parts[-2:] == ('stamp', 'frame_id'):
                stamps.append(Stamp(f'{path}{field.name}.stamp'))
                frame_id = frame_id or f'{path}{field.name}.frame_id'
    return tuple(stamps), frame_id


def vector_of(types: Types, type_name: str, text: str, what: str, si_unit: str) -> Vector:
    """Find the vector that a user names, and perhaps its unit, such as ``imu.rate deg/s``."""
    path, _, unit = text.strip().partition(' ')
    return Vector(_three_numbers(types, type_name, path, what),
                  factor(what, unit.strip() or None, si_unit))


def _three_numbers(types: Types, type_name: str, text: str, what: str) -> tuple[str, str, str]:
    """Find the paths in ``imu.rate``, which has x, y and z, ``gyro[0:3]``, or ``gx,gy,gz``."""
    parts = tuple(part.strip() for part in text.split(','))
    if len(parts) == 3:
        for part in parts:
            number_at(types, type_name, part, what)
        return parts[0], parts[1], parts[2]
    match = re.fullmatch(r'(.*)\[(\d{1,6}):(\d{1,6})\]', text)
    path = match[1] if match else text
    start, stop = (int(match[2]), int(match[3])) if match else (0, 3)
    field = field_at(types, type_name, path, what)
    if match is None and _is_vector(types, field):
        return _components(path)
    is_array = not field.is_message and field.kind != 'string' and field.count is not None
    if not is_array or stop - start != 3 or (field.count and stop > field.count) or (
            match is None and field.count != 3):
        raise ImuAllanError(
            f'{what} {shown(text)}: not three numbers in {shown(type_name)}; name a field with '
            'x, y, z, three elements such as gyro[0:3], or three fields such as gx,gy,gz')
    return f'{path}[{start}]', f'{path}[{start + 1}]', f'{path}[{start + 2}]'


def stamp_of(types: Types, kind: str, text: str) -> Stamp:
    """Find the time that a user names: a number with its unit, or seconds and nanoseconds."""
    path, _, unit = text.strip().partition(' ')
    field = field_at(types, kind, path, '--stamp')
    if field.is_message:
        if {part.name for part in types.get(field.kind, ())} == {*_TIME}:
            return Stamp(path)
        raise ImuAllanError(f'--stamp {shown(text)}: not a time in {shown(kind)}')
    unit_ns = {'s': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}.get(unit.strip())
    if unit_ns is None or not _is_number(field):
        raise ImuAllanError(f'--stamp {shown(text)}: name a number and its unit (s, ms, us or '
                            'ns), or a field with seconds and nanoseconds')
    return Stamp(path, unit_ns)


def number_at(types: Types, type_name: str, path: str, what: str) -> None:
    """Raise ImuAllanError unless `path` is a single number."""
    if not _is_number(field_at(types, type_name, path, what)):
        raise ImuAllanError(f'{what} {shown(path)}: not a number in {shown(type_name)}')


def field_at(types: Types, type_name: str, path: str, what: str) -> Field:
    """Return the field at a dotted path; ImuAllanError lists the existing fields."""
    # Generous for eight levels of names with 100 characters.
    if len(path) > 1000 or re.fullmatch(
            r'[A-Za-z_]\w*(\[\d{1,6}\])?(\.[A-Za-z_]\w*(\[\d{1,6}\])?)*', path) is None:
        raise ImuAllanError(f'{what} {shown(path)}: not a field path such as imu.gyro[0:3]')
    field = Field('', type_name, True, None)
    for part in path.split('.'):
        if not field.is_message or field.count is not None:
            raise ImuAllanError(f'{what} {shown(path)}: {shown(field.name)} has no fields of its '
                                'own')
        name, number = split_path(part)
        fields = {each.name: each for each in types.get(field.kind, ())}
        if name not in fields:
            known = ', '.join(shown(name) for name in list(fields)[:10])
            raise ImuAllanError(f'{what} {shown(path)}: {shown(field.kind)} has no field '
                                f'{shown(name)}; it has {known or "none"}')
        field = fields[name]
        if name != part:
            if field.count is None or (field.count and number >= field.count):
                raise ImuAllanError(f'{what} {shown(path)}: {shown(name)} has no such element')
            field = replace(field, count=None)
    return field


def shown(text: str) -> str:
    """Format text from elsewhere so that it is printable and short."""
    return brief(text, 80)
