# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Every source that is accepted, asked of info, analyze, check and what the node decodes with."""

from dataclasses import dataclass, field
import json
from pathlib import Path
import re
from struct import pack

from bags import joined, mcap_written
from imu_allan.cli.main import main
from imu_allan.recordings import open_recording, read_blocks, RecordingOptions
from imu_allan.recordings.messages.imus_in import imu_messages
import numpy as np
import other_types
from other_types import full_definition, stamped, store_with, vector, write_ros1
import pytest
from repeated import slow

COUNT, RATE_HZ = 1000, 250.0
STEP_US = 4000
TIMES_US = 1_700_000_000_000_000 + STEP_US * np.arange(COUNT)
MEAN = np.array([0.01, -0.02, 0.03, 0.5, -0.4, 9.8])
SIGMA = np.repeat([0.004, 0.05], 3)
SAMPLES = (MEAN + SIGMA * np.random.default_rng(11).normal(size=(COUNT, 6))).astype(
    np.float32).astype(float)
GYRO, ACCEL = SAMPLES[:, :3], SAMPLES[:, 3:]
F32 = np.float32
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


@dataclass
class Source:
    """A recording, the options it needs, and what its samples are."""

    path: Path
    options: dict = field(default_factory=dict)
    kinds: dict = field(default_factory=dict)
    rates: tuple = (RATE_HZ,)
    first_ns: int = int(TIMES_US[0]) * 1000
    coarseness: float = 0.0
    stamped: bool = True


def header(store, number):
    return stamped(store, number, stamp_ns=int(TIMES_US[number]) * 1000)


def imu(store, number, gyro=True, accel=True):
    return other_types.imu(store, number, header(store, number),
                           SAMPLES[number] * np.repeat([gyro, accel], 3))


def mcap(folder, *topics, **more):
    """Write topics of ROS 2 messages: type, definitions, and what makes message n."""
    kinds = {}
    path = folder / 'a.mcap'
    with mcap_written(path, chunk_size=50_000) as write:
        for number, (kind, definitions, make) in enumerate(topics):
            store = store_with(definitions)
            kinds[kind] = full_definition(store, kind)
            for message in range(COUNT):
                made = make(store, message)
                if made is not None:
                    write(f'/sensor{number}', int(TIMES_US[message]) * 1000 + 700,
                          store.serialize_cdr(made, kind), kind, kinds[kind])
    return Source(path, kinds=kinds, **more)


def typed(kind, text, make, inner=None, **more):
    """Make messages of one type out of the values of their fields."""
    return lambda folder: mcap(
        folder, (kind, {**(inner or {}), kind: text},
                 lambda store, n: store.types[kind](*make(store, n))), **more)


def flat(kind, names, scales=(1.0, 1.0)):
    """Make messages of a header, an acceleration and a rate."""
    text = ''.join(f'geometry_msgs/Vector3 {name}\n' for name in names.split())
    return typed(kind, f'std_msgs/Header header\n{text}', lambda store, n: (
        header(store, n), vector(store, ACCEL[n] * scales[1]), vector(store, GYRO[n] * scales[0])))


def px4(name, text, *values, **more):
    """Make messages of one type of px4_msgs, or of two with a half each."""
    def of(kind, half):
        def make(store, n):
            made = tuple(values[half](n))
            return store.types[kind](*made) if made else None

        return kind, {kind: text}, make

    names = [f'px4_msgs/msg/{each}' for each in name.split()]
    return lambda folder: mcap(
        folder, *(of(kind, half) for half, kind in enumerate(names)),
        rates=(RATE_HZ,) * len(names), **more)


def one_of(half):
    return lambda n: (TIMES_US[n] + 90, TIMES_US[n], 1, *half[n].astype(F32), 20.0, 0)


def fifo_of(half, scale):
    def values(n):
        if n % 10 != 9:
            return ()
        raw = np.zeros((3, 32), np.int16)
        raw[:, :10] = np.rint(half[n - 9:n + 1].T / scale)
        return TIMES_US[n] + 90, TIMES_US[n], 1, float(STEP_US), scale, 10, *raw

    return values


MAGNETIC, UNITREE = 'sensor_msgs/msg/MagneticField', 'unitree_go/msg/IMUState'
named_fields = typed(
    'my_driver/msg/Frame', 'float64 t\nfloat64[6] raw\n', lambda _, n: (
        TIMES_US[n] * 1e-6, np.concatenate([ACCEL[n] / 9.80665, np.degrees(GYRO[n])])),
    options={'gyro': 'raw[3:6] deg/s', 'accel': 'raw[0:3] g', 'stamp': 't s'})


