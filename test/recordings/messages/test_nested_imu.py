# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of other types: an Imu inside, found by the definition, or fields by their names."""

from contextlib import closing

from bags import database, figures, insert, raise_malformed, read, refusal, said
from imu_allan.cdr import batches_of, MessageBatch
from imu_allan.recordings import open_recording, RecordingOptions
from imu_allan.recordings.messages.definitions import Definition, field_of, parse
from imu_allan.recordings.messages.imus_in import found_by_shape, imu_messages
import numpy as np
import other_types
from other_types import full_definition, imu, samples, stamped, START_NS, store_with, write_mcap
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer as Ros2Writer
from whole_lines import refused

DRIVER = 'my_driver/msg/Vectornav'
TEXT = ('std_msgs/Header header\nstring raw\nsensor_msgs/Imu imu\n'
        'sensor_msgs/MagneticField mag\nfloat32[] extras\n')
STORE = store_with({DRIVER: TEXT})
COUNT = 200
STAMPS = START_NS + other_types.STEP_NS * np.arange(COUNT)
SINGLE = samples(COUNT).astype(np.float32)
OWN = 'my_driver/msg/Frame'
OWN_TEXT = ('float64 t\nfloat32[6] raw\nInner inner\nint16 gx\nint16 gy\nint16 gz\nstring name\n')
INNER = {'my_driver/msg/Inner': 'geometry_msgs/Point[2] points\nbuiltin_interfaces/Time when\n'}


def driver_messages(inner_ns=None, raw=lambda _: '$VNYMR', extras=lambda _: 2):
    """Make messages whose nested Imu is stamped by `inner_ns`, by default like the outer."""
    field = STORE.types['sensor_msgs/msg/MagneticField']
    for number in range(COUNT):
        header = stamped(STORE, number)
        inner = header if inner_ns is None else stamped(
            STORE, number, 'inner', int(inner_ns(number)))
        yield STORE.serialize_cdr(STORE.types[DRIVER](
            header, raw(number), imu(STORE, number, inner),
            field(header, other_types.vector(STORE, [1, 2, 3]), np.zeros(9)),
            np.arange(extras(number), dtype=np.float32)), DRIVER)


def mcap_of(path, **options):
    return write_mcap(path / 'a.mcap', DRIVER, full_definition(STORE, DRIVER),
                      driver_messages(**options))


def assert_read(path, count=COUNT):
    """Require every bit of the first samples, with their stamps."""
    messages, remarks = read(path)
    assert remarks == []
    assert messages.samples.tobytes() == samples(count).tobytes()
    assert messages.header_ns.tolist() == STAMPS[:count].tolist()
    return messages


def test_every_bit_is_read_between_strings_and_sequences_of_any_length(tmp_path):
    path = mcap_of(tmp_path, raw=lambda n: 'x' * (n * n % 23), extras=lambda n: n % 5)
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/sensor', COUNT)]
        assert recording.topics[0].messages.reported() == (
            'my_driver/msg/Vectornav, its field imu (sensor_msgs/msg/Imu)')
        assert recording.other_topics == {}
    messages = assert_read(path)
    assert messages.frame_id == 'imu_link'
    assert not messages.absent.any()


