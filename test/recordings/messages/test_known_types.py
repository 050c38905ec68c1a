# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Types of drivers that are read by name, at the meaning of their own fields."""

from bags import joined
from imu_allan.recordings import choose_topic, open_recording, read_blocks, RecordingOptions
from imu_allan.recordings.messages.imus_in import imu_messages
import numpy as np
from other_types import (
    full_definition,
    recorded,
    samples,
    stamped,
    store_with,
    vector,
    write_mcap,
)
import pytest
from whole_lines import refused

COUNT = 40
GYRO = samples(COUNT)[:, :3].astype(np.float32)
ACCEL = samples(COUNT)[:, 3:].astype(np.float32)
BOTH = np.hstack([GYRO, ACCEL]).astype(np.float64)

PX4_COMBINED = (
    'uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n'
    'int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\n'
    'uint32 accelerometer_integral_dt\nuint8 accelerometer_clipping\n')
PX4_VEHICLE_IMU = (
    'uint64 timestamp\nuint64 timestamp_sample\nuint32 accel_device_id\nuint32 gyro_device_id\n'
    'float32[3] delta_angle\nfloat32[3] delta_velocity\nuint32 delta_angle_dt\n'
    'uint32 delta_velocity_dt\nuint8 delta_angle_clipping\n')
PX4_GYRO = ('uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32 x\nfloat32 y\n'
            'float32 z\nfloat32 temperature\nuint32 error_count\n')
PX4_FIFO = ('uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32 dt\n'
            'float32 scale\nuint8 samples\nint16[32] x\nint16[32] y\nint16[32] z\n')
UNITREE_IMU = ('float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\n'
               'float32[3] rpy\nint8 temperature\n')


def vectors(names, more=''):
    """Define a header, Vector3 fields, and what comes behind them."""
    return 'std_msgs/Header header\n' + ''.join(
        f'geometry_msgs/Vector3 {name}\n' for name in names) + more


def test_what_holds_no_raw_data_is_refused_with_the_reason(tmp_path):
    kind = 'geometry_msgs/msg/Vector3Stamped'
    store = store_with({})
    path = write_mcap(
        tmp_path / 'a.mcap', kind, full_definition(store, kind),
        [store.serialize_cdr(store.types[kind](stamped(store, n), vector(store, [1, 2, 3])), kind)
         for n in range(3)], topic='/filter/free_acceleration')
    line = (f'{path}: topic /filter/free_acceleration is of type {kind}, not '
            'sensor_msgs/msg/Imu; no raw data (xsens_mti_driver: filtered, gravity removed)')
    with open_recording(path) as recording, refused(line):
        choose_topic(recording, '/filter/free_acceleration')


@pytest.mark.parametrize(('kind', 'definition', 'reason'), [
    ('px4_msgs/msg/SensorCombined', 'uint64 timestamp\nfloat32[3] gyro_rad\n',
     'px4_msgs/msg/SensorCombined has no field accelerometer_m_s2 in the definition that comes '
     'with it; name the fields with --gyro and --accel'),
    ('my_driver/msg/Two', 'sensor_msgs/Imu left\nsensor_msgs/Imu right\n',
     'type my_driver/msg/Two holds 2 IMUs (left, right); name the fields of one with --gyro and '
     '--accel')])
def test_a_type_that_is_no_single_imu_is_refused_with_the_reason(kind, definition, reason):
    with refused(reason):
        imu_messages(kind, full_definition(store_with({kind: definition}), kind))


OWN = 'my_driver/msg/Frame'
OWN_TEXT = ('float64 t\nfloat32[6] raw\nInner inner\nint16 gx\nint16 gy\nint16 gz\nstring name\n')
INNER = {'my_driver/msg/Inner': 'geometry_msgs/Point[2] points\nbuiltin_interfaces/Time when\n'}


def own(folder):
    def make(store, number):
        point = store.types['geometry_msgs/msg/Point']
        inner = store.types['my_driver/msg/Inner'](
            [point(1., 2., 3.), point(*map(float, ACCEL[number]))],
            stamped(store, number).stamp)
        return store.types[OWN](
            1.7e9 + number / 128, np.concatenate([ACCEL[number], GYRO[number]]), inner,
            number, -number, 7, 'x' * (number % 3))

    return recorded(folder, OWN, {**INNER, OWN: OWN_TEXT}, make, COUNT)


def read_with(path, **options):
    with open_recording(path, options=RecordingOptions(**options)) as recording:
        return joined(read_blocks(recording, choose_topic(recording)))


def test_any_fields_can_be_named_with_unit_and_clock(tmp_path):
    path = own(tmp_path)
    messages = read_with(path, gyro='raw[3:6] deg/s', accel='inner.points[1] g', stamp='t s')
    np.testing.assert_allclose(
        messages.samples, BOTH * np.repeat([np.pi / 180, 9.80665], 3), rtol=1e-15)
    assert messages.header_ns.tolist() == [
        round((1.7e9 + n / 128) * 1e9) for n in range(COUNT)]
    messages = read_with(path, gyro='gx,gy,gz', stamp='inner.when')
    assert messages.samples[:, :3].tolist() == [[n, -n, 7] for n in range(COUNT)]
    assert messages.absent.all(axis=0).tolist() == [False, True]


@pytest.mark.parametrize(('options', 'reason'), [
    ({'gyro': 'rate'}, '--gyro rate: my_driver/msg/Frame has no field rate; it has t, raw, inner, '
                       'gx, gy, gz, name'),
    ({'gyro': 'inner.points[2]'}, '--gyro inner.points[2]: points has no such element'),
    ({'gyro': 'raw'}, '--gyro raw: not three numbers in my_driver/msg/Frame; name a field with x, '
                      'y, z, three elements such as gyro[0:3], or three fields such as gx,gy,gz'),
    ({'gyro': 'raw[3:6] b c'}, '--gyro b c: b c cannot be turned into rad/s; write rad/s or '
                               'deg/s'),
    ({'gyro': 'raw[0:3]', 'stamp': 't'}, '--stamp t: name a number and its unit (s, ms, us or '
                                         'ns), or a field with seconds and nanoseconds'),
    ({'gyro': '..'}, '--gyro ..: not a field path such as imu.gyro[0:3]'),
])
def test_what_is_no_field_is_one_line(tmp_path, options, reason):
    path = own(tmp_path)
    line = (f'{path}: no topic of type sensor_msgs/msg/Imu; it holds /sensor '
            f'(my_driver/msg/Frame); {reason}')
    with open_recording(path, options=RecordingOptions(**options)) as recording, refused(line):
        choose_topic(recording)
