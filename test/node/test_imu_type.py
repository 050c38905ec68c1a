# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that are no sensor_msgs/Imu."""

import sys

from geometry_msgs.msg import TwistStamped
from imu_allan.node.imu_type import decoder, message_class, types_of
from imu_allan.recordings.messages.definitions import Definition, parse
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
    malformed: list[int] = []
    [block] = decoder('geometry_msgs/msg/TwistStamped', 'twist.angular', 'twist.linear')(
        [b'\0\1\0\0short', serialize_message(message)], np.array([7, 8]) * 10**9,
        lambda count, _: malformed.append(count))
    # What is no such message is counted and left out.
    assert malformed == [1]
    assert block.samples.tolist() == [[0, 0.25, 0, 0, 0, 9.5]]
    assert (block.header_ns.tolist(), block.receive_ns.tolist(), block.frame_id) == (
        [7 * 10**9], [8 * 10**9], 'imu')


def test_a_class_is_found_by_either_form_of_its_name() -> None:
    assert message_class('geometry_msgs/TwistStamped') is TwistStamped
    with refused('os/msg/../Imu: not the name of a message type, such as sensor_msgs/msg/Imu'):
        message_class('os/msg/../Imu')
