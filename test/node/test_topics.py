# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Gyroscope and accelerometer on two topics, messages of other types, and a thermometer."""

from dataclasses import replace
import json
import sys

from bags import mcap_written, serialized
from characterized import celsius_at
from geometry_msgs.msg import AccelStamped, TwistStamped, Vector3Stamped
from imu_allan.analysis import analyze
from imu_allan.block import joined
from imu_allan.cdr import batches_of
from imu_allan.node.reception import decoder, message_class, types_of
from imu_allan.recordings import RecordingOptions
from imu_allan.recordings.messages.definitions import Definition, parse
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from ros_harness import at_rest, Driver, half, HALF_RATES_HZ, lossless, SECOND
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger
from whole_lines import refused, Varying


def test_two_topics_are_the_two_halves_of_one_imu_in_every_respect(ros, health):
    drivers = {name: Driver(ros, f'camera/{name}/sample') for name in HALF_RATES_HZ}
    topics = [driver.topic for driver in drivers.values()]
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'gyro_topic': topics[0], 'accel_topic': topics[1],
        **lossless(topics[0]), **lossless(topics[1])}, best_effort=True)
    for driver in drivers.values():
        driver.wait_for_node()

    def saved(samples):
        for driver in drivers.values():
            driver.until_taken()
        return dict(ros.saved_with(samples))

    # A half that is silent costs the other nothing, and is reported.
    drivers['accel'].replay(half('accel', 20.0))
    document = saved(2500)
    assert sorted(document['axes']) == ['accel_x', 'accel_y', 'accel_z']
    assert 'two_rates' not in {each['code'] for each in document['warnings']}
    ros.until(lambda: health.said('reception gyro', Varying('no message for <number> s'), b'\2'))
    for topic, part in zip(topics, ('reception gyro', 'timeline accel'), strict=True):
        status = health.status(part)
        assert status.hardware_id == topic

    # A reset means both; what comes gives the result of a recording of it.
    assert ros.call(Trigger, 'imu_allan/reset').success
    blocks = {name: half(name, 30.0, 100.0) for name in drivers}
    # The gyroscope has a gap of its own.
    kept = np.ones(len(blocks['gyro']), bool)
    kept[3000:3040] = False
    blocks['gyro'] = blocks['gyro'].part(kept)
    for start in range(0, len(kept), 500):
        for name, block in blocks.items():
            drivers[name].replay(block.part(slice(start, start + 500)))
    document = saved(len(blocks['gyro']))
    with mcap_written(ros.folder / 'both.mcap') as write:
        for name, block in blocks.items():
            for stamp, row in serialized(block):
                write(f'/{name}', stamp, row)
    expected = json.loads(analyze(ros.folder / 'both.mcap', reading=(
        RecordingOptions(gyro_topic='/gyro', accel_topic='/accel'))).to_json())
    for part in ('axes', 'timeline'):
        assert document[part] == expected[part]
    for name, rate_hz in HALF_RATES_HZ.items():
        assert document['axes'][f'{name}_y']['sample_rate_hz'] == pytest.approx(rate_hz, rel=1e-6)
    assert len(document['timeline']['gaps']) == 1
    assert document['source']['topic'] == ', '.join(topics)
    [remark] = [each for each in document['warnings'] if each['code'] == 'two_rates']
    assert remark['message'] == (
        f'the gyroscope from {topics[0]} at 200 Hz and the accelerometer from {topics[1]} at 125 '
        'Hz; rate, gaps and faults are those of the gyroscope')


def test_sensors_that_send_in_turn_on_one_topic_are_an_imu_on_twice_that_topic(ros):
    driver = Driver(ros, 'imu/mixed')
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'gyro_topic': driver.topic, 'accel_topic': driver.topic,
        **lossless(driver.topic)}, best_effort=True)
    driver.wait_for_node()
    halves = [replace(half(name, 20.0), frame_id='imu') for name in HALF_RATES_HZ]
    for part, other in zip(halves, (1, 0), strict=True):
        part.absent[:, other] = True
    both = joined(halves)
    driver.replay(both.part(np.argsort(both.header_ns, kind='stable')))
    document = dict(ros.saved_with(4000))
    assert document['source']['topic'] == driver.topic
    for name, rate_hz in HALF_RATES_HZ.items():
        axis = document['axes'][f'{name}_y']
        assert axis['sample_rate_hz'] == pytest.approx(rate_hz, rel=1e-6)
        assert axis['coefficients']['noise_density']['observable']
    assert document['timeline']['missing'] == 0


