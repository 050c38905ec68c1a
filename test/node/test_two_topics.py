# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Gyroscope and accelerometer on two topics, at two rates, as a RealSense publishes them."""

from dataclasses import replace
import json
import signal
from typing import Any

from geometry_msgs.msg import AccelStamped, Vector3Stamped
from imu_allan.analysis import analyze
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.recordings import RecordingOptions
import numpy as np
import pytest
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from ros_harness import at_rest, Driver, Health, lossless, Process, recorded, Ros
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from whole_lines import Varying

RATES_HZ = {'gyro': 200.0, 'accel': 125.0}
SECONDS = 30.0


def half(name: str, seconds: float = SECONDS, start_s: float = 0.0, frame_id: str = '',
         rate_hz: float = 0.0) -> ImuBlock:
    """Give messages of one sensor, the other half of each zero."""
    rate_hz = rate_hz or RATES_HZ[name]
    block = at_rest(round(seconds * rate_hz), rate_hz, start_s=start_s,
                    seed=len(name) + round(start_s))
    block.samples[:, slice(3, 6) if name == 'gyro' else slice(3)] = 0
    return replace(block, frame_id=frame_id or f'{name}_frame')


class Camera:
    """The driver of the test: it publishes what it is given."""

    def __init__(self, ros: Ros, **changes: Any) -> None:
        self.ros = ros
        topics = {name: ros.name(f'camera/{name}/sample') for name in RATES_HZ}
        parameters = {'publish_period': 0.5, 'gyro_topic': topics['gyro'],
                      'accel_topic': topics['accel'], **changes}
        for topic in topics.values():
            parameters |= lossless(topic)
        self.node = ros.start('imu_allan_node', parameters, best_effort=True)
        self.drivers = {name: Driver(ros, f'camera/{name}/sample') for name in topics}
        for driver in self.drivers.values():
            driver.wait_for_node()

    def publish(self, name: str, block: ImuBlock) -> None:
        publisher: Publisher = self.drivers[name].publisher
        for row in encode_imu_rows(block):
            publisher.publish(row.tobytes())

    def saved(self, samples: int) -> dict[str, Any]:
        """Save until the file has so many samples, and return what it holds."""
        for driver in self.drivers.values():
            driver.until_taken()
        return dict(self.ros.saved_with(samples))


def numbers_of(document: dict[str, Any]) -> dict[str, Any]:
    """Give what must not depend on the way the samples came."""
    return {'axes': document['axes'], 'timeline': document['timeline']}


def test_two_topics_give_the_result_of_a_recording_of_them(ros: Ros) -> None:
    blocks = {'gyro': half('gyro'), 'accel': half('accel')}
    # The gyroscope has a gap of its own.
    kept = np.ones(len(blocks['gyro']), bool)
    kept[3000:3040] = False
    blocks['gyro'] = blocks['gyro'].part(kept)
    camera = Camera(ros)
    results = ros.listen(String, 'imu_allan/result')
    for start in range(0, len(kept), 500):
        for name, block in blocks.items():
            camera.publish(name, block.part(slice(start, start + 500)))
    document = camera.saved(len(blocks['gyro']))
    path = recorded(ros.folder / 'both.mcap', blocks)
    expected = analyze(path, reading=RecordingOptions(gyro_topic='/gyro', accel_topic='/accel'))
    plain = json.loads(expected.to_json())
    assert numbers_of(document) == numbers_of(plain)
    rates = {name: axis['sample_rate_hz'] for name, axis in document['axes'].items()}
    assert rates['gyro_y'] == pytest.approx(200.0, rel=1e-6)
    assert rates['accel_y'] == pytest.approx(125.0, rel=1e-6)
    assert len(document['timeline']['gaps']) == 1
    topics = [camera.drivers[name].topic for name in ('gyro', 'accel')]
    assert document['source']['topic'] == ', '.join(topics)
    [remark] = [each for each in document['warnings'] if each['code'] == 'two_rates']
    assert remark['message'] == (
        f'the gyroscope from {topics[0]} at 200 Hz and the accelerometer from {topics[1]} at 125 '
        'Hz; rate, gaps and faults are those of the gyroscope')
    assert ros.until(lambda: [message for message in results if set(
        json.loads(message.data)['axes']) == set(document['axes'])])


