# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What drivers, their clocks, the computer and errors of its own do to a node."""

import os
import re
import struct
import subprocess
import time

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.node.reception import message_class
from imu_allan.noise.terms import AXES
from imu_messages import encode_imu
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros_harness import Driver, kept_in, RATE_HZ, START_NS
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger
from whole_lines import Varying


def meanwhile(driver, condition):
    """Publish at about the rate of the stamps until the condition holds."""
    began, first = time.monotonic(), driver.next

    def going_on():
        due = round((time.monotonic() - began) * RATE_HZ) - (driver.next - first)
        driver.publish(max(due, 0))
        return condition()

    driver.ros.until(going_on)


def test_one_bad_moment_is_reported_once_and_is_no_warning_for_the_rest_of_the_run(ros, health):
    topic = ros.name('imu/temperature')
    node = ros.start('imu_allan_node', {'publish_period': 1.0, 'temperature_topic': topic},
                     constants={'diagnostics.RECENT_S': 5.0})
    driver = Driver(ros).wait_for_node()
    driver.publish(200)
    publisher = ros.node.create_publisher(Temperature, topic, QoSProfile(depth=10))
    ros.until(publisher.get_subscription_count)
    # No temperature, and no message of the IMU either.
    publisher.publish(b'\0\1\0\0nothing of the kind')
    publisher.publish(Temperature(temperature=20.0))
    driver.send(b'\0\1\0\0nothing of the kind')
    driver.next += 1
    driver.publish(1, shaken=np.nan)
    malformed = Varying(f'1 message on {driver.topic} could not be decoded in the last 5 s: '
                        '<words>')
    meanwhile(driver, lambda: health.said('reception', malformed))
    rejected = '1 message rejected: NaN, infinite or declared absent'
    # Diagnostics say the worst first, which on a busy computer is how uneven the stamps are.
    meanwhile(driver, lambda: rejected in node.lines)

    def warm():
        # Readings are taken without acknowledgement, and one may be lost on a busy machine.
        publisher.publish(Temperature(temperature=20.0))
        return health.values('reception').get('temperature_c') == '20.0'

    meanwhile(driver, warm)
    # A reading has come, some time ago.
    assert health.number('reception', 'temperature_age_s') > 0
    # Levels are about now, totals stay.
    meanwhile(driver, lambda: health.level('reception') == health.level('timeline') == b'\0')
    assert health.number('reception', 'malformed') == 1
    assert health.number('timeline', 'missing') == health.number('timeline', 'rejected') == 1
    for line in (malformed,
                 f'every message on {driver.topic} can be decoded again; 1 message could not be '
                 'in all', rejected):
        assert node.lines.count(line) == 1, node.log


def test_what_few_messages_show_is_taken_back_when_more_do_not_and_outliers_are_no_nan(ros):
    node = ros.start('imu_allan_node', {'publish_period': 1.0},
                     constants={'characterization_node.UNWATCHED_S': 0.2})
    driver = Driver(ros).wait_for_node()
    for count in np.random.default_rng(1).integers(3, 14, 40):
        driver.publish(int(count))
        driver.next += 1
    ros.until(lambda: Varying('<number> % of the samples are missing and interpolated. -> set a '
                              'deeper queue or reliable delivery with qos_overrides')
              in node.lines)
    driver.send(message(driver.next, 1.0))
    driver.next += 1
    driver.publish(6000)
    outliers = Varying('1 single message holds outliers, <words>')
    ros.until(lambda: 'no longer found: many missing' in node.lines and outliers in node.lines)
    assert not [line for line in node.lines if 'rejected' in line]


@pytest.mark.parametrize(('size', 'filled', 'works'), [
    ('1m', '500k', True), ('16k', '16k', False)])
def test_where_shared_memory_is_short_samples_come_over_the_network(ros, size, filled, works):
    # A small /dev/shm for what it runs, and nobody else.
    short = ['unshare', '--mount', '--propagation', 'private', 'sh', '-c',
             f'mount -t tmpfs -o size={size} tmpfs /dev/shm && '
             f'head -c {filled} /dev/zero > /dev/shm/full; exec "$@"', 'sh']
    if os.geteuid() != 0 or subprocess.run([*short, 'true'], capture_output=True,
                                           check=False).returncode:
        pytest.skip('only root can mount a small /dev/shm')
    node = ros.start('imu_allan_node', shared_memory=True, wrapper=short)
    remedy = 'remove files from it, or give it room, such as with --shm-size of docker run'
    if not works:
        assert node.wait() == 1
        assert node.lines == ['imu_allan_node: /dev/shm is full, so the libraries of ROS would '
                              f'crash; {remedy}']
        return
    simulator = ros.start('imu_simulator', {'rate': 1000.0, 'duration': 2.0,
                                            'wait_for_subscriptions': 1},
                          shared_memory=True, wrapper=short)
    assert simulator.wait() == 0, simulator.log
    assert ros.saved_with(2000)
    assert Varying('imu_allan_node: /dev/shm has only <number> MB of room: messages come over the '
                   f'network, at more cost; {remedy}') in node.lines
    assert node.stop() == 0


