# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, on stand-ins for launch; and a real node started so."""

from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, make_dataclass
import importlib.util
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from types import SimpleNamespace
from typing import Any
from unittest import mock

from characterized import streamed
from diagnostic_msgs.msg import DiagnosticArray
import pytest
from rcl_interfaces.srv import GetParameters
from repeated import slow
from ros_harness import arguments, at_rest, Driver, lossless, PATIENCE_S, resident_mb
from std_srvs.srv import SetBool
from whole_lines import refused
import yaml

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'ros_interface.md').read_text()
# `launch` has no wheels: these show what a launch file says, no more.
LaunchContext = dict[str, str]
IMPORTS = 'from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor\n'
MOST_MB = 40
"""Of each further IMU in a process."""
SAMPLES = 2000


def taking(kind, *positional, **keywords):
    """Give a class of the arguments, with defaults, that the Jazzy version documents alone."""
    return make_dataclass(kind, [*positional, *(
        (name, Any, field(default=default, kw_only=True)) for name, default in keywords.items())])


DeclareLaunchArgument = taking('DeclareLaunchArgument', 'name', default_value=None,
                               description='', choices=None)
FindPackageShare = taking('FindPackageShare', 'package')
LaunchDescription = taking('LaunchDescription', 'entities')
OpaqueFunction = taking('OpaqueFunction', function=None)
ParameterValue = taking('ParameterValue', 'value', value_type=None)


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context):
        return context[self.name]


@dataclass
class PathJoinSubstitution:
    parts: Sequence[Any]

    def perform(self, _):
        first, *others = self.parts
        assert first == FindPackageShare('imu_allan')
        return str(ROOT.joinpath(*others))


Node = taking(
    'Node', package=None, executable=None, name=None, namespace='', parameters=(), remappings=(),
    arguments=(), output='log', respawn=False, respawn_delay=None, sigterm_timeout='5',
    sigkill_timeout='5')


def command(node, folder):
    """Give the arguments of the command line of a node; parameters go to files in `folder`."""
    words = [*node.arguments, '--ros-args', '-r', f'__ns:=/{node.namespace.lstrip("/")}',
             '-r', f'__node:={node.name}']
    for number, given in enumerate(node.parameters):
        file = given
        if isinstance(given, Mapping):
            file = folder / f'launch_params_{number}.yaml'
            file.write_text(yaml.safe_dump({'/**': {'ros__parameters': dict(given)}}))
        words += ['--params-file', str(file)]
    for names in node.remappings:
        words += ['-r', ':='.join(names)]
    return words


MODULES = {
    'launch': {'LaunchContext': LaunchContext, 'LaunchDescription': LaunchDescription},
    'launch.actions': {kind.__name__: kind for kind in (
        DeclareLaunchArgument, OpaqueFunction)},
    'launch.substitutions': {kind.__name__: kind for kind in (
        LaunchConfiguration, PathJoinSubstitution)},
    'launch_ros': {}, 'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': ParameterValue},
    'launch_ros.substitutions': {'FindPackageShare': FindPackageShare}}


def described(name):
    modules = {module: SimpleNamespace(**kinds) for module, kinds in MODULES.items()}
    spec = importlib.util.spec_from_file_location(name, ROOT / 'launch' / f'{name}.launch.py')
    file = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, modules):
        spec.loader.exec_module(file)
    return list(file.generate_launch_description().entities)


def declared(name):
    return {one.name: one for one in described(name) if isinstance(one, DeclareLaunchArgument)}


def launched(file, /, **given):
    context = {key: one.default_value if isinstance(one.default_value, (str, type(None)))
               else one.default_value.perform(given) for key, one in declared(file).items()}
    context |= given
    return [started for one in described(file) for started in (
        one.function(context) if isinstance(one, OpaqueFunction) else [one])
        if not isinstance(started, DeclareLaunchArgument)]


def test_every_argument_is_described_and_documented():
    section = PAGE.partition('### Launch\n')[2].partition('\n## ')[0]
    for file in (ROOT / 'launch').glob('*.launch.py'):
        for name, argument in declared(file.name.partition('.')[0]).items():
            assert argument.description, name
            assert f'`{name}`' in section, name


def test_every_argument_reaches_the_node(ros):
    specification, file = ros.folder / 'limits #1.yaml', ros.folder / 'given.yaml'
    specification.write_text('gyro: {noise_density: 1 deg/sqrt(h)}\n')
    file.write_text('/**: {ros__parameters: {publish_period: 0.5, coast: 30.0}}')
    reference = ros.folder / 'reference.json'
    reference.write_text(streamed([at_rest(3000)]).result().to_json())
    given = {'name': 'noise', 'namespace': f'{ros.namespace.lstrip("/")}/front',
             'params_file': str(file), 'gyro_topic': 'a/gyro', 'accel_topic': 'a/accel',
             'state_file': str(ros.folder / '2026'), 'output_dir': str(ros.folder / 'out'),
             'spec_file': str(specification), 'reference': str(reference),
             'temperature_topic': 'a/warmth',
             'log_level': 'debug', 'use_sim_time': 'true', 'respawn': 'false'}
    assert {*given, 'imu_topic'} == {*declared('imu_allan')}
    [node] = launched('imu_allan', **given)
    assert (node.package, node.executable, node.respawn) == ('imu_allan', 'imu_allan_node', False)
    process = ros.started('imu_allan_node', command(node, ros.folder))
    topics = ros.name('front/a/gyro'), ros.name('front/a/accel')
    ros.until(lambda: f'characterizing the IMU on {" and ".join(topics)}' in process.lines)
    wanted = {'publish_period': 0.5, 'coast': 30.0, **given, 'use_sim_time': True}
    for other in ('name', 'namespace', 'params_file', 'log_level', 'respawn'):
        del wanted[other]
    values = ros.call(GetParameters, 'front/noise/get_parameters',
                      GetParameters.Request(names=[*wanted])).values
    assert {name: value.string_value or value.double_value or value.bool_value
            for name, value in zip(wanted, values, strict=True)} == wanted
    assert 'DEBUG' in process.log
    assert process.stop(signal.SIGTERM) == 0


