# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that are no sensor_msgs/Imu."""

import json
from pathlib import Path
import sys
from types import ModuleType
from typing import Any

from geometry_msgs.msg import TwistStamped
from imu_allan.node.imu_type import decoder, definition_of, message_class
from imu_allan.recordings.messages.definitions import Definition, parse
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros_harness import Ros, start_repeatedly
from std_srvs.srv import Trigger
from whole_lines import refused, Varying

RATE_HZ = 200.0
SAMPLES = 4000


@pytest.mark.parametrize('name', [
    'sensor_msgs/msg/Imu', 'sensor_msgs/msg/Joy', 'diagnostic_msgs/msg/DiagnosticArray',
    'geometry_msgs/msg/TwistWithCovarianceStamped', 'rcl_interfaces/msg/ParameterDescriptor'])
def test_a_definition_from_a_class_is_that_of_its_file(name: str) -> None:
    from rosbags.typesys import get_typestore, Stores
    from rosbags.typesys.msg import get_types_from_msg
    store = get_typestore(Stores.ROS2_JAZZY)
    package, _, base = name.split('/')
    found = parse(name, Definition(definition_of(name)), 'cdr')
    text, _ = store.generate_msgdef(name, ros_version=2)
    expected = get_types_from_msg(text, name)
    assert set(found) == set(expected), (package, base)
    for kind, fields in found.items():
        assert [field.name for field in fields] == [field for field, _ in expected[kind][1]]
    assert found == parse(name, Definition(text), 'cdr')


