# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A node that has characterized five minutes of a simulated IMU, seen through every interface."""

from dataclasses import replace
import json
import math
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.node.output_topics import result_messages
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.tuning.tune import tune
from imu_allan.writers.result_files import load_result
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from ros_harness import entries, Health, RATE_HZ, said_in
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import String
from std_srvs.srv import Trigger
from whole_lines import Varying

DURATION_S = 300.0


@pytest.fixture(scope='module')
def live(shared_ros):
    ros, model = shared_ros, shared_ros.folder / 'model.yaml'
    model.write_text('gyro: {noise_density: 1e-3 rad/s/sqrt(Hz), rate_random_walk: '
                     '1e-3 rad/s^2/sqrt(Hz)}\naccel: {noise_density: 2e-3 m/s^2/sqrt(Hz)}')
    (ros.folder / 'spec.yaml').write_text('gyro: {x: {noise_density: 1e-4 rad/s/sqrt(Hz)}}')
    ros.start('imu_allan_node', {
        'publish_period': 0.5, 'expected_rate': RATE_HZ, 'aiding_interval': 0.2, 'coast': 30.0,
        'export_for': ['kalibr', 'openvins'], 'spec_file': str(ros.folder / 'spec.yaml')},
        shared_memory=True)
    simulator = ros.start('imu_simulator', {
        'model': str(model), 'rate': RATE_HZ, 'duration': DURATION_S, 'speed': 0.0, 'seed': 3},
        shared_memory=True)
    health = Health(ros)
    ros.until(lambda: not simulator.running)
    assert simulator.wait() == 0
    ros.until(lambda: health.number('timeline', 'samples') == RATE_HZ * DURATION_S)
    # What came last is fitted to the end, once nothing more comes.
    ros.until(lambda: health.number('estimation', 'fitted_duration_s') == DURATION_S)
    return ros


def values(array):
    return {status.name.rpartition(': ')[2]: entries(status) for status in array.status}


def latest(ros, kind, topic):
    """Join late and get what was published last."""
    messages = ros.listen(kind, topic)
    return ros.until(lambda: messages)[0]


@pytest.fixture(scope='module')
def result(live):
    response = live.call(Trigger, 'imu_allan/save')
    assert response.success, response.message
    return load_result(response.message.splitlines()[0])


def test_late_subscriber_service_and_file_get_the_same_to_the_last_digit(live, result):
    document = latest(live, String, 'imu_allan/result')
    published = Result.from_dict(json.loads(document.data))
    assert document.data == json.dumps(published.to_dict(), separators=(',', ':'))
    # A file is one look at the record, what is published one of many.
    assert replace(published, axes={}) == replace(result, axes={})
    for name, axis in result.axes.items():
        kept = {key: found for key, found in published.axes[name].coefficients.items()
                if found.observable}
        assert 'noise_density' in kept
        assert all(axis.coefficients[key] == found for key, found in kept.items())
        assert replace(axis, coefficients={}) == replace(published.axes[name], coefficients={})
    header = latest(live, DiagnosticArray, 'imu_allan/coefficients').header
    assert header.frame_id == 'imu_link'
    stamp = header.stamp
    # It is that of the last sample.
    start = np.datetime64(str(result.source.start_time).removesuffix('Z'), 'ns').astype(np.int64)
    assert (stamp.sec * 10**9 + stamp.nanosec - start) * 1e-9 == pytest.approx(
        DURATION_S - 1 / RATE_HZ, abs=2e-6)
    messages = result_messages(published, live.name('imu_allan'), stamp, 0.2, 30.0)
    assert [(one.name, one.hardware_id) for one in messages['coefficients'].status] == [
        (f'{live.name("imu_allan")}: {axis}', live.name('imu/data_raw')) for axis in AXES]
    assert len(messages) == 24
    for topic, message in messages.items():
        # As text: NaN is none of the numbers.
        assert str(latest(live, type(message), f'imu_allan/{topic}')) == str(message), topic
    for name, found in values(messages['coefficients']).items():
        axis, (sensor, letter) = published.axes[name], name.split('_')
        true, unit = (1e-3, 'rad/s') if sensor == 'gyro' else (2e-3, 'm/s^2')
        low, high = (float(found[f'noise_density/ci95_{end}']) for end in ('low', 'high'))
        assert low * 0.98 < true < high * 1.02
        assert low < float(found['noise_density/value']) < high
        assert found['noise_density/unit'] == f'{unit}/sqrt(Hz)'
        for key in TERMS:
            value = axis.coefficients[key].value
            assert found.get(f'{key}/value') == (None if value is None else repr(value))
        tuned = messages[f'{sensor}/filter_random_walk'].vector
        assert getattr(tuned, letter) == tune(axis, 0.2, 30.0).random_walk


def test_what_has_not_changed_is_not_published_again(live):
    counts = {topic: live.listen(kind, f'imu_allan/{topic}') for kind, topic in (
        (String, 'result'), (DiagnosticArray, 'coefficients'),
        (Vector3Stamped, 'gyro/noise_density'))}
    live.until(lambda: all(counts.values()))
    health = Health(live)
    # Half a dozen periods, in one of which somebody new has come, and not asked for what was.
    live.until(lambda: health.heard)
    late = live.listen(String, 'imu_allan/result', 10)
    live.until(lambda: late)
    for _ in range(3):
        health.news()
    assert len(late) == 1
    assert [len(messages) for messages in counts.values()] == [2, 1, 1]