def test_useless_messages_cost_the_other_half_nothing_and_are_no_fault_of_the_disk(ros, health):
    drivers = {name: Driver(ros, f'camera/{name}/sample') for name in HALF_RATES_HZ}
    topics = [driver.topic for driver in drivers.values()]
    node = ros.start('imu_allan_node', {
        'publish_period': 0.5, 'clock': 'header', 'gyro_topic': topics[0],
        'accel_topic': topics[1], **lossless(topics[0]), **lossless(topics[1])}, best_effort=True)
    for driver in drivers.values():
        driver.wait_for_node()
    accel = half('accel', 20.0)
    drivers['accel'].replay(replace(accel, header_ns=np.zeros_like(accel.header_ns)))
    drivers['accel'].until_taken()
    why = f'{topics[1]}: header stamps are zero: choose the other clock (parameter clock)'
    ros.until(lambda: health.said('timeline accel', why, b'\2'))
    answer = ros.call(Trigger, 'imu_allan/save')
    assert (answer.success, answer.message) == (False, f'nothing to save: {why}')
    health.news()
    assert health.level('storage') == health.level('estimation') == b'\0'
    drivers['gyro'].replay(half('gyro', 20.0))
    drivers['gyro'].until_taken()
    assert sorted(ros.saved_with(4000)['axes']) == ['gyro_x', 'gyro_y', 'gyro_z']
    # The topic of the other sensor is none to choose in its place.
    ros.node.destroy_publisher(drivers['accel'].publisher)
    ros.until(lambda: Varying(f'no message on {topics[1]} for <number> s; no other node publishes '
                              'Imu messages') in node.lines)
    assert node.stop() == 0
    assert why in node.lines, node.log
    assert 'analyze' not in node.log


def test_each_half_may_have_a_type_of_its_own_whose_fields_are_named(ros):
    topics = {name: ros.name(f'driver/{name}') for name in HALF_RATES_HZ}
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'gyro_topic': topics['gyro'], 'accel_topic': topics['accel'],
        'imu_type': 'geometry_msgs/msg/Vector3Stamped', 'gyro_field': 'vector deg/s',
        'accel_type': 'geometry_msgs/msg/AccelStamped', 'accel_field': 'accel.linear',
        **lossless(topics['gyro']), **lossless(topics['accel'])}, best_effort=True)
    publishers = {name: ros.node.create_publisher(kind, topics[name], QoSProfile(depth=10_000))
                  for name, kind in (('gyro', Vector3Stamped), ('accel', AccelStamped))}
    ros.until(lambda: all(each.get_subscription_count() == 1 for each in publishers.values()))
    blocks = {name: half(name, 20.0) for name in HALF_RATES_HZ}
    for name, block in blocks.items():
        rows = np.degrees(block.samples[:, :3]) if name == 'gyro' else block.samples[:, 3:]
        for stamp, row in zip(block.header_ns.tolist(), rows.tolist(), strict=True):
            message = Vector3Stamped() if name == 'gyro' else AccelStamped()
            message.header.frame_id = block.frame_id
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
            vector = message.vector if name == 'gyro' else message.accel.linear
            vector.x, vector.y, vector.z = row
            publishers[name].publish(message)

    def whole():
        document = ros.saved_with(len(blocks['gyro']))
        return document['axes'] if len(document['axes']) == 6 else None

    axes = ros.until(whole)
    assert axes['accel_y']['sample_rate_hz'] == pytest.approx(125.0, rel=1e-6)
    for number, name in enumerate(('gyro_x', 'gyro_y', 'gyro_z')):
        assert axes[name]['mean'] == pytest.approx(
            blocks['gyro'].samples[:, number].mean(), rel=1e-6, abs=1e-12)
        assert axes[name]['coefficients']['noise_density']['value'] == pytest.approx(
            0.01 / 200**0.5, rel=0.1)


@pytest.mark.parametrize('name', [
    'sensor_msgs/msg/Imu', 'sensor_msgs/msg/Joy', 'diagnostic_msgs/msg/DiagnosticArray',
    'geometry_msgs/msg/TwistWithCovarianceStamped', 'rcl_interfaces/msg/ParameterDescriptor'])
def test_the_fields_of_a_class_are_those_of_its_file(name):
    from rosbags.typesys import get_typestore, Stores
    text, _ = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(name, ros_version=2)
    assert types_of(name) == parse(name, Definition(text), 'cdr')