@pytest.fixture
def px4(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand in for a package that is sourced."""
    class SensorCombined:
        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            return {'timestamp': 'uint64', 'gyro_rad': 'float[3]',
                    'gyro_integral_dt': 'uint32', 'accelerometer_timestamp_relative': 'int32',
                    'accelerometer_m_s2': 'float[3]', 'accelerometer_integral_dt': 'uint32'}

    package, module = ModuleType('px4_msgs'), ModuleType('px4_msgs.msg')
    module.SensorCombined = SensorCombined  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, 'px4_msgs', package)
    monkeypatch.setitem(sys.modules, 'px4_msgs.msg', module)


@pytest.mark.usefixtures('px4')
def test_the_type_of_a_driver_is_read_at_its_meaning() -> None:
    decode = decoder('px4_msgs/msg/SensorCombined')
    row = np.dtype([('head', 'V4'), ('timestamp', '<u8'), ('gyro', '<f4', 3), ('dt', '<u4'),
                    ('relative', '<i4'), ('accel', '<f4', 3), ('accel_dt', '<u4')])
    messages = np.zeros(5, row)
    messages['head'] = bytes([0, 1, 0, 0])
    messages['timestamp'] = 1_000_000 + 5000 * np.arange(5)
    messages['gyro'] = np.arange(15).reshape(5, 3)
    messages['accel'] = -np.arange(15).reshape(5, 3)
    receive_ns = np.arange(5)
    told: list[tuple[int, str]] = []
    blocks = decode([*(message.tobytes() for message in messages[:3]), b'\0\1\0\0short',
                     *(message.tobytes() for message in messages[3:])],
                    np.insert(receive_ns, 3, 99), lambda count, error: told.append(
                        (count, str(error))))
    assert [count for count, _ in told] == [1]
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]),
                                  np.hstack([messages['gyro'], messages['accel']]))
    assert np.concatenate([block.header_ns for block in blocks]).tolist() == (
        1000 * messages['timestamp'].astype(np.int64)).tolist()
    assert np.concatenate([block.receive_ns for block in blocks]).tolist() == [0, 1, 2, 3, 4]


def test_a_type_that_is_not_there_or_holds_no_imu_is_one_line_at_the_start(ros: Ros) -> None:
    def chosen(kind: str, *fields: str) -> list[str]:
        return [word for part in (f'imu_type:={kind}', *fields) for word in ('-p', part)]

    cases = [
        (chosen('no_such_msgs/msg/Imu'), 'imu_type: no_such_msgs/msg/Imu: its Python package '
         "cannot be imported (No module named 'no_such_msgs'); source the workspace that it was "
         'built in'),
        (chosen('sensor_msgs/msg/Nothing'), 'imu_type: sensor_msgs/msg/Nothing: the package '
         'sensor_msgs has no such message'),
        (chosen('Imu'), 'imu_type: Imu: not the name of a message type, such as '
         'sensor_msgs/msg/Imu'),
        (chosen('geometry_msgs/msg/TwistStamped'), 'imu_type: type geometry_msgs/msg/TwistStamped '
         'holds no samples of an IMU that are known; name the fields that hold them with '
         'gyro_field and accel_field'),
        (chosen('geometry_msgs/msg/TwistStamped', 'gyro_field:=twist.no'),
         'imu_type: gyro_field twist.no: geometry_msgs/msg/Twist has no field no; it has linear, '
         'angular'),
        (chosen('geometry_msgs/msg/TwistStamped', "gyro_field:='twist.angular m'"),
         'imu_type: gyro_field m: m cannot be turned into rad/s')]
    results = start_repeatedly(ros, [arguments for arguments, _ in cases])
    for (status, text), (_, line) in zip(results, cases, strict=True):
        assert status == 1, text
        assert text == f'imu_allan_node: parameter {line}\n'


def test_a_class_is_found_by_either_form_of_its_name() -> None:
    assert message_class('geometry_msgs/TwistStamped') is TwistStamped
    with refused('os/msg/../Imu: not the name of a message type, such as sensor_msgs/msg/Imu'):
        message_class('os/msg/../Imu')


def test_the_node_characterizes_fields_that_are_named(ros: Ros) -> None:
    state = ros.folder / 'state'
    parameters = {'publish_period': 0.5, 'imu_type': 'geometry_msgs/msg/TwistStamped',
                  'gyro_field': 'twist.angular deg/s', 'accel_field': 'twist.linear',
                  'state_file': str(state)}
    node = ros.start('imu_allan_node', parameters)
    publisher = ros.node.create_publisher(TwistStamped, ros.name('imu/data_raw'),
                                          QoSProfile(depth=SAMPLES))
    ros.until(lambda: publisher.get_subscription_count() == 1)
    samples = np.random.default_rng(0).normal(0, 0.01, (SAMPLES, 6))
    for number, (x, y, z, a, b, c) in enumerate(samples.tolist()):
        message = TwistStamped()
        message.header.frame_id = 'imu'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            1_700_000_000 * 10**9 + number * 5_000_000, 10**9)
        angular, linear = message.twist.angular, message.twist.linear
        angular.x, angular.y, angular.z = (180 / np.pi * value for value in (x, y, z))
        linear.x, linear.y, linear.z = a, b, c
        publisher.publish(message)

    def saved() -> Any:
        response = ros.call(Trigger, 'imu_allan/save')
        if not response.success:
            return None
        document = json.loads(Path(response.message.splitlines()[0]).read_text())
        return document if document['timeline']['samples'] == SAMPLES else None

    document = ros.until(saved)
    assert document['source']['frame_id'] == 'imu'
    for number, name in enumerate(('gyro_x', 'gyro_y', 'gyro_z', 'accel_x')):
        axis = document['axes'][name]
        assert axis['mean'] == pytest.approx(samples[:, number].mean(), rel=1e-6, abs=1e-9)
        low, high = axis['coefficients']['noise_density']['ci95']
        assert low < 0.01 / RATE_HZ**0.5 * 1.03
        assert high > 0.01 / RATE_HZ**0.5 * 0.97
    assert node.stop() == 0
    # Fields read otherwise are another run.
    again = ros.start('imu_allan_node', {**parameters, 'gyro_field': 'twist.angular'})
    ros.until(lambda: Varying(
        f'a new run: {state} could not be resumed from, its messages were read as '
        'geometry_msgs/msg/TwistStamped twist.angular deg/s twist.linear, now as '
        'geometry_msgs/msg/TwistStamped twist.angular twist.linear; it is kept as '
        'state.settings.<words>') in again.lines)
