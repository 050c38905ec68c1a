# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, on stand-ins for launch; and a real node started so."""

from pathlib import Path
import subprocess
import sys

from launch_stand_ins import arguments, LaunchConfiguration, launched, ParameterValue, ROOT
import pytest
from rcl_interfaces.srv import GetParameters
from ros_harness import at_rest, result_of, Ros, said_in
from whole_lines import refused
import yaml


def test_every_argument_is_described_and_documented() -> None:
    page = (ROOT / 'docs' / 'ros_interface.md').read_text()
    section = page.partition('### Launch\n')[2].partition('\n## ')[0]
    for file in (ROOT / 'launch').glob('*.launch.py'):
        for name, argument in arguments(file.name.partition('.')[0]).items():
            assert argument.description, name
            assert f'`{name}`' in section, name


def test_every_argument_reaches_the_node(ros: Ros) -> None:
    specification, file = ros.folder / 'limits #1.yaml', ros.folder / 'given.yaml'
    specification.write_text('gyro: {noise_density: 1 deg/sqrt(h)}\n')
    file.write_text('/**: {ros__parameters: {publish_period: 0.5, coast: 30.0}}')
    reference = ros.folder / 'reference.json'
    reference.write_text(result_of(at_rest(3000)).to_json())
    given = {'name': 'noise', 'namespace': f'{ros.namespace.lstrip("/")}/front',
             'params_file': str(file), 'gyro_topic': 'a/gyro', 'accel_topic': 'a/accel',
             'state_file': str(ros.folder / '2026'), 'output_dir': str(ros.folder / 'out'),
             'spec_file': str(specification), 'reference': str(reference),
             'temperature_topic': 'a/warmth',
             'log_level': 'debug', 'use_sim_time': 'true', 'respawn': 'false'}
    assert {*given, 'imu_topic'} == {*arguments('imu_allan')}
    [node] = launched('imu_allan', **given)
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
        wanted = {'publish_period': 0.5, 'coast': 30.0, **given, 'use_sim_time': True}
        for other in ('name', 'namespace', 'params_file', 'log_level', 'respawn'):
            del wanted[other]
        values = ros.call(GetParameters, 'front/noise/get_parameters',
                          GetParameters.Request(names=[*wanted])).values
        assert {name: value.string_value or value.double_value or value.bool_value
                for name, value in zip(wanted, values, strict=True)} == wanted
        topics = ros.name('front/a/gyro'), ros.name('front/a/accel')
        assert ros.until(lambda: f'characterizing the IMU on {" and ".join(topics)}'
                         in said_in(log.read_text()))
        assert 'DEBUG' in log.read_text()
    finally:
        process.terminate()
        assert process.wait(300) in (0, -15), log.read_text()


def test_the_topic_of_one_imu_is_remapped_and_defaults_leave_the_file_alone(
        tmp_path: Path) -> None:
    [node] = launched('imu_allan', imu_topic='/front/imu')
    words = node.command(tmp_path)
    assert words[-2:] == ['-r', 'imu/data_raw:=/front/imu']
    assert words[:3] == ['--ros-args', '--log-level', 'info']
    assert '__ns:=/' in words
    assert str(ROOT / 'config' / 'imu_allan.yaml') in words
    # What is empty is not set: the file would be overruled.
    assert yaml.safe_load((tmp_path / 'launch_params_1.yaml').read_text()) == {
        '/**': {'ros__parameters': {'use_sim_time': False}}}
    # It saves before it ends, which takes longer than launch waits by default.
    assert (node.respawn, node.sigterm_timeout, node.sigkill_timeout) == (True, '30', '30')


@pytest.mark.parametrize(('file', 'given', 'line'), [
    ('imu_allan', {'params_file': '/no/such'}, 'params_file /no/such: no such file'),
    ('several_imus', {'imus': 'front'},
     "imus: 'front' is not NAMESPACE=TOPIC, such as front=/front/imu"),
    ('several_imus', {'imus': 'front=/a front=/b'}, 'imus: two IMUs in the namespace front')])
def test_a_missing_file_or_a_wrong_list_ends_the_launch(
        file: str, given: dict[str, str], line: str) -> None:
    with refused(line, RuntimeError):
        launched(file, **given)


def test_each_imu_of_a_list_has_a_node_a_topic_and_a_state_file_of_its_own() -> None:
    included = launched('several_imus', state_dir='/var/lib/robot',
                        imus='front=/front/imu a/rear=/rear/imu/data_raw')
    assert [each.source.location[1:] for each in included] == [['/imu_allan.launch.py']] * 2
    assert [dict(each.launch_arguments) for each in included] == [
        {'namespace': 'front', 'imu_topic': '/front/imu',
         'state_file': '/var/lib/robot/front.state'},
        {'namespace': 'a/rear', 'imu_topic': '/rear/imu/data_raw',
         'state_file': '/var/lib/robot/a_rear.state'}]


def test_the_demo_hands_its_arguments_to_the_simulator() -> None:
    simulator, node = launched('demo')
    assert simulator.parameters == [{
        name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, kind in (
            ('model', str), ('rate', float), ('speed', float), ('duration', float))}]
    assert simulator.namespace == node.namespace