def test_a_run_of_two_topics_goes_on_after_a_kill(ros: Ros) -> None:
    state = ros.folder / 'state'
    first = Camera(ros, state_file=str(state), checkpoint_period=1.0)
    for name in RATES_HZ:
        first.publish(name, half(name, 12.0))
    first.saved(2400)
    first.node.stop()
    for driver in first.drivers.values():
        ros.node.destroy_publisher(driver.publisher)
    second = Camera(ros, state_file=str(state), checkpoint_period=1.0)
    ros.until(lambda: f'resumed 12 s of data from {state}' in second.node.lines)
    results = ros.listen(String, 'imu_allan/result')
    published = iter(range(1000))

    def goes_on() -> bool:
        # Two seconds of the wall clock show that it is the same IMU.
        second_no = next(published)
        for name in RATES_HZ:
            second.publish(name, half(name, 1.0, start_s=100.0 + second_no))
        documents = [json.loads(message.data) for message in results[-1:]]
        return any(each['timeline']['samples'] > 2400 and len(each['axes']) == 6
                   for each in documents)

    ros.until(goes_on)
    assert second.node.stop(signal.SIGINT) == 0
    # Another topic for one half is another run.
    third = ros.start('imu_allan_node', {
        'gyro_topic': first.drivers['gyro'].topic, 'accel_topic': ros.name('other'),
        'state_file': str(state)})
    topics = ', '.join(first.drivers[name].topic for name in ('gyro', 'accel'))
    ros.until(lambda: Varying(f'a new run: {state} could not be resumed from, it is of the topic '
                              f'{topics}; it is kept as state.topic.<words>') in third.lines)


def test_a_half_that_is_silent_costs_the_other_nothing_and_is_reported(ros: Ros, health: Health
                                                                       ) -> None:
    camera = Camera(ros)
    camera.publish('accel', half('accel', 20.0))
    document = camera.saved(2500)
    assert sorted(document['axes']) == ['accel_x', 'accel_y', 'accel_z']
    ros.until(lambda: health.said('reception gyro', Varying('no message for <number> s'), b'\2'))
    for name, part in ('gyro', 'reception'), ('accel', 'timeline'):
        status = health.status(f'{part} {name}')
        assert status is not None
        assert status.hardware_id == camera.drivers[name].topic


def test_a_half_that_changes_rate_or_frame_for_good_begins_a_new_run(ros: Ros) -> None:
    camera = Camera(ros)
    results = ros.listen(String, 'imu_allan/result')
    for name in RATES_HZ:
        camera.publish(name, half(name, 12.0))
    ros.until(lambda: [message for message in results if len(
        json.loads(message.data)['axes']) == 6])
    camera.publish('accel', half('accel', 20.0, start_s=20.0, rate_hz=250.0))
    ros.until(lambda: 'a new run begins, the one before cannot go on: it is of 125 Hz, the '
                      'messages now come at 250 Hz' in camera.node.lines)
    camera.publish('accel', half('accel', 20.0, start_s=40.0, rate_hz=250.0))
    camera.publish('gyro', half('gyro', 20.0, start_s=40.0))

    def both_new() -> bool:
        axes = json.loads(results[-1].data)['axes']
        rate = axes.get('accel_x', {}).get('sample_rate_hz') or 0.0
        return len(axes) == 6 and abs(rate / 250.0 - 1) < 1e-3

    ros.until(both_new)
    camera.publish('gyro', half('gyro', 15.0, start_s=60.0, frame_id='other'))
    ros.until(lambda: 'a new run begins, the one before cannot go on: it is of frame_id '
                      "'gyro_frame', the messages now have 'other'" in camera.node.lines)
    # What came of the accelerometer before belongs to the run before.
    camera.publish('accel', half('accel', 10.0, start_s=80.0, rate_hz=250.0))
    document = camera.saved(3000)
    assert document['source']['frame_id'].startswith('other')
    assert len(document['axes']) == 6
    # The two runs before, and this one.
    assert len(list((ros.folder / 'output').iterdir())) == 3