def halves(folder):
    kind = 'sensor_msgs/msg/Imu'
    return mcap(folder, (kind, {}, lambda store, n: imu(store, n, accel=False)),
                (kind, {}, lambda store, n: None if n % 2 else imu(store, n, gyro=False)),
                rates=(RATE_HZ, RATE_HZ / 2))


def ros1(folder):
    store = store_with({}, 'ros1')
    kind = 'sensor_msgs/msg/Imu'
    # The steps of the receive stamps are others; those of the header count.
    return Source(write_ros1(folder / 'a.bag', store, kind, [
        bytes(store.serialize_ros1(imu(store, n), kind)) for n in range(COUNT)]))


def ulog(folder):
    pytest.importorskip('pyulog')
    from test_px4_ulog import COMBINED, write as write_ulog

    return Source(write_ulog(folder / 'a.ulg', {COMBINED[0]: (COMBINED[1], [
        pack('<Q3fIi3f', int(TIMES_US[n]), *GYRO[n], STEP_US, 0, *ACCEL[n])
        for n in range(COUNT)])}))


def ardupilot(folder):
    pytest.importorskip('pymavlink')
    from test_ardupilot_log import write as write_ardupilot

    return Source(write_ardupilot(folder / 'a.bin', [
        ('IMU', (int(TIMES_US[n]), 0, *GYRO[n], *ACCEL[n], 0, 0, 40.0, 1, 1, 250, 250))
        for n in range(COUNT)]))


def named_columns(folder):
    path = folder / 'a.csv'
    rows = np.column_stack([TIMES_US / 1e6, np.degrees(GYRO), ACCEL]).tolist()
    path.write_text('\n'.join(['t,a,b,c,d,e,f', *(','.join(map(str, row)) for row in rows), '']))
    return Source(path, {'gyro': ':deg/s', 'columns':
                         'time=t,gyro_x=a,gyro_y=b,gyro_z=c,accel_x=d,accel_y=e,accel_z=f'})


SOURCES = {
    'bare': lambda folder: mcap(folder, ('sensor_msgs/msg/Imu', {}, imu)),
    'ROS 1': ros1, 'halves': halves, 'named fields': named_fields,
    'nested': typed('my_driver/msg/Out', 'std_msgs/Header header\nstring raw\n'
                    'sensor_msgs/Imu imu\n',
                    lambda store, n: (header(store, n), '$VNYMR', imu(store, n))),
    'depthai': typed(
        'depthai_ros_msgs/msg/ImuWithMagneticField', 'std_msgs/Header header\n'
        'sensor_msgs/Imu imu\nsensor_msgs/MagneticField field\n', lambda store, n: (
            header(store, n), imu(store, n), store.types[MAGNETIC](
                header(store, n), vector(store, [0, 0, 0]), np.zeros(9)))),
    'unitree': typed(
        'unitree_go/msg/LowState', 'uint8[2] head\nIMUState imu_state\nuint32 tick\n',
        lambda store, n: (np.zeros(2, np.uint8), store.types[UNITREE](
            np.zeros(4, F32), GYRO[n].astype(F32), ACCEL[n].astype(F32), np.zeros(3, F32), 30),
            n), {UNITREE: UNITREE_IMU}, stamped=False),
    'leo': typed(
        'leo_msgs/msg/Imu', 'builtin_interfaces/Time stamp\nfloat32 temperature\n' + ''.join(
            f'float32 {sensor}_{axis}\n' for sensor in ('gyro', 'accel') for axis in 'xyz'),
        lambda store, n: (header(store, n).stamp, 20.0, *GYRO[n], *ACCEL[n])),
    'vectornav common': typed(
        'vectornav_msgs/msg/CommonGroup', 'std_msgs/Header header\nuint64 timestartup\n'
        'geometry_msgs/Vector3 imu_rate\ngeometry_msgs/Vector3 imu_accel\n', lambda store, n: (
            header(store, n), 77 + STEP_US * 1000 * n, vector(store, GYRO[n]),
            vector(store, ACCEL[n])), first_ns=77),
    'flat': flat('my_driver/msg/Any', 'linear_acceleration angular_velocity'),
    'vectornav': flat('vectornav_msgs/msg/ImuGroup', 'uncompaccel uncompgyro'),
    'sbg': flat('sbg_driver/msg/SbgImuData', 'accel gyro'),
    'sbg short': flat('sbg_driver/msg/SbgImuShort', 'delta_velocity delta_angle',
                      scales=(67108864.0, 1048576.0)),
    'px4 combined': px4('SensorCombined', PX4_COMBINED, lambda n: (
        TIMES_US[n], GYRO[n].astype(F32), STEP_US, 0, ACCEL[n].astype(F32), STEP_US, 0)),
    'px4 vehicle': px4('VehicleImu', PX4_VEHICLE_IMU, lambda n: (
        TIMES_US[n] + 90, TIMES_US[n], 1, 2, (GYRO[n] * STEP_US * 1e-6).astype(F32),
        (ACCEL[n] * 5000e-6).astype(F32), STEP_US, 5000, 0)),
    'px4 halves': px4('SensorGyro SensorAccel', PX4_GYRO, one_of(GYRO), one_of(ACCEL)),
    'px4 fifo': px4('SensorGyroFifo SensorAccelFifo', PX4_FIFO, fifo_of(GYRO, 2.0**-14),
                    fifo_of(ACCEL, 2.0**-11), coarseness=2.0**-11),
    'ULog': ulog, 'ArduPilot': ardupilot, 'named columns': named_columns,
}


