# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Gyroscope and accelerometer on two topics, at two rates, as a RealSense publishes them."""

from dataclasses import replace
import json
from typing import Any

from geometry_msgs.msg import AccelStamped, Vector3Stamped
from imu_allan.analysis import analyze
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.recordings import RecordingOptions
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros_harness import (
    at_rest,
    Driver,
    Health,
    lossless,
    Process,
    recorded,
    Ros,
    said_in,
    start_repeatedly,
    yaml_value,
)
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from whole_lines import Varying

RATES_HZ = {'gyro': 200.0, 'accel': 125.0}


def half(name: str, seconds: float, start_s: float = 0.0) -> ImuBlock:
    """Give messages of one sensor, the other half of each zero."""
    block = at_rest(round(seconds * RATES_HZ[name]), RATES_HZ[name], start_s=start_s,
                    seed=len(name) + round(start_s))
    block.samples[:, slice(3, 6) if name == 'gyro' else slice(3)] = 0
    return replace(block, frame_id=f'{name}_frame')


def test_two_topics_are_the_two_halves_of_one_imu_in_every_respect(
        ros: Ros, health: Health) -> None:
    drivers = {name: Driver(ros, f'camera/{name}/sample') for name in RATES_HZ}
    topics = [driver.topic for driver in drivers.values()]
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'gyro_topic': topics[0], 'accel_topic': topics[1],
        **lossless(topics[0]), **lossless(topics[1])}, best_effort=True)
    results = ros.listen(String, 'imu_allan/result')
    for driver in drivers.values():
        driver.wait_for_node()

    def publish(name: str, block: ImuBlock) -> None:
        for row in encode_imu_rows(block):
            drivers[name].send(row.tobytes())

    def saved(samples: int) -> dict[str, Any]:
        for driver in drivers.values():
            driver.until_taken()
        return dict(ros.saved_with(samples))

    # A half that is silent costs the other nothing, and is reported.
    publish('accel', half('accel', 20.0))
    assert sorted(saved(2500)['axes']) == ['accel_x', 'accel_y', 'accel_z']
    ros.until(lambda: health.said('reception gyro', Varying('no message for <number> s'), b'\2'))
    for topic, part in zip(topics, ('reception gyro', 'timeline accel'), strict=True):
        status = health.status(part)
        assert status is not None
        assert status.hardware_id == topic

    # A reset means both; what comes gives the result of a recording of it.
    assert ros.call(Trigger, 'imu_allan/reset').success
    blocks = {name: half(name, 30.0, 100.0) for name in RATES_HZ}
    # The gyroscope has a gap of its own.
    kept = np.ones(len(blocks['gyro']), bool)
    kept[3000:3040] = False
    blocks['gyro'] = blocks['gyro'].part(kept)
    for start in range(0, len(kept), 500):
        for name, block in blocks.items():
            publish(name, block.part(slice(start, start + 500)))
    document = saved(len(blocks['gyro']))
    expected = json.loads(analyze(recorded(ros.folder / 'both.mcap', blocks), reading=(
        RecordingOptions(gyro_topic='/gyro', accel_topic='/accel'))).to_json())
    for part in ('axes', 'timeline'):
        assert document[part] == expected[part]
    rates = [document['axes'][f'{name}_y']['sample_rate_hz'] for name in RATES_HZ]
    assert rates == pytest.approx(list(RATES_HZ.values()), rel=1e-6)
    assert len(document['timeline']['gaps']) == 1
    assert document['source']['topic'] == ', '.join(topics)
    [remark] = [each for each in document['warnings'] if each['code'] == 'two_rates']
    assert remark['message'] == (
        f'the gyroscope from {topics[0]} at 200 Hz and the accelerometer from {topics[1]} at 125 '
        'Hz; rate, gaps and faults are those of the gyroscope')
    assert ros.until(lambda: [message for message in results if set(
        json.loads(message.data)['axes']) == set(document['axes'])])

    # A pause is a gap of both, interpolated by neither.
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=True)).success
    for name, driver in drivers.items():
        publish(name, half(name, 5.0, 130.0))
        assert driver.publisher.wait_for_all_acked()
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=False)).success
    for name in RATES_HZ:
        publish(name, half(name, 5.0, 135.0))
    document = saved(len(blocks['gyro']) + 1000)
    ros.until(lambda: [health.number(f'reception {name}', 'passed_over')
                       for name in RATES_HZ] == [1000, 625])
    assert [round(gap['duration_s'], 1) for gap in document['timeline']['gaps']] == [0.2, 5.0]


def test_the_driver_of_a_half_that_is_killed_leaves_a_gap_in_its_own_half(
        ros: Ros, health: Health) -> None:
    gyro, accel = (ros.name(f'camera/{name}/sample') for name in RATES_HZ)
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'gyro_topic': gyro,
                                        'accel_topic': accel}, best_effort=True)
    results = ros.listen(String, 'imu_allan/result')

    def driver(topic: str) -> Process:
        return ros.start('imu_simulator', {'rate': 200.0, 'wait_for_subscriptions': 1},
                         remaps={'imu/data_raw': topic})

    def latest() -> dict[str, Any]:
        return dict(json.loads(results[-1].data)) if results else {'axes': {}}

    killed, _ = driver(gyro), driver(accel)
    ros.until(lambda: len(latest()['axes']) == 6)
    killed.popen.kill()
    killed.wait()
    health.heard.clear()
    ros.until(lambda: health.level('reception gyro') == b'\2')
    assert health.level('reception accel') < b'\2'
    driver(gyro)
    ros.until(lambda: latest()['timeline']['gaps'])
    assert len(latest()['axes']) == 6
    assert 'a new run begins' not in node.log
    assert node.stop() == 0


