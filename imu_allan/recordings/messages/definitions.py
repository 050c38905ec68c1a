# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Definitions of message types, from a recording, from the user, or from sourced packages.

The `rosbags` library parses them; this module converts them to the ordered fields of each type.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
import os
from pathlib import Path
import re
from typing import Any, Literal

from imu_allan.cdr import Serialization
from imu_allan.errors import brief, ImuAllanError, printable

Form = Literal['msg', 'idl']

FORMS: Mapping[str, Form] = {'ros2msg': 'msg', 'ros1msg': 'msg', 'ros2idl': 'idl', 'omgidl': 'idl'}
"""The encodings of definitions in containers, mapped to their two languages."""

_SEPARATOR = '=' * 80 + '\n'
"""Separator that rosbag and rosbag2 put between the definitions of nested types."""
_LARGEST = 1 << 20
"""Largest definition to parse, in bytes; the largest one of ROS has 40,000."""
_BASE = {
    'bool': 'u1', 'byte': 'u1', 'octet': 'u1', 'char': 'u1', 'int8': 'i1', 'uint8': 'u1',
    'int16': 'i2', 'uint16': 'u2', 'int32': 'i4', 'uint32': 'u4', 'int64': 'i8', 'uint64': 'u8',
    'float32': 'f4', 'float': 'f4', 'float64': 'f8', 'double': 'f8', 'string': 'string'}


@dataclass(frozen=True)
class Definition:
    """The text of a definition, with those of nested types, and its language."""

    text: str
    form: Form = 'msg'


@dataclass(frozen=True)
class Field:
    """
    A field of a message.

    Attributes
    ----------
    name : str
        Name of the field.
    kind : str
        Type code of a number such as 'f8', or 'string', or the name of a message type.
    is_message : bool
        Whether `kind` is a message type.
    count : int or None
        None for a single value, n for an array of n values, 0 for a sequence.

    """

    name: str
    kind: str
    is_message: bool
    count: int | None


Types = Mapping[str, tuple[Field, ...]]
"""The fields of each type, by type name as ROS 2 spells it."""


def field_of(name: str, kind: str, count: int | None = None) -> Field:
    """Create a field from the name of a base type or message type in a definition."""
    # An unknown base type, such as wstring, is treated like an undefined message type.
    return Field(name, _BASE.get(kind, kind), kind not in _BASE, count)


def fields_in(text: str) -> Iterator[Field]:
    """Parse fields such as ``float64[9] covariance``, separated by semicolons, up to damage."""
    for written in text.split(';'):
        found = re.fullmatch(r'([\w/]+)(?:\[([1-9]\d{0,3})\])? (\w+)', written)
        if found is None:
            return
        yield field_of(found[3], found[1], int(found[2]) if found[2] else None)


@lru_cache
def imu_types(serialization: Serialization) -> Types:
    """Return the fields of sensor_msgs/Imu, for which no parser has to be imported."""
    sequence, unsigned = ('uint32 seq;', 'u') if serialization == 'ros1' else ('', '')
    return {name: tuple(fields_in(text)) for name, text in {
        'sensor_msgs/msg/Imu': (
            'std_msgs/msg/Header header;'
            'geometry_msgs/msg/Quaternion orientation;float64[9] orientation_covariance;'
            'geometry_msgs/msg/Vector3 angular_velocity;float64[9] angular_velocity_covariance;'
            'geometry_msgs/msg/Vector3 linear_acceleration;'
            'float64[9] linear_acceleration_covariance'),
        'std_msgs/msg/Header': f'{sequence}builtin_interfaces/msg/Time stamp;string frame_id',
        'builtin_interfaces/msg/Time': f'{unsigned}int32 sec;uint32 nanosec',
        'geometry_msgs/msg/Quaternion': 'float64 x;float64 y;float64 z;float64 w',
        'geometry_msgs/msg/Vector3': 'float64 x;float64 y;float64 z'}.items()}


def normal_name(type_name: str) -> str:
    """Return the name of a type as ROS 2 spells it: package/msg/Name."""
    package, _, name = type_name.rpartition('/')
    return type_name if not package or '/' in package else f'{package}/msg/{name}'