CHECKED = {'bare', 'halves', 'named fields', 'px4 fifo', 'ULog', 'named columns'}
"""Of every kind of file, with options and on two topics: analyze and check read the same."""


@pytest.mark.parametrize(('name', 'checked'), [
    *((name, name in CHECKED) for name in SOURCES),
    *(slow(name, True) for name in SOURCES if name not in CHECKED)])
def test_info_analyze_check_and_the_node_read_a_source_equally(name, checked, tmp_path, output_of):
    source = SOURCES[name](tmp_path)
    words = [word for key, value in source.options.items()
             for word in (f'--{key.replace("_", "-")}', value)]
    shown = output_of('info', source.path, *words)
    assert 'unusable' not in shown
    rates = [float(rate) for rate in re.findall(r'^  rate +([\d.]+) Hz', shown, re.MULTILINE)]
    assert rates == pytest.approx(source.rates, rel=1e-4)
    if 'columns' not in source.options:
        assert_read(source)
    if checked:
        assert_analyzed(source, rates, words, tmp_path)


def assert_read(source):
    """Require every sample and stamp, and that the node decodes the messages in the same way."""
    reading = RecordingOptions(**source.options)
    with open_recording(source.path, options=reading) as recording:
        kinds = [topic.messages.reported() for topic in recording.topics]
        for number, (topic, rate) in enumerate(zip(recording.topics, source.rates, strict=True)):
            step = round(RATE_HZ / rate)
            columns = slice(3 * number, 3 * number + 3 if len(source.rates) > 1 else 6)
            messages = joined(read_blocks(recording, topic.name))
            stamps = messages.header_ns if source.stamped else messages.receive_ns - 700
            assert np.abs(stamps - source.first_ns
                          - 1000 * STEP_US * np.arange(0, COUNT, step)).max() < 300
            np.testing.assert_allclose(messages.samples[:, columns], SAMPLES[::step, columns],
                                       rtol=2e-7, atol=source.coarseness / 2)
    node = [imu_messages(kind, definition, options=reading).reported()
            for kind, definition in source.kinds.items()]
    assert not node or kinds == node * (len(kinds) // len(node))


def assert_analyzed(source, rates, words, tmp_path):
    """Require the numbers of analyze, and of check those that analyze gave."""
    assert main(['analyze', str(source.path), *words, '--json', str(tmp_path / 'r.json')]) == 0
    result = json.loads((tmp_path / 'r.json').read_text())
    assert list(result['axes']) == [f'{sensor}_{axis}' for sensor in ('gyro', 'accel')
                                    for axis in 'xyz']
    for number, axis in enumerate(result['axes'].values()):
        rate = axis.get('sample_rate_hz') or result['timeline']['sample_rate_hz']
        assert rate == pytest.approx(rates[number // 3 if len(rates) > 1 else 0], rel=1e-6)
        assert axis['mean'] == pytest.approx(MEAN[number], abs=5 * SIGMA[number] / 500**0.5)
        assert axis['coefficients']['noise_density']['value'] == pytest.approx(
            SIGMA[number] / rate**0.5, rel=0.15)
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.01 rad/s/sqrt(Hz)}\n'
                                        'accel: {noise_density: 0.1 m/s^2/sqrt(Hz)}\n')
    assert main(['check', str(source.path), *words, '--spec', str(tmp_path / 'spec.yaml'),
                 '--json', str(tmp_path / 'c.json')]) == 0
    found = json.loads((tmp_path / 'c.json').read_text())['checks']
    assert {each['axis']: each['value'] for each in found} == {
        axis: each['coefficients']['noise_density']['value']
        for axis, each in result['axes'].items()}
