# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of other types as the rosbags library serializes them, and bags of them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from bags import mcap_written
import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

STORES = {'cdr': Stores.ROS2_JAZZY, 'ros1': Stores.ROS1_NOETIC}
STEP_NS = 4_999_873
START_NS = 1_700_000_000_123_456_789


def store_with(definitions: dict[str, str], serialization: str = 'cdr') -> Any:
    """Return a type store that knows types by name and ``.msg`` text."""
    store = get_typestore(STORES[serialization])
    for name, text in definitions.items():
        store.register(get_types_from_msg(text, name))
    return store


def full_definition(store: Any, type_name: str) -> str:
    """Write the definition of a type and of those in it, as recorders do."""
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return text


def stamped(store: Any, number: int, frame_id: str = 'imu_link', stamp_ns: int | None = None,
            ) -> Any:
    """Make a header; by default of message `number` of an even recording."""
    time = START_NS + number * STEP_NS if stamp_ns is None else stamp_ns
    stamp = store.types['builtin_interfaces/msg/Time'](time // 10**9, time % 10**9)
    header = store.types['std_msgs/msg/Header']
    if 'seq' in header.__dataclass_fields__:
        return header(seq=number, stamp=stamp, frame_id=frame_id)
    return header(stamp=stamp, frame_id=frame_id)


def sample(number: int) -> np.ndarray:
    """Return sample `number` of every bag: numbers that no two fields share."""
    return np.sin(number * np.arange(1., 7.) + np.arange(6.))


def samples(count: int) -> np.ndarray:
    return np.array([sample(number) for number in range(count)]).reshape(-1, 6)


def vector(store: Any, values: Sequence[float]) -> Any:
    return store.types['geometry_msgs/msg/Vector3'](*map(float, values))


def imu(store: Any, number: int, header: Any = None, values: Sequence[float] | None = None) -> Any:
    """Make a sensor_msgs/Imu, by default with sample `number`."""
    unknown = np.zeros(9)
    values = sample(number) if values is None else values
    return store.types['sensor_msgs/msg/Imu'](
        header or stamped(store, number),
        store.types['geometry_msgs/msg/Quaternion'](0., 0., 0., 1.), unknown,
        vector(store, values[:3]), unknown, vector(store, values[3:]), unknown)


def write_mcap(path: Path, type_name: str, definition: str, messages: Iterable[bytes],
               encoding: str = 'ros2msg', topic: str = '/sensor') -> Path:
    """Write serialized messages with the mcap library, stamped by their number."""
    encodings = 'ros1' if encoding == 'ros1msg' else 'cdr', encoding
    with mcap_written(path, chunk_size=50_000) as write:
        for number, message in enumerate(messages):
            write(topic, START_NS + number * STEP_NS, message, type_name, definition, encodings)
    return path


def recorded(folder: Path, kind: str, definitions: dict[str, str],
             make: Callable[[Any, int], Any], count: int) -> Path:
    """Write messages of a type, each made of the store of types and its number."""
    store = store_with(definitions)
    return write_mcap(folder / 'a.mcap', kind, full_definition(store, kind),
                      [store.serialize_cdr(make(store, n), kind) for n in range(count)])


def write_ros1(path: Path, store: Any, type_name: str, messages: Iterable[bytes]) -> Path:
    with Ros1Writer(path) as writer:
        connection = writer.add_connection('/sensor', type_name, typestore=store)
        for number, message in enumerate(messages):
            writer.write(connection, START_NS + number * STEP_NS, bytes(message))
    return path