def test_reset_and_pause_mean_both_halves(ros: Ros, health: Health) -> None:
    camera = Camera(ros)
    for name in RATES_HZ:
        camera.publish(name, half(name, 5.0))
    camera.saved(1000)
    assert ros.call(Trigger, 'imu_allan/reset').success
    for name in RATES_HZ:
        camera.publish(name, half(name, 5.0, start_s=10.0))
    document = camera.saved(1000)
    assert len(document['axes']) == 6
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=True)).success
    for name in RATES_HZ:
        camera.publish(name, half(name, 5.0, start_s=15.0))
    ros.until(lambda: health.number('reception gyro', 'received') >= 3000
              and health.number('reception accel', 'received') >= 1875)
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=False)).success
    for name in RATES_HZ:
        camera.publish(name, half(name, 5.0, start_s=20.0))
    document = camera.saved(2000)
    # The pause is a gap of both, interpolated by neither.
    assert [round(gap['duration_s'], 1) for gap in document['timeline']['gaps']] == [5.0]


@pytest.mark.slow
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
    killed.popen.send_signal(signal.SIGKILL)
    killed.wait()
    health.heard.clear()
    ros.until(lambda: health.level('reception gyro') == b'\2')
    assert health.level('reception accel') < b'\2'
    driver(gyro)
    ros.until(lambda: latest()['timeline']['gaps'])
    assert len(latest()['axes']) == 6
    assert 'a new run begins' not in node.log
    assert node.stop() == 0


def test_each_half_may_have_a_type_of_its_own_whose_fields_are_named(ros: Ros) -> None:
    state = ros.folder / 'state'
    topics = {name: ros.name(f'driver/{name}') for name in RATES_HZ}
    parameters = {
        'publish_period': 0.5, 'gyro_topic': topics['gyro'], 'accel_topic': topics['accel'],
        'imu_type': 'geometry_msgs/msg/Vector3Stamped', 'gyro_field': 'vector deg/s',
        'accel_type': 'geometry_msgs/msg/AccelStamped', 'accel_field': 'accel.linear',
        'state_file': str(state)}
    for topic in topics.values():
        parameters |= lossless(topic)
    node = ros.start('imu_allan_node', parameters, best_effort=True)
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
    # Fields read otherwise are another run.
    again = ros.start('imu_allan_node', {**parameters, 'gyro_field': 'vector'}, best_effort=True)
    read = 'geometry_msgs/msg/Vector3Stamped {} accel.linear geometry_msgs/msg/AccelStamped'
    ros.until(lambda: Varying(
        f'a new run: {state} could not be resumed from, its messages were read as '
        f'{read.format("vector deg/s")}, now as {read.format("vector")}; it is kept as '
        'state.settings.<words>') in again.lines)


@pytest.mark.parametrize('said', [{}, {'accel_unit': 'g', 'gyro_unit': 'deg/s'}],
                         ids=['found out', 'said'])
def test_acceleration_in_g_is_converted(ros: Ros, said: dict[str, str]) -> None:
    ros.start('imu_allan_node', {'publish_period': 0.5, **said})
    results = ros.listen(String, 'imu_allan/result')
    publisher = ros.node.create_publisher(Imu, ros.name('imu/data_raw'), 10_000)
    ros.until(lambda: publisher.get_subscription_count() == 1)
    for row in encode_imu_rows(at_rest(4000, noise=0.001, mean=(0, 0, 0, 0, 0, 1))):
        publisher.publish(row.tobytes())

    def whole() -> Any:
        documents = [json.loads(message.data) for message in results[-1:]]
        return [each for each in documents if each['timeline']['samples'] == 4000]

    [document] = ros.until(whole)
    axes = document['axes']
    assert axes['accel_z']['mean'] == pytest.approx(9.80665, rel=1e-3)
    assert axes['accel_z']['coefficients']['noise_density']['value'] == pytest.approx(
        9.80665e-4, rel=0.05)
    assert axes['gyro_x']['coefficients']['noise_density']['value'] == pytest.approx(
        1e-4 * (np.pi / 180 if said else 1), rel=0.05)
    codes = {remark['code'] for remark in document['warnings']}
    assert ('unit_g' in codes) == (not said)
    assert 'gravity' not in codes