def test_a_viewer_opened_again_gets_the_plot_though_it_has_not_changed(live):
    for _ in range(2):
        # Those of images ask for no earlier messages.
        images = live.listen(CompressedImage, 'imu_allan/plot/compressed', 10)
        live.until(lambda images=images: images, timeout=60.0)


def test_save_writes_result_curves_plot_and_filter_configurations(live):
    response = live.call(Trigger, 'imu_allan/save')
    assert response.success
    paths = [Path(line) for line in response.message.splitlines()]
    assert [path.name for path in paths] == [
        'result.json', 'curve.csv', 'imu.yaml', 'kalibr_imu_chain.yaml', 'allan_deviation.png']
    folder = paths[0].parent
    assert folder.parent == live.folder / 'output'
    assert folder.name.startswith(f'{live.namespace[1:]}_imu_allan_20')
    assert sorted(folder.iterdir()) == sorted(paths)
    document = json.loads(paths[0].read_text())
    assert document['source']['topic'] == live.name('imu/data_raw')
    assert document['timeline']['samples'] == RATE_HZ * DURATION_S
    assert paths[-1].read_bytes().startswith(b'\x89PNG')
    assert f'rostopic: "{live.name("imu/data_raw")}"' in paths[2].read_text()
    assert live.call(Trigger, 'imu_allan/save').message == response.message


def test_diagnostics_tell_rate_losses_cost_and_what_is_awaited(live):
    health = Health(live)
    live.until(lambda: health.heard)
    assert [(one.name, one.hardware_id) for one in health.heard[:4]] == [
        (f'{live.name("imu_allan")}: {part}', live.name('imu/data_raw'))
        for part in ('reception', 'timeline', 'estimation', 'storage')]
    assert health.values('reception').items() >= {
        'received': str(int(RATE_HZ * DURATION_S)), 'lost': '0', 'publishers': '0'}.items()
    # A fit may be in it, and few messages beside it.
    assert 1e-6 < health.number('reception', 'cpu_per_message_s') < 10
    assert health.level('reception') == b'\2'
    assert health.number('timeline', 'rate_hz') == pytest.approx(RATE_HZ, rel=1e-6)
    assert health.number('timeline', 'jitter_s') < 1e-6
    assert health.values('timeline').items() >= {
        'clock': 'header', 'missing': '0', 'duplicates': '0', 'out_of_order': '0'}.items()
    assert health.values('estimation')['observable/noise_density'] == '6'
    broken = Varying('gyro_x N: the 95 % interval is above 1e-4 rad/s/sqrt(Hz) (measured '
                     '<number>, <number> .. <number>)')
    assert health.said('specification', broken, b'\2')
    assert Varying(f'specification: {broken.line}') in said_in(
        (live.folder / 'imu_allan_node_0.log').read_text())


def test_a_parameter_out_of_range_is_refused_with_a_reason_and_keeps_its_value(live):
    change(live, 'publish_period', 0.75)
    for name, value in (('publish_period', 0.0), ('publish_period', math.nan),
                        ('publish_period', 'often'), ('checkpoint_period', math.inf),
                        ('export_for', ['kalibr', 'nonsense']), ('output_dir', '/etc'),
                        ('coast', 50.0), ('motion', 'keep'), ('gap_tolerance', 3),
                        ('use_sim_time', 'perhaps')):
        answer = set_parameter(live, name, value)
        assert (answer.successful, bool(answer.reason)) == (False, True), name
    response = live.call(GetParameters, 'imu_allan/get_parameters', GetParameters.Request(
        names=['publish_period', 'aiding_interval', 'coast']))
    assert [value.double_value for value in response.values] == [0.75, 0.2, 30.0]
    change(live, 'publish_period', 0.5)


def test_reset_begins_anew_and_says_so_on_every_topic(live):
    """The last test of this file: nothing is left after it."""
    arrays = live.listen(DiagnosticArray, 'imu_allan/coefficients')
    live.until(lambda: arrays)
    assert live.call(Trigger, 'imu_allan/reset').success
    # The old result is published again every period, until the new one is there.
    live.until(lambda: not arrays[-1].status)
    vectors = live.listen(Vector3Stamped, 'imu_allan/gyro/noise_density')
    live.until(lambda: vectors and math.isnan(vectors[-1].vector.x))
    response = live.call(Trigger, 'imu_allan/save')
    assert (response.success, response.message) == (
        False, 'nothing to save: too few usable samples have come from '
        f'{live.name("imu/data_raw")} yet')


def parameter(name, value):
    return Parameter(name, value=value).to_parameter_msg()


def set_parameter(ros, name, value):
    response = ros.call(SetParameters, 'imu_allan/set_parameters',
                        SetParameters.Request(parameters=[parameter(name, value)]))
    return response.results[0]


def change(ros, name, value):
    answer = set_parameter(ros, name, value)
    assert answer.successful, answer.reason
