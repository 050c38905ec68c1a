# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that no characterization can be made of, while somebody listens to every topic."""

from collections.abc import Callable
import json
import struct

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.cdr import encode_imu
from imu_allan.noise.terms import AXES
import numpy as np
from ros_harness import Driver, Health, Ros
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from whole_lines import Varying

SECOND = 10**9
KINDS = {'diagnostic_msgs/msg/DiagnosticArray': DiagnosticArray,
         'geometry_msgs/msg/Vector3Stamped': Vector3Stamped,
         'sensor_msgs/msg/CompressedImage': CompressedImage,
         'std_msgs/msg/Float64MultiArray': Float64MultiArray}


def message(index: int, value: float | None = None, *, stamp: int | None = None,
            frame_id: str = 'imu', absent: tuple[bool, bool] = (False, False)) -> bytes:
    sample = np.random.default_rng(index).normal(0, 0.01, 6) if value is None else [value] * 6
    return encode_imu(1_700_000_000 * SECOND + index * 5_000_000 if stamp is None else stamp,
                      np.asarray(sample), frame_id, absent)


def with_stamp(index: int, seconds: int, nanoseconds: int) -> bytes:
    given = message(index)
    return given[:4] + struct.pack('<iI', seconds, nanoseconds) + given[12:]


HOSTILE: dict[str, Callable[[int], bytes]] = {
    'every value is NaN': lambda i: message(i, float('nan')),
    'values too large for squares': lambda i: message(i, 1e300),
    'both fields declared absent': lambda i: message(i, absent=(True, True)),
    'NaN, every other message': lambda i: message(i, float('nan') if i % 2 else None),
    'stamps of zero': lambda i: message(i, stamp=0),
    'one stamp for all': lambda i: message(i, stamp=1_700_000_000 * SECOND),
    'stamps that run backward': lambda i: message(i, stamp=1_700_000_000 * SECOND - i * 5000),
    'the latest stamp there is': lambda i: with_stamp(i, 2**31 - 1, 2**32 - 1),
    'stamps of years apart': lambda i: with_stamp(i, i * 10_000_000, 0),
    'a value that never changes': lambda i: message(i, 1.0),
    'another frame_id every time': lambda i: message(i, frame_id=f'imu{i}'),
    'a frame_id that is no name': lambda i: message(i, frame_id='\x1b[2J\n\x07 ü%s{}'),
    'bytes that are no message': lambda i: bytes([0, 1, 0, 0]) + bytes([i % 256]) * i,
}


def listen_to_everything(ros: Ros) -> None:
    own = f'{ros.name("imu_allan")}/'

    def topics() -> dict[str, str]:
        return {name: types[0] for name, types in ros.node.get_topic_names_and_types()
                if name.startswith(own) and types[0] in KINDS}

    ros.until(lambda: len(topics()) >= 10)
    for topic, kind in topics().items():
        ros.listen(KINDS[kind], topic)


def test_no_first_second_of_a_driver_ends_a_node_that_is_listened_to(
        ros: Ros, health: Health) -> None:
    node = ros.start('imu_allan_node', {
        'publish_period': 1.0, 'checkpoint_period': 1.0,
        'state_file': str(ros.folder / 'state')}, constants={
            'reports.REPORT_S': 0.2, 'characterization_node.TICK_S': 0.1})
    driver = Driver(ros).wait_for_node()
    listen_to_everything(ros)
    for hostile in HOSTILE.values():
        for index in range(200):
            driver.send(hostile(index))
        # What is still under way at a reset would be of the next run.
        driver.until_taken()
        health.news()
        assert node.running, node.log
        assert ros.call(Trigger, 'imu_allan/reset').success
    driver.publish(4000)
    driver.until_taken()
    document = ros.saved()
    assert document['timeline']['samples'] == 4000
    assert set(document['axes']) == set(AXES)
    assert node.stop() == 0, node.log
    assert 'Traceback' not in node.log


def test_an_error_that_nobody_foresaw_saves_state_and_files_before_the_node_ends(
        ros: Ros) -> None:
    # Stands for any bug: the timer's callback calls a function that raises.
    (ros.folder / 'sitecustomize.py').write_text(
        'import imu_allan.node.diagnostics as diagnostics\n'
        'def fail(*arguments): raise ZeroDivisionError("a bug")\n'
        'diagnostics.diagnostics_message = fail\n')
    node = ros.start('imu_allan_node', {'state_file': str(ros.folder / 'state')},
                     prepend_path=ros.folder)
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
    assert (ros.folder / 'state').stat().st_size > 10_000
    [document] = ros.results()
    assert document['timeline']['samples'] == 4000


def test_an_output_folder_that_takes_nothing_is_reported_at_once_and_replaced_at_the_end(
        ros: Ros, health: Health) -> None:
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
                   'that exists on a disk with room and may be written to') in node.lines
    assert 'Traceback' not in node.log
    [path] = (ros.folder / 'states').rglob('result.json')
    assert json.loads(path.read_text())['timeline']['samples'] == 4000
    assert ('wrote result.json, curve.csv, imu.yaml, allan_deviation.png to '
            f'{path.parent}') in node.lines