def test_a_driver_of_another_user_is_reached_over_the_network_as_the_log_says(ros):
    other = ['setpriv', '--reuid=10001', '--clear-groups',
             # It may read its programs, wherever they lie.
             '--inh-caps=+dac_read_search', '--ambient-caps=+dac_read_search']
    if os.geteuid() != 0 or subprocess.run([*other, 'true'], capture_output=True,
                                           check=False).returncode:
        pytest.skip('only root can become another user')
    logs = ros.folder / 'logs'
    logs.mkdir(mode=0o777)
    logs.chmod(0o777)
    # With LOCALHOST, ROS chooses the transports itself.
    env = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    ros.start('imu_simulator', env=env | {'ROS_LOG_DIR': str(logs)}, shared_memory=True,
              wrapper=other)
    node = ros.start('imu_allan_node', env=env, shared_memory=True)
    topic = ros.name('imu/data_raw')
    ros.until(lambda: Varying(
        f'no message on {topic} for <number> s, though it has 1 publisher; if that runs as '
        'another user or in a container, use the same user, or '
        'FASTDDS_BUILTIN_TRANSPORTS=UDPv4') in node.lines)
    assert node.stop() == 0
    node = ros.start('imu_allan_node', {'publish_period': 0.5}, env=env)
    ros.until(lambda: Varying(f'first samples on {topic}: <words>') in node.lines)
    # Of fewer samples than a fit needs, no configuration can be written at the end.
    ros.until(lambda: 'noise density' in node.log)
    assert node.stop() == 0, node.log


def message(index, value=None, *, stamp=None, frame_id='imu', absent=(False, False)):
    sample = np.random.default_rng(index).normal(0, 0.01, 6) if value is None else [value] * 6
    return encode_imu(START_NS + index * 5_000_000 if stamp is None else stamp,
                      np.asarray(sample), frame_id, absent)


def with_stamp(index, seconds, nanoseconds):
    given = message(index)
    return given[:4] + struct.pack('<iI', seconds, nanoseconds) + given[12:]


HOSTILE = {
    'every value is NaN': lambda i: message(i, float('nan')),
    'values too large for squares': lambda i: message(i, 1e300),
    'both fields declared absent': lambda i: message(i, absent=(True, True)),
    'NaN, every other message': lambda i: message(i, float('nan') if i % 2 else None),
    'stamps of zero': lambda i: message(i, stamp=0),
    'one stamp for all': lambda i: message(i, stamp=START_NS),
    'stamps that run backward': lambda i: message(i, stamp=START_NS - i * 5000),
    'the latest stamp there is': lambda i: with_stamp(i, 2**31 - 1, 2**32 - 1),
    'stamps of years apart': lambda i: with_stamp(i, i * 10_000_000, 0),
    'a value that never changes': lambda i: message(i, 1.0),
    'another frame_id every time': lambda i: message(i, frame_id=f'imu{i}'),
    'a frame_id that is no name': lambda i: message(i, frame_id='\x1b[2J\n\x07 ü%s{}'),
    'bytes that are no message': lambda i: bytes([0, 1, 0, 0]) + bytes([i % 256]) * i,
    'any bytes': lambda i: b'\0\1\0\0' + np.random.default_rng(i).bytes(4 * (i + 1)),
}


def test_no_first_second_of_a_driver_ends_a_node_that_is_listened_to(ros, health):
    node = ros.start('imu_allan_node', {
        'publish_period': 1.0, 'checkpoint_period': 1.0,
        'state_file': str(ros.folder / 'state')}, constants={
            'characterization_node.REPORT_S': 0.2, 'characterization_node.TICK_S': 0.1})
    driver = Driver(ros).wait_for_node()

    def topics():
        return {name: message_class(kind)
                for name, [kind] in ros.node.get_topic_names_and_types()
                if name.startswith(f'{ros.name("imu_allan")}/')}

    ros.until(lambda: len(topics()) >= 10)
    for topic, kind in topics().items():
        ros.listen(kind, topic)
    for hostile in HOSTILE.values():
        for index in range(200):
            driver.send(hostile(index))
        # What is still under way at a reset would be of the next run.
        driver.until_taken()
        health.news()
        assert node.running, node.log
        assert ros.call(Trigger, 'imu_allan/reset').success
    assert not re.search('Traceback|RuntimeWarning', node.log)
    assert len(node.lines) < 3 * len(HOSTILE), node.log
    driver.publish(4000)
    driver.until_taken()
    document = ros.saved()
    assert document['timeline']['samples'] == 4000
    assert set(document['axes']) == set(AXES)
    assert node.stop() == 0, node.log


