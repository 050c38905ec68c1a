# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, on stand-ins for launch; and a real node started so."""

from pathlib import Path
import re
import subprocess
import sys

from imu_allan.characterization import Characterization
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.result_file import save_result
from launch_stand_ins import declared, launched, ROOT
import pytest
from rcl_interfaces.srv import GetParameters
from ros_harness import Ros, said_in
from whole_lines import refused

LAUNCH = ROOT / 'launch'
PAGE = (ROOT / 'docs' / 'ros_interface.md').read_text()
SPECIFICATION = 'gyro: {noise_density: 1 deg/sqrt(h)}\n'


@pytest.mark.parametrize('file', sorted(LAUNCH.glob('*.launch.py')), ids=lambda file: file.name)
def test_every_argument_is_described_and_documented(file: Path) -> None:
    section = PAGE.partition('### Launch\n')[2].partition('\n## ')[0]
    for name, argument in declared(file).items():
        assert argument.description, name
        assert f'`{name}`' in section, name


def test_every_argument_reaches_the_node(ros: Ros, reference: Path) -> None:
    specification = ros.folder / 'limits #1.yaml'
    specification.write_text(SPECIFICATION)
    file = ros.folder / 'given.yaml'
    file.write_text('/**: {ros__parameters: {publish_period: 0.5, coast: 30.0}}')
    given = {'name': 'noise', 'namespace': f'{ros.namespace.lstrip("/")}/front',
             'params_file': str(file), 'gyro_topic': 'a/gyro', 'accel_topic': 'a/accel',
             'state_file': str(ros.folder / '2026'), 'output_dir': str(ros.folder / 'out'),
             'spec_file': str(specification), 'reference': str(reference),
             'temperature_topic': 'a/warmth',
             'log_level': 'debug', 'use_sim_time': 'true', 'respawn': 'false'}
    file = LAUNCH / 'imu_allan.launch.py'
    assert {*given, 'imu_topic'} == set(declared(file))
    [node] = launched(file, **given)
    assert (node.package, node.executable, node.respawn) == ('imu_allan', 'imu_allan_node', False)
    start = 'import sys; from imu_allan.node.imu_allan_node import main; sys.exit(main())'
    log = ros.folder / 'log'
    with log.open('wb') as output:
        process = subprocess.Popen([sys.executable, '-c', start, *node.command(ros.folder)],
                                   stdout=output, stderr=subprocess.STDOUT)
    try:
        ros.until(lambda: 'characterizing the IMU' in log.read_text()
                  or process.poll() is not None)
        assert process.poll() is None, log.read_text()
        names = ['publish_period', 'coast', 'gyro_topic', 'accel_topic', 'state_file',
                 'output_dir', 'spec_file', 'reference', 'temperature_topic', 'use_sim_time']
        values = ros.call(GetParameters, 'front/noise/get_parameters',
                          GetParameters.Request(names=names)).values
        found = {name: value.string_value or value.double_value or value.bool_value
                 for name, value in zip(names, values, strict=True)}
        assert found == {
            'publish_period': 0.5, 'coast': 30.0, 'use_sim_time': True,
            **{name: given[name] for name in names if name in given and name != 'use_sim_time'}}
        topics = ros.name('front/a/gyro'), ros.name('front/a/accel')
        assert ros.until(lambda: f'characterizing the IMU on {" and ".join(topics)}'
                         in said_in(log.read_text()))
        assert 'DEBUG' in log.read_text()
    finally:
        process.terminate()
        assert process.wait(300) in (0, -15), log.read_text()


def test_the_topic_of_one_imu_is_remapped_and_defaults_leave_the_file_alone(
        tmp_path: Path) -> None:
    [node] = launched(LAUNCH / 'imu_allan.launch.py', imu_topic='/front/imu')
    words = node.command(tmp_path)
    assert words[-2:] == ['-r', 'imu/data_raw:=/front/imu']
    assert words[:3] == ['--ros-args', '--log-level', 'info']
    assert '__ns:=/' in words
    assert str(ROOT / 'config' / 'imu_allan.yaml') in words
    # What is empty is not set: the file would be overruled.
    assert '{use_sim_time: false}' in (tmp_path / 'launch_params_1.yaml').read_text().replace(
        '\n    use_sim_time: false\n', ' {use_sim_time: false}')
    assert node.respawn is True
    # It saves before it ends, which takes longer than launch waits by default.
    assert (node.sigterm_timeout, node.sigkill_timeout) == ('30', '30')


@pytest.mark.parametrize(('file', 'given', 'line'), [
    ('imu_allan', {'params_file': '/no/such'}, 'params_file /no/such: no such file'),
    ('imu_allan', {'log_level': 'loud'},
     'Argument "log_level" provided value "loud" is not valid.'),
    ('several_imus', {}, 'Required launch argument "imus" was not provided.'),
    ('several_imus', {'imus': 'front'},
     "imus: 'front' is not NAMESPACE=TOPIC, such as front=/front/imu"),
    ('several_imus', {'imus': 'front=/a front=/b'}, 'imus: two IMUs in the namespace front')])
def test_a_missing_file_a_wrong_choice_or_list_ends_the_launch(
        file: str, given: dict[str, str], line: str) -> None:
    with refused(line, RuntimeError):
        launched(LAUNCH / f'{file}.launch.py', **given)


def test_each_imu_of_a_list_has_a_node_a_topic_and_a_state_file_of_its_own(
        tmp_path: Path) -> None:
    nodes = launched(LAUNCH / 'several_imus.launch.py', state_dir='/var/lib/robot',
                     imus='front=/front/imu a/rear=/rear/imu/data_raw', output_dir='/tmp/out')
    started = []
    for number, node in enumerate(nodes):
        folder = tmp_path / str(number)
        folder.mkdir()
        words = ' '.join(node.command(folder))
        parameters = (folder / 'launch_params_1.yaml').read_text()
        started.append((re.findall(r'__ns:=(\S+)', words), re.findall(r'data_raw:=(\S+)', words),
                        re.findall(r'state_file: (\S+)', parameters)))
        # What is given to the list goes on to each.
        assert 'output_dir: /tmp/out' in parameters
    assert started == [(['/front'], ['/front/imu'], ['/var/lib/robot/front.state']),
                       (['/a/rear'], ['/rear/imu/data_raw'], ['/var/lib/robot/a_rear.state'])]


def test_the_demo_hands_its_arguments_to_the_simulator(tmp_path: Path) -> None:
    simulator, node = launched(LAUNCH / 'demo.launch.py', model='/models/unit #3.yaml', rate='50',
                               speed='2', duration='10')
    simulator.command(tmp_path)
    text = (tmp_path / 'launch_params_0.yaml').read_text()
    assert "model: '/models/unit #3.yaml'" in text
    assert [f'{name}: {value}' in text for name, value in (
        ('rate', 50.0), ('speed', 2.0), ('duration', 10.0))] == [True] * 3
    assert simulator.namespace == node.namespace


@pytest.fixture
def reference(tmp_path: Path) -> Path:
    """Write a result from before."""
    run = Characterization(kind='topic', topic='/imu')
    for block in simulated_blocks(parse_model('gyro: {noise_density: 0.3 deg/sqrt(h)}'), 100.0,
                                  3000, start_ns=10**18):
        run.update(block)
    save_result(run.result(), tmp_path / 'reference.json')
    return tmp_path / 'reference.json'