@pytest.mark.parametrize(('inner_ns', 'uses_own'), [
    (lambda n: START_NS + 7 + n * other_types.STEP_NS, True),
    (lambda n: START_NS // 10**9 * 10**9 + n // 200 * 10**9, False),
    (lambda _: START_NS, False),
], ids=['fine', 'whole seconds', 'constant'])
def test_its_own_stamp_is_used_where_it_advances_finely(tmp_path, inner_ns, uses_own):
    messages, _ = read(mcap_of(tmp_path, inner_ns=inner_ns))
    expected = STAMPS + 7 if uses_own else STAMPS
    assert messages.header_ns.tolist() == expected.tolist()
    assert messages.frame_id == 'inner'


@pytest.mark.parametrize('storage', list(StoragePlugin))
def test_bags_of_rosbags_are_read_as_folders(tmp_path, storage):
    with Ros2Writer(tmp_path / 'bag', version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection('/sensor', DRIVER, typestore=STORE)
        for number, message in enumerate(driver_messages()):
            writer.write(connection, START_NS + number * other_types.STEP_NS, message)
    assert_read(tmp_path / 'bag')


IDL = f"""{'=' * 80}
IDL: my_driver/msg/Simple
#include "sensor_msgs/msg/Imu.idl"
module my_driver {{ module msg {{ struct Simple {{
  string raw;
  sensor_msgs::msg::Imu imu;
}}; }}; }};
"""


def test_definitions_in_idl_are_understood(tmp_path):
    kind = 'my_driver/msg/Simple'
    store = store_with({kind: 'string raw\nsensor_msgs/Imu imu\n'})
    assert_read(write_mcap(tmp_path / 'a.mcap', kind, IDL, [
        store.serialize_cdr(store.types[kind]('a', imu(store, n)), kind) for n in range(20)],
        'ros2idl'), 20)


def test_several_imus_in_a_message_are_topics_of_their_own(tmp_path):
    kind = 'my_driver/msg/Two'
    path = other_types.recorded(
        tmp_path, kind, {kind: 'sensor_msgs/Imu left\nsensor_msgs/Imu[2] others\n'},
        lambda store, n: store.types[kind](
            imu(store, n), [imu(store, n + 1), imu(store, n + 2)]), 20)
    assert refusal(path) == (
        '3 Imu topics; choose one with --topic, or analyze each with --all-topics: /sensor.left '
        '(20 messages), /sensor.others[0] (20 messages), /sensor.others[1] (20 messages)')
    for name, first in (('left', 0), ('others[0]', 1), ('others[1]', 2)):
        messages, _ = read(path, f'/sensor.{name}')
        assert messages.samples.tobytes() == samples(22)[first:first + 20].tobytes()


@pytest.mark.parametrize('named', ['share', 'share/my_driver/msg/Vectornav.msg', None])
def test_definitions_are_found_in_files_packages_and_workspaces(tmp_path, monkeypatch, named):
    # As ROS 2 Humble writes it, without definitions.
    path = tmp_path / 'a.db3'
    with closing(database(path, [('/sensor', DRIVER)])) as opened:
        insert(opened, zip(STAMPS.tolist(), map(bytes, driver_messages()), strict=True))
        opened.commit()
    assert refusal(path) == (
        'no topic of type sensor_msgs/msg/Imu; it holds /sensor (my_driver/msg/Vectornav); the '
        'definition of my_driver/msg/Vectornav is not in the recording (sqlite3 bags before ROS 2 '
        'Iron carry none); name its .msg files with --definitions')
    folder = tmp_path / 'share' / 'my_driver' / 'msg'
    folder.mkdir(parents=True)
    for name, reason in (('none', 'no such file or directory'), ('share', 'no .msg file in it')):
        with refused(f'--definitions {tmp_path / name}: {reason}'):
            open_recording(path, options=RecordingOptions(definitions=(tmp_path / name,)))
    (folder / 'Vectornav.msg').write_text(TEXT)
    if named is None:
        monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    messages, _ = read(path, options=RecordingOptions(
        definitions=(tmp_path / named,) if named else ()))
    assert messages.samples.tobytes() == samples(COUNT).tobytes()


def test_messages_that_do_not_fit_their_definition_are_reported(tmp_path):
    made = list(driver_messages())
    made[5] = bytes(made[5])[:300]
    made[9] = b'\0\1\0\0'
    path = write_mcap(tmp_path / 'a.mcap', DRIVER, full_definition(STORE, DRIVER), made)
    messages, [remark] = read(path)
    assert len(messages) == COUNT - 2
    assert remark == said(path, 'malformed_messages', what='message', count=2, topic='/sensor',
                          type=DRIVER, first=remark.values['first'])
    assert figures(remark.values['first']) == [300, 364]


def test_messages_of_one_size_may_all_be_of_another_form():
    store = store_with({'x/msg/Forms': 'uint32[] a\nuint32[] b\nsensor_msgs/Imu imu\n'})
    make, count = store.types['x/msg/Forms'], 600
    rows = np.array([np.frombuffer(store.serialize_cdr(make(
        np.zeros(number, np.uint32), np.zeros(count - number, np.uint32), imu(store, number)),
        'x/msg/Forms'), np.uint8) for number in range(count)])
    decode = imu_messages('x/msg/Forms', full_definition(store, 'x/msg/Forms')).decoder()
    [block] = decode([MessageBatch(rows, np.zeros(count, np.int64))], raise_malformed)
    assert block.samples.tobytes() == samples(count).tobytes()


@pytest.mark.parametrize('around', ['', 'sensor_msgs/Imu imu\n'])
def test_a_few_lines_that_define_billions_of_messages_are_not_searched_for_ever(around):
    text = around + 'a/B[16] b\na/B[16] c\n' + '=' * 80 + '\nMSG: a/B\na/B[16] b\na/B[16] c\n'
    types = parse('a/msg/A', Definition(text))
    if around:
        [found] = found_by_shape(types, 'a/msg/A').values()
        assert found.gyro.paths[0] == 'imu.angular_velocity.x'
    else:
        with refused('its type holds more than 1000 messages, too many to search for an IMU; name '
                     'the fields with --gyro and --accel'):
            found_by_shape(types, 'a/msg/A')


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


def own(folder):
    def make(store, number):
        point = store.types['geometry_msgs/msg/Point']
        inner = store.types['my_driver/msg/Inner'](
            [point(1., 2., 3.), point(*map(float, SINGLE[number, 3:]))],
            stamped(store, number).stamp)
        return store.types[OWN](1.7e9 + number / 128, np.roll(SINGLE[number], 3), inner,
                                number, -number, 7, 'x' * (number % 3))

    return other_types.recorded(folder, OWN, {**INNER, OWN: OWN_TEXT}, make, COUNT)


def test_any_fields_can_be_named_with_unit_and_clock(tmp_path):
    path = own(tmp_path)
    messages, _ = read(path, options=RecordingOptions(
        gyro='raw[3:6] deg/s', accel='inner.points[1] g', stamp='t s'))
    np.testing.assert_allclose(messages.samples, SINGLE.astype(float) * np.repeat(
        [np.pi / 180, 9.80665], 3), rtol=1e-15)
    assert messages.header_ns.tolist() == [round((1.7e9 + n / 128) * 1e9) for n in range(COUNT)]
    messages, _ = read(path, options=RecordingOptions(gyro='gx,gy,gz', stamp='inner.when'))
    assert messages.samples[:, :3].tolist() == [[n, -n, 7] for n in range(COUNT)]
    assert messages.absent.all(axis=0).tolist() == [False, True]


@pytest.mark.parametrize('kind', ['uint32', 'uint64', 'float64'])
def test_the_seconds_and_nanoseconds_of_a_time_may_be_any_numbers(kind):
    message = np.zeros(1, [('head', 'u1', 4), ('sec', '<i4'), ('pad', 'V4' if kind[-2:] == '64'
                                                               else 'V0'),
                           ('nanosec', np.dtype(kind)), ('gyro', '<f8', 3)])
    message['head'], message['sec'], message['nanosec'] = (0, 1, 0, 0), 7, 5
    decode = imu_messages('a/msg/M', {
        'a/msg/M': (field_of('t', 'a/msg/T'), field_of('gyro', 'float64', 3)),
        'a/msg/T': (field_of('sec', 'int32'), field_of('nanosec', kind))},
        options=RecordingOptions(gyro='gyro', stamp='t')).decoder()
    [block] = decode(batches_of([message.tobytes()], np.zeros(1, np.int64)), raise_malformed)
    assert block.header_ns.tolist() == [7_000_000_005]


@pytest.mark.parametrize(('options', 'reason'), [
    ({}, 'if the fields of one are those of an IMU, name them with --gyro and --accel'),
    ({'gyro': 'rate'}, '--gyro rate: my_driver/msg/Frame has no field rate; it has t, raw, inner, '
                       'gx, gy, gz, name'),
    ({'gyro': 'inner.points[2]'}, '--gyro inner.points[2]: points has no such element'),
    ({'gyro': 'raw'}, '--gyro raw: not three numbers in my_driver/msg/Frame; name a field with x, '
                      'y, z, three elements such as gyro[0:3], or three fields such as gx,gy,gz'),
    ({'gyro': 'raw[3:6] b c'}, '--gyro b c: b c cannot be turned into rad/s; write rad/s or '
                               'deg/s, of counts deg/s/131'),
    ({'gyro': 'raw[0:3]', 'stamp': 't'}, '--stamp t: name a number and its unit (s, ms, us or '
                                         'ns), or a field with seconds and nanoseconds'),
    ({'gyro': '..'}, '--gyro ..: not a field path such as imu.gyro[0:3]'),
])
def test_what_is_no_field_is_one_line(tmp_path, options, reason):
    assert refusal(own(tmp_path), options=RecordingOptions(**options)) == (
        f'no topic of type sensor_msgs/msg/Imu; it holds /sensor (my_driver/msg/Frame); {reason}')


FIFO = 'uint64 timestamp\nfloat32 dt\nfloat32 scale\nuint8 samples\n'


def test_of_a_burst_with_arrays_of_unequal_length_the_common_part_is_read():
    decode = imu_messages('px4_msgs/msg/SensorGyroFifo',
                          f'{FIFO}int16[4] x\nint16[3] y\nint16[4] z\n').decoder()
    message = np.zeros(1, [('head', 'V4'), ('timestamp', 'u8'), ('dt', 'f4'), ('scale', 'f4'),
                           ('samples', 'u1'), ('pad', 'u1'), ('xyz', 'i2', 11)])
    message['head'], message['timestamp'], message['dt'] = b'\0\1', 1000, 125
    message['scale'], message['samples'], message['xyz'] = 1, 2, np.arange(11)
    [block] = decode([MessageBatch(message.view(np.uint8)[None], np.zeros(1, np.int64))],
                     raise_malformed)
    assert block.samples[:, :3].tolist() == [[0, 4, 7], [1, 5, 8]]


def test_a_burst_without_arrays_is_refused():
    with refused('px4_msgs/msg/SensorGyroFifo has no field x in the definition that comes with '
                 'it; name the fields with --gyro and --accel'):
        imu_messages('px4_msgs/msg/SensorGyroFifo', f'{FIFO}int16 x\nint16 y\nint16 z\n')