def test_each_half_may_have_a_type_of_its_own_whose_fields_are_named_and_is_gone_on_with(
        ros: Ros) -> None:
    state = ros.folder / 'state'
    topics = {name: ros.name(f'driver/{name}') for name in RATES_HZ}
    parameters = {
        'publish_period': 0.5, 'gyro_topic': topics['gyro'], 'accel_topic': topics['accel'],
        'imu_type': 'geometry_msgs/msg/Vector3Stamped', 'gyro_field': 'vector deg/s',
        'accel_type': 'geometry_msgs/msg/AccelStamped', 'accel_field': 'accel.linear',
        'state_file': str(state)}
    node = ros.start('imu_allan_node', {
        **parameters, **lossless(topics['gyro']), **lossless(topics['accel'])}, best_effort=True)
    publishers = {name: ros.node.create_publisher(kind, topics[name], QoSProfile(depth=10_000))
                  for name, kind in (('gyro', Vector3Stamped), ('accel', AccelStamped))}
    ros.until(lambda: all(each.get_subscription_count() == 1 for each in publishers.values()))
    blocks = {name: half(name, 20.0) for name in RATES_HZ}
    for name, block in blocks.items():
        for stamp, sample in zip(block.header_ns.tolist(), block.samples.tolist(), strict=True):
            message = Vector3Stamped() if name == 'gyro' else AccelStamped()
            message.header.frame_id = block.frame_id
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            vector = message.vector if name == 'gyro' else message.accel.linear
            factor = 180 / np.pi if name == 'gyro' else 1.0
            vector.x, vector.y, vector.z = (
                factor * value for value in (sample[:3] if name == 'gyro' else sample[3:]))
            publishers[name].publish(message)

    def whole() -> Any:
        document = ros.saved_with(len(blocks['gyro']))
        return document['axes'] if len(document['axes']) == 6 else None

    axes = ros.until(whole)
    assert axes['accel_y']['sample_rate_hz'] == pytest.approx(125.0, rel=1e-6)
    for number, name in enumerate(('gyro_x', 'gyro_y', 'gyro_z')):
        assert axes[name]['mean'] == pytest.approx(
            blocks['gyro'].samples[:, number].mean(), rel=1e-6, abs=1e-12)
        assert axes[name]['coefficients']['noise_density']['value'] == pytest.approx(
            0.01 / 200**0.5, rel=0.1)
    assert node.stop() == 0
    # Fields read otherwise, or another topic for one half, are another run.
    changes: list[dict[str, str]] = [
        {}, {'gyro_field': 'vector'}, {'accel_topic': ros.name('other')}]
    for number, change in enumerate(changes):
        path = ros.folder / f'state{number}'
        path.write_bytes(state.read_bytes())
        change['state_file'] = str(path)
    outputs = start_repeatedly(ros, [
        [word for key, value in {**parameters, **change}.items()
         for word in ('-p', f'{key}:={yaml_value(value)}')] for change in changes])
    read = 'geometry_msgs/msg/Vector3Stamped {} accel.linear geometry_msgs/msg/AccelStamped'
    for number, ((status, text), line) in enumerate(zip(outputs, (
            'resumed 20 s of data from {0}',
            'a new run: {0} could not be resumed from, its messages were read as '
            f'{read.format("vector deg/s")}, now as {read.format("vector")}; it is kept as '
            'state1.settings.<words>',
            'a new run: {0} could not be resumed from, it is of the topic '
            f'{", ".join(topics.values())}; it is kept as state2.topic.<words>'), strict=True)):
        assert status == 0, text
        assert said_in(text)[0] == Varying(line.replace('{0}', str(ros.folder / f'state{number}')))


def test_acceleration_in_g_is_converted_whether_it_is_said_or_found_out(ros: Ros) -> None:
    said = {'found': {}, 'said': {'accel_unit': 'g', 'gyro_unit': 'deg/s'}}
    results, publishers = {}, {}
    for name, units in said.items():
        ros.start('imu_allan_node', {'publish_period': 0.5, **units}, namespace=ros.name(name))
        results[name] = ros.listen(String, f'{name}/imu_allan/result')
        publishers[name] = ros.node.create_publisher(Imu, ros.name(f'{name}/imu/data_raw'), 10_000)
    for publisher in publishers.values():
        ros.until(lambda publisher=publisher: publisher.get_subscription_count() == 1)
        for row in encode_imu_rows(at_rest(4000, noise=0.001, mean=(0, 0, 0, 0, 0, 1))):
            publisher.publish(row.tobytes())
    for name, units in said.items():
        document = ros.until(lambda messages=results[name]: next(
            (found for found in (json.loads(message.data) for message in messages[-1:])
             if found['timeline']['samples'] == 4000), None))
        axes = document['axes']
        assert axes['accel_z']['mean'] == pytest.approx(9.80665, rel=1e-3)
        for axis, density in (('accel_z', 9.80665e-4),
                              ('gyro_x', 1e-4 * (np.pi / 180 if units else 1))):
            assert axes[axis]['coefficients']['noise_density']['value'] == pytest.approx(
                density, rel=0.05)
        codes = {remark['code'] for remark in document['warnings']}
        assert ('unit_g' in codes) == (not units)
        assert 'gravity' not in codes