def test_a_driver_that_sends_no_value_at_first_is_used_as_soon_as_it_measures(ros, health):
    # Messages sent at once would pass for a fast clock.
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'clock': 'header'})
    driver = Driver(ros).wait_for_node()
    driver.publish(2000, shaken=np.nan)
    driver.until_taken()
    why = (f'{driver.topic}: the messages carry neither angular velocity nor linear acceleration '
           '(covariance[0] is -1 or every value is NaN): choose another topic')
    ros.until(lambda: health.said('timeline', why, b'\2'))
    driver.publish(1000)
    driver.until_taken()
    health.news()
    assert health.level('timeline') != b'\2', health.status('timeline')
    document = ros.saved_with(1000)
    assert set(document['axes']) == set(AXES)
    assert [one['code'] for one in document['warnings']] == ['short_recording']
    assert why in node.lines, node.log


def test_values_that_no_filter_can_use_are_no_fault_of_the_disk(ros, health):
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    driver = Driver(ros).wait_for_node()
    driver.publish(1000, shaken=0.0)
    driver.until_taken()
    answer = ros.call(Trigger, 'imu_allan/save')
    why = Varying('no configuration for kalibr: no axis of this result has a noise density '
                  f'(constant or too short); <words>; the other files are in {ros.folder}/<words>')
    assert (answer.success, answer.message) == (False, why)
    health.news()
    assert health.level('storage') == b'\0', health.status('storage')
    # Something is missing all the same.
    assert node.stop() == 1
    assert why in node.lines


@pytest.mark.parametrize('named', [True, False])
def test_an_error_that_nobody_foresaw_saves_state_and_files_before_the_node_ends(ros, named):
    # Stands for any bug: the timer's callback calls a function that raises.
    (ros.folder / 'sitecustomize.py').write_text(
        'import imu_allan.node.diagnostics as diagnostics\n'
        'def fail(*arguments): raise ZeroDivisionError("a bug")\n'
        'diagnostics.diagnostics_message = fail\n')
    state = ros.folder / 'state' if named else (
        ros.folder / 'home' / 'imu_allan' / f'{ros.namespace.strip("/")}.imu_allan.state')
    node = ros.start('imu_allan_node', {'state_file': str(state)} if named else {},
                     prepend_path=ros.folder, env={'ROS_HOME': str(ros.folder / 'home')})
    driver = Driver(ros).wait_for_node()
    driver.publish(4000)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == 4000
    for path in (ros.folder / 'output').rglob('result.json'):
        path.unlink()
    ros.listen(DiagnosticArray, '/diagnostics', 10)
    assert node.wait() == 1
    assert 'ZeroDivisionError: a bug' in node.lines
    assert ('internal error: the node ends and saves what it has learnt; please report it'
            in node.lines)
    assert state.stat().st_size > 10_000
    # The next start resumes it, as after a crash.
    assert kept_in(state).timeline.samples == 4000
    [document] = ros.results()
    assert document['timeline']['samples'] == 4000


def test_where_the_output_folder_takes_nothing_it_is_reported_and_the_state_is_kept(ros, health):
    (ros.folder / 'file').write_text('in the way')
    unwritable = str(ros.folder / 'file' / 'output')
    node = ros.start('imu_allan_node', {'output_dir': unwritable,
                                        'state_file': str(ros.folder / 'states' / 'state')})
    line = (f'output_dir {unwritable}: cannot be written (Not a directory); set the parameter to '
            'a folder that may be written to')
    ros.until(lambda: line in node.lines)
    driver = Driver(ros).wait_for_node()
    driver.publish(4000)
    ros.until(lambda: health.said('storage', line, b'\2'))
    assert driver.publisher.wait_for_all_acked()
    assert node.stop() == 1
    assert Varying(f'{unwritable}/<words>: cannot be written (Not a directory); choose a folder '
                   'that exists on a disk with room and may be written to; not written either: '
                   'curve.csv, imu.yaml, allan_deviation.png') in node.lines
    assert kept_in(ros.folder / 'states' / 'state').messages == 4000