def test_a_message_of_named_fields_is_read_without_what_only_pypi_has(monkeypatch):
    for module in ('rosbags', *sys.modules):
        if module.partition('.')[0] == 'rosbags':
            monkeypatch.setitem(sys.modules, module, None)
    message = TwistStamped()
    message.header.stamp.sec, message.header.frame_id = 7, 'imu'
    message.twist.angular.y, message.twist.linear.z = 0.25, 9.5
    assert message_class('geometry_msgs/TwistStamped') is TwistStamped
    with refused('os/msg/../Imu: not the name of a message type, such as sensor_msgs/msg/Imu'):
        message_class('os/msg/../Imu')
    malformed = []
    decode = decoder('imu_type', None, {
        'imu_type': 'geometry_msgs/msg/TwistStamped', 'gyro_field': 'twist.angular',
        'accel_field': 'twist.linear', 'stamp_field': '', 'gyro_unit': '', 'accel_unit': ''})
    batches = batches_of([b'\0\1\0\0short', serialize_message(message)],
                         np.array([7, 8]) * 10**9)
    [block] = decode(batches, lambda count, _: malformed.append(count))
    # What is no such message is counted and left out.
    assert malformed == [1]
    assert block.samples.tolist() == [[0, 0.25, 0, 0, 0, 9.5]]
    assert (block.header_ns.tolist(), block.receive_ns.tolist(), block.frame_id) == (
        [7 * 10**9], [8 * 10**9], 'imu')


def test_the_stamp_of_a_named_field_is_that_of_its_own_topic():
    values = dict.fromkeys(('accel_field', 'gyro_unit', 'accel_unit'), '') | {
        'gyro_type': 'geometry_msgs/msg/Vector3Stamped', 'gyro_field': 'vector',
        'accel_type': 'sensor_msgs/msg/Imu', 'stamp_field': 'header.stamp'}
    assert decoder('gyro_type', 'gyro', values)
    assert decoder('accel_type', 'accel', values)


def test_the_bias_is_fitted_over_the_temperature_of_the_topic_in_the_given_units(ros, health):
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'motion': 'keep', 'temperature_topic': 'imu/temperature',
        'gyro_unit': 'deg/s', 'accel_unit': 'g'})
    driver = Driver(ros).wait_for_node()
    publisher = ros.node.create_publisher(Temperature, ros.name('imu/temperature'), 10_000)
    ros.until(lambda: publisher.get_subscription_count() == 1)
    seconds, per_kelvin = np.arange(7200) / 2.0, 2e-3
    block = at_rest(7200, 2.0, seed=3, noise=1e-3, mean=(0, 0, 0, 0, 0, 1))
    block.samples[:, 0] += per_kelvin * celsius_at(seconds)

    def send(first):
        # In kelvin, which is taken as in a recording.
        reading = Temperature(temperature=float(celsius_at(seconds[first])) + 273.15)
        reading.header.stamp.sec, reading.header.stamp.nanosec = divmod(
            int(block.header_ns[first]), SECOND)
        publisher.publish(reading)

    def came(first):
        # Readings are taken without acknowledgement: one may be lost on a busy machine, as are all
        # before the node has found the publisher.
        send(first)
        return health.values('reception').get('temperature_c') not in (None, '') and health.number(
            'reception', 'temperature_c') == pytest.approx(celsius_at(seconds[first]), abs=1e-6)

    ros.until(lambda: came(0))
    for first in range(0, len(block), 8):
        send(first)
        driver.replay(block.part(slice(first, first + 8)))
    ros.until(lambda: came(len(block) - 8))
    # The last fit may have begun before the last readings were taken; what is saved has all.
    document = ros.saved_with(7200)
    axes = document['axes']
    found = {name: axis['trend']['temperature'] for name, axis in axes.items()}
    assert [name for name, one in found.items() if one] == ['gyro_x']
    low, high = np.degrees(found['gyro_x']['ci95'])
    assert low < per_kelvin < high
    assert high - low < 0.1 * per_kelvin
    assert axes['accel_z']['mean'] == pytest.approx(9.80665, rel=1e-3)
    for axis, unit in ('accel_z', 9.80665), ('gyro_y', np.pi / 180):
        assert axes[axis]['coefficients']['noise_density']['value'] == pytest.approx(
            1e-3 * unit / 2**0.5, rel=0.05)
    assert not {'unit_g', 'gravity'} & {remark['code'] for remark in document['warnings']}
    assert not axes['gyro_x']['coefficients']['rate_random_walk']['observable']
