# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that are no sensor_msgs/Imu."""

from collections.abc import Mapping, Sequence
import importlib.util
from pathlib import Path
import sys
from types import ModuleType

from geometry_msgs.msg import TwistStamped
from imu_allan.node.imu_type import decoder, message_class, types_of
from imu_allan.recordings import choose_topic, open_recording, read_blocks, RecordingOptions
from imu_allan.recordings.messages.definitions import Definition, Field, parse
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from whole_lines import refused


@pytest.mark.parametrize('name', [
    'sensor_msgs/msg/Imu', 'sensor_msgs/msg/Joy', 'diagnostic_msgs/msg/DiagnosticArray',
    'geometry_msgs/msg/TwistWithCovarianceStamped', 'rcl_interfaces/msg/ParameterDescriptor'])
def test_the_fields_of_a_class_are_those_of_its_file(name: str) -> None:
    from rosbags.typesys import get_typestore, Stores
    text, _ = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(name, ros_version=2)
    assert types_of(name) == parse(name, Definition(text), 'cdr')


def test_a_message_of_named_fields_is_read_without_what_only_pypi_has(
        monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ('rosbags', *sys.modules):
        if module.partition('.')[0] == 'rosbags':
            monkeypatch.setitem(sys.modules, module, None)
    message = TwistStamped()
    message.header.stamp.sec, message.header.frame_id = 7, 'imu'
    message.twist.angular.y, message.twist.linear.z = 0.25, 9.5
    [block] = decoder('geometry_msgs/msg/TwistStamped', 'twist.angular', 'twist.linear')(
        [serialize_message(message)], np.array([8 * 10**9]), lambda *_: None)
    assert block.samples.tolist() == [[0, 0.25, 0, 0, 0, 9.5]]
    assert (block.header_ns.tolist(), block.frame_id) == ([7 * 10**9], 'imu')


PYTHON_NAMES = {'f4': 'float', 'f8': 'double', '?': 'boolean', 'string': 'string',
                **{f'{sign}{size}': f'{"u" * (sign == "u")}int{8 * size}'
                   for sign in 'iu' for size in (1, 2, 4, 8)}}
"""As the generator of ROS calls what a definition has."""


def source_packages(monkeypatch: pytest.MonkeyPatch, types: Mapping[str, Sequence[Field]]) -> None:
    """Stand in for the Python classes of types whose packages are not installed."""
    modules = {package: ModuleType(f'{package}.msg') for package in {
        kind.partition('/')[0] for kind in types} if importlib.util.find_spec(package) is None}
    for package, module in modules.items():
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f'{package}.msg', module)
    for kind, fields in types.items():
        package, _, name = kind.split('/')
        described = {}
        for field in fields:
            base = field.kind.replace('/msg/', '/') if field.is_message else (
                PYTHON_NAMES[field.kind])
            described[field.name] = base if field.count is None else (
                f'{base}[{field.count}]' if field.count else f'sequence<{base}>')
        if package in modules:
            setattr(modules[package], name, type(name, (), {
                'get_fields_and_field_types': staticmethod(described.copy)}))


FOREIGN = ('px4 combined', 'px4 vehicle', 'vectornav', 'vectornav common', 'sbg', 'sbg short',
           'adi', 'leo', 'unitree', 'depthai', 'flat', 'nested', 'named fields')


@pytest.mark.parametrize('name', FOREIGN)
def test_messages_of_other_packages_are_read_by_their_classes_as_in_a_recording(
        name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mcap.reader import make_reader
    from test_accepted_sources import SOURCES
    source = SOURCES[name](tmp_path)
    [(kind, text)] = source.kinds.items()
    types = parse(kind, Definition(text), 'cdr')
    source_packages(monkeypatch, types)
    assert types_of(kind) == types
    with source.path.open('rb') as file:
        messages = [(message.log_time, message.data)
                    for _, _, message in make_reader(file).iter_messages()]
    # What is no such message is counted and left out.
    messages.insert(1, (messages[0][0], b'\0\1\0\0short'))
    malformed: list[int] = []
    receive_ns, contents = zip(*messages, strict=True)
    read = decoder(kind, **source.options)(
        contents, np.array(receive_ns), lambda count, _: malformed.append(count))
    assert sum(malformed) == 1
    with open_recording(source.path, options=RecordingOptions(**source.options)) as recording:
        recorded = list(read_blocks(recording, choose_topic(recording)))
    assert sum(map(len, read)) == len(messages) - 1
    for part in ('samples', 'header_ns', 'receive_ns', 'absent'):
        np.testing.assert_array_equal(*(
            np.concatenate([getattr(block, part) for block in blocks])
            for blocks in (read, recorded)))


def test_a_class_is_found_by_either_form_of_its_name() -> None:
    assert message_class('geometry_msgs/TwistStamped') is TwistStamped
    with refused('os/msg/../Imu: not the name of a message type, such as sensor_msgs/msg/Imu'):
        message_class('os/msg/../Imu')