def test_the_topic_of_one_imu_is_remapped_and_defaults_leave_the_file_alone(tmp_path):
    [node] = launched('imu_allan', imu_topic='/front/imu')
    words = command(node, tmp_path)
    assert words[-2:] == ['-r', 'imu/data_raw:=/front/imu']
    assert words[:3] == ['--ros-args', '--log-level', 'info']
    assert '__ns:=/' in words
    assert str(ROOT / 'config' / 'imu_allan.yaml') in words
    # What is empty is not set: the file would be overruled.
    assert yaml.safe_load((tmp_path / 'launch_params_1.yaml').read_text()) == {
        '/**': {'ros__parameters': {'use_sim_time': False}}}
    # It saves before it ends, which takes longer than launch waits by default.
    assert (node.respawn, node.sigterm_timeout, node.sigkill_timeout) == (True, '30', '30')


def test_a_missing_file_ends_the_launch():
    with refused('params_file /no/such: no such file', RuntimeError):
        launched('imu_allan', params_file='/no/such')


def test_no_state_file_reaches_the_node_which_then_keeps_none():
    [node] = launched('imu_allan', state_file='none')
    assert node.parameters[1] == {'use_sim_time': False, 'state_file': ''}


def test_the_demo_hands_its_arguments_to_the_simulator():
    simulator, node = launched('demo')
    assert simulator.parameters == [{
        name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, kind in (
            ('model', str), ('rate', float), ('speed', float), ('duration', float))}]
    assert simulator.namespace == node.namespace


@contextmanager
def spinning(ros, executor, namespaces):
    """Run the example of the page for these namespaces, in an executor."""
    [code] = re.findall(r'^```python\n(import rclpy\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    sides = "('front', 'rear', 'left', 'right')"
    assert sides in code
    assert IMPORTS in code
    code = code.replace(sides, repr(tuple(namespaces)))
    if executor == 'EventsExecutor':
        # Its `spin` calls nothing in the wheels of rclpy 7.1.6.
        code = code.replace(IMPORTS, 'from rclpy.executors import ExternalShutdownException\n'
                            'from rclpy.experimental import EventsExecutor\n').replace(
            '    executor.spin()\n', '    while rclpy.ok():\n        executor.spin_once(1.0)\n')
    code = code.replace('MultiThreadedExecutor', executor)
    parameters = {'publish_period': 0.5}
    for namespace in namespaces:
        parameters |= lossless(f'{namespace}/imu/data_raw')
    process = subprocess.Popen(
        [sys.executable, '-c', code, '--ros-args', *arguments(parameters)], text=True,
        stderr=subprocess.PIPE,
        env={**os.environ, 'HOME': str(ros.folder), 'ROS_HOME': str(ros.folder)})
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def feed(ros, places):
    """Publish to all nodes, and wait for what each makes of it."""
    drivers = [Driver(ros, f'{place}/imu/data_raw') for place in places]
    arrays = [ros.listen(DiagnosticArray, f'{place}/imu_allan/coefficients') for place in places]
    for driver in drivers:
        driver.wait_for_node()
        driver.publish(SAMPLES)
    for driver in drivers:
        assert driver.publisher.wait_for_all_acked()
    ros.until(lambda: all(arrays))


@pytest.mark.parametrize(('executor', 'count'), [
    ('EventsExecutor', 1), ('MultiThreadedExecutor', 4), slow('SingleThreadedExecutor', 4)])
def test_imus_in_one_process_run_in_any_executor_and_share_what_is_large(ros, executor, count):
    sides = [f'imu{number}' for number in range(count)]
    with spinning(ros, executor, list(map(ros.name, sides))) as process:
        alone = [] if count == 1 else ['alone']
        nodes = [ros.start('imu_allan_node', {'publish_period': 0.5}, namespace=ros.name(name))
                 for name in alone]
        feed(ros, [*alone, *sides])

        def is_shared():
            return all(resident_mb(process.pid) - resident_mb(node.popen.pid)
                       < (count - 1) * MOST_MB for node in nodes)

        assert is_shared()
        for side in [*alone, *sides]:
            assert ros.call(SetBool, f'{side}/imu_allan/pause').success
            assert ros.saved(f'{side}/imu_allan')['timeline']['samples'] == SAMPLES
        # What drawing has taken is given back.
        ros.until(is_shared, timeout=10.0)
        for path in ros.folder.rglob('result.json'):
            path.unlink()
        # Whoever spins it destroys it at the end, and it saves.
        process.send_signal(signal.SIGINT)
        _, log = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, log
        assert log.count('Tuned for a filter') == count
        # Neither node nor rcl complains that ROS has been shut down before. An EventsExecutor does
        # if the interrupt comes within a callback, which it then logs.
        assert 'context is invalid' not in log or "Exception in 'timers' callback" in log
    assert [json.loads(path.read_text())['timeline']['samples']
            for path in ros.folder.rglob('result.json')] == [SAMPLES] * count