def parse(type_name: str, definition: Definition | Types,
          serialization: Serialization = 'cdr') -> Types:
    """
    Parse the definition of a type and of the types nested in it.

    ROS types missing from the text are taken from ROS 2 Jazzy, or ROS 1 Noetic for ``'ros1'``.
    """
    if not isinstance(definition, Definition):
        return definition
    from rosbags.typesys import get_types_from_idl, get_types_from_msg, get_typestore, Stores

    name = normal_name(type_name)
    if len(definition.text) > _LARGEST:
        raise ImuAllanError(f'the definition of {brief(name)} has more than '
                            f'{_LARGEST} characters')
    found: dict[str, Any] = {}
    try:
        if definition.form == 'msg':
            found.update(get_types_from_msg(definition.text, name))
        else:
            for part in definition.text.split(_SEPARATOR):
                head, _, rest = part.partition('\n')
                # The parser does not support preprocessor lines such as #include.
                text = re.sub('(?m)^[ \t]*#.*$', '', rest if head.startswith('IDL: ') else part)
                if text.strip():
                    found.update(get_types_from_idl(text))
    # The parser raises its own error, but also KeyError, RecursionError or AssertionError.
    except Exception as error:
        reason = brief(' '.join(str(error).split()), 80)
        raise ImuAllanError(
            f'the definition of {brief(name)} cannot be parsed ({reason})') from error
    if name not in found:
        raise ImuAllanError(f'the definition of {brief(name)} defines another type')
    types = {known: _fields(nodes) for known, (_, nodes) in found.items()}
    if _undefined(types):
        store = get_typestore(Stores.ROS1_NOETIC if serialization == 'ros1' else Stores.ROS2_JAZZY)
        while missing := [kind for kind in _undefined(types) if kind in store.fielddefs]:
            types |= {kind: _fields(store.fielddefs[kind][1]) for kind in missing}
    return types


def _undefined(types: Types) -> set[str]:
    return {field.kind for fields in types.values() for field in fields
            if field.is_message and field.kind not in types}


def _fields(nodes: Iterable[tuple[str, Any]]) -> tuple[Field, ...]:
    return tuple(_field(name, node) for name, node in nodes)


def _field(name: str, node: tuple[int, Any]) -> Field:
    kind, content = int(node[0]), node[1]
    # rosbags: 1 is a base type, 2 a message, 3 an array, 4 a sequence.
    if kind in (3, 4):
        element, size = content
        return replace(_field(name, element), count=int(size) if kind == 3 else 0)
    return field_of(name, str(content if kind == 2 else content[0]))


@lru_cache(maxsize=4)
def definition_files(paths: tuple[Path | str, ...]) -> Mapping[str, Path]:
    """Find ``.msg`` files in the given paths, by type; raise ImuAllanError if there are none."""
    found: dict[str, Path] = {}
    for path in map(Path, paths):
        files = [path] if path.is_file() else sorted(path.rglob('*.msg'))
        if not path.exists():
            raise ImuAllanError(f'--definitions {printable(path)}: no such file or directory')
        if not files:
            raise ImuAllanError(f'--definitions {printable(path)}: no .msg file in it')
        for file in files:
            folder = file.resolve().parent
            kind = f'{folder.parent.name}/msg/{file.stem}' if folder.name == 'msg' else file.stem
            found.setdefault(kind, file)
    return found


def find_definition(type_name: str, paths: tuple[Path | str, ...]) -> Definition | None:
    """
    Assemble the definition of a type and its nested types; return None if there is none.

    Each is read from the files in `paths`, or else from sourced packages.
    """
    name, files = normal_name(type_name), definition_files(paths)
    texts: dict[str, str] = {}
    wanted = [name]
    while wanted:
        kind = wanted.pop()
        # A file outside a folder named msg defines the type of that name for any package.
        file = files.get(kind) or files.get(kind.rpartition('/')[2]) or _sourced(kind)
        if kind in texts or file is None:
            continue
        try:
            texts[kind] = file.read_bytes()[:_LARGEST].decode('utf-8', 'replace')
        except OSError as error:
            raise ImuAllanError(f'{printable(file)}: {error.strerror}') from error
        wanted += _named_types(texts[kind], kind.partition('/')[0])
    if name not in texts:
        return None
    first = texts.pop(name)
    return Definition(first + ''.join(
        f'\n{_SEPARATOR}MSG: {kind}\n{text}' for kind, text in texts.items()))


def _sourced(type_name: str) -> Path | None:
    package, _, base = type_name.partition('/')
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    files = (Path(prefix, 'share', package, f'{base}.msg') for prefix in prefixes)
    return next(filter(Path.is_file, files), None)


def _named_types(text: str, package: str) -> list[str]:
    """List the types used in the lines of a ``.msg`` file, except base types."""
    words = (line.split('#')[0].split() for line in text.splitlines())
    kinds = {line[0].split('[')[0].split('<')[0] for line in words if len(line) > 1}
    return [normal_name(kind if '/' in kind else f'{package}/{kind}')
            for kind in sorted(kinds - _BASE.keys())]
