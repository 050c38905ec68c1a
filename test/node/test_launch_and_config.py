# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Launch files, Foxglove layout and security policy agree with the nodes."""

import ast
import importlib.util
import json
from pathlib import Path
import re
import subprocess
from typing import Any
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.node.interface import SETTINGS, SIMULATOR_SETTINGS
import pytest
from ros_harness import Driver, Ros
import yaml

ROOT = Path(__file__).parents[2]
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))


@pytest.fixture(scope='module')
def running(shared_ros: Ros) -> Ros:
    shared_ros.start('imu_allan_node', {'use_sim_time': True})
    Driver(shared_ros).wait_for_node()
    node = ('imu_allan', shared_ros.namespace)
    shared_ros.until(lambda: node in shared_ros.node.get_node_names_and_namespaces())
    # The service that is made last.
    shared_ros.until(lambda: shared_ros.name('imu_allan/pause') in dict(
        shared_ros.node.get_service_names_and_types_by_node(*node)))
    return shared_ros


def without_namespace(ros: Ros, names: set[str]) -> set[str]:
    return {name.removeprefix(f'{ros.namespace}/') for name in names}


def arguments(file: Path) -> set[str]:
    """Names that a launch file declares as its arguments."""
    return {call.args[0].value for call in ast.walk(ast.parse(file.read_text()))
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
            and call.func.id == 'DeclareLaunchArgument'
            and isinstance(call.args[0], ast.Constant)}


def test_the_launch_files_declare_their_arguments() -> None:
    assert {file.name: arguments(file) for file in LAUNCH_FILES} == {
        'imu_allan.launch.py': {'name', 'namespace', 'params_file', 'imu_topic', 'gyro_topic',
                                'accel_topic', 'state_file', 'output_dir', 'spec_file',
                                'reference', 'temperature_topic', 'log_level', 'respawn',
                                'use_sim_time'},
        'several_imus.launch.py': {'imus', 'state_dir'},
        'demo.launch.py': {'model', 'rate', 'speed', 'duration'}}


@pytest.mark.parametrize('file', LAUNCH_FILES, ids=lambda file: file.name)
def test_a_launch_file_describes_its_nodes(file: Path) -> None:
    pytest.importorskip('launch_ros', reason='launch has no wheels: needs a ROS installation')
    spec = importlib.util.spec_from_file_location('launch_file', file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    entities = module.generate_launch_description().entities
    assert {type(entity).__name__ for entity in entities} <= {
        'DeclareLaunchArgument', 'Node', 'OpaqueFunction'}


def test_texts_that_launch_sets_are_parameters_of_the_node() -> None:
    tree = ast.parse((ROOT / 'launch' / 'imu_allan.launch.py').read_text())
    [texts] = [ast.literal_eval(node.value) for node in tree.body if isinstance(node, ast.Assign)
               and isinstance(node.targets[0], ast.Name) and node.targets[0].id == 'TEXTS']
    assert set(texts) <= {setting.name for setting in SETTINGS}
    assert set(texts) <= arguments(ROOT / 'launch' / 'imu_allan.launch.py')


def test_the_list_of_several_imus_is_read_or_refused_with_a_reason() -> None:
    # The function alone: launch itself has no wheels.
    tree = ast.parse((ROOT / 'launch' / 'several_imus.launch.py').read_text())
    [function] = [node for node in tree.body if isinstance(node, ast.FunctionDef)
                  and node.name == 'topics']
    names: dict[str, Any] = {}
    exec(compile(ast.Module([function], []), 'several_imus.launch.py', 'exec'), names)
    assert names['topics']('front=/front/imu  rear=/rear/imu/data_raw') == {
        'front': '/front/imu', 'rear': '/rear/imu/data_raw'}
    for imus, reason in (
            ('front', "imus: 'front' is not NAMESPACE=TOPIC, such as front=/front/imu"),
            ('front=/a front=/b', 'imus: two IMUs in the namespace front')):
        with pytest.raises(RuntimeError) as caught:
            names['topics'](imus)
        assert str(caught.value) == reason


ANALYZER = {'type': str, 'path': str, 'contains': list, 'startswith': list, 'name': list,
            'expected': list, 'regex': list, 'remove_prefix': list,
            'find_and_remove_prefix': list, 'timeout': float, 'num_items': int,
            'discard_stale': bool}
"""Parameters of diagnostic_aggregator/GenericAnalyzer in ROS 2, each of one type only."""
STATUSES = ('reception', 'timeline', 'estimation', 'storage', 'specification', 'reference')


def test_the_analyzers_take_in_every_status_of_the_node() -> None:
    document = yaml.safe_load((ROOT / 'config' / 'imu_allan_diagnostics.yaml').read_text())
    parameters = document['/**']['ros__parameters']
    assert isinstance(parameters['path'], str)
    [analyzer] = [value for value in parameters.values() if isinstance(value, dict)]
    assert analyzer['type'] == 'diagnostic_aggregator/GenericAnalyzer'
    for name, value in analyzer.items():
        # The aggregator asks for a parameter of this type and ends where it has another.
        assert type(value) is ANALYZER[name], name
        assert name in ('type', 'path', 'timeout') or {type(item) for item in value} == {str}
    assert analyzer['contains'] == [f': {part}' for part in STATUSES]


def test_no_status_of_a_node_is_left_to_others(ros: Ros) -> None:
    document = yaml.safe_load((ROOT / 'config' / 'imu_allan_diagnostics.yaml').read_text())
    contains = document['/**']['ros__parameters']['imu_noise']['contains']
    reports = ros.listen(DiagnosticArray, '/diagnostics', 10)
    ros.start('imu_allan_node', {'gyro_topic': 'a', 'accel_topic': 'b',
                                 'state_file': str(ros.folder / 'state')}, best_effort=True)
    names = ros.until(lambda: {status.name for array in reports for status in array.status
                               if status.name.startswith(ros.namespace)})
    assert len(names) > 4
    assert not [name for name in names if not any(part in name for part in contains)]


def test_the_parameter_file_has_every_parameter_at_its_default() -> None:
    document = yaml.safe_load((ROOT / 'config' / 'imu_allan.yaml').read_text())
    expected = {setting.name: list(setting.default) if isinstance(setting.default, tuple)
                else setting.default for setting in SETTINGS}
    assert document == {'/**': {'ros__parameters': expected}}


def test_the_demo_sets_parameters_that_the_nodes_have() -> None:
    names = arguments(ROOT / 'launch' / 'demo.launch.py')
    assert names <= {setting.name for setting in SIMULATOR_SETTINGS}


def test_every_topic_in_the_foxglove_layout_is_published(running: Ros) -> None:
    text = (ROOT / 'config' / 'imu_allan_foxglove_layout.json').read_text()
    topics = set(re.findall(r'"(/[a-z_/]+)', text))
    published = {name.replace(running.namespace, '') for name, _ in
                 running.node.get_publisher_names_and_types_by_node('imu_allan',
                                                                    running.namespace)}
    assert topics <= published
    assert len(topics) >= 7


def test_the_foxglove_layout_works_in_a_namespace_as_the_page_says(running: Ros) -> None:
    page = (ROOT / 'docs' / 'ros_interface.md').read_text()
    [command] = re.findall(r'^(sed .*imu_allan_foxglove_layout.json) > front.json$', page,
                           re.MULTILINE)
    command = command.replace('/front/', f'{running.namespace}/')
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, text=True,
                          check=True)
    topics = set(re.findall(r'"(/[a-z0-9_/]+)', done.stdout)) - {'/diagnostics'}
    published = {name for name, _ in running.node.get_publisher_names_and_types_by_node(
        'imu_allan', running.namespace)}
    assert topics <= published
    assert len(topics) >= 6


def test_the_foxglove_layout_plots_each_axis_over_its_averaging_times() -> None:
    layout = json.loads((ROOT / 'config' / 'imu_allan_foxglove_layout.json').read_text())
    panels = layout['configById']

    def shown(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else shown(part['first']) + shown(part['second'])

    assert sorted(shown(layout['layout'])) == sorted(panels)
    for sensor in ('gyro', 'accel'):
        panel = panels[f'Plot!{sensor}_curve']
        topic = f'/imu_allan/{sensor}/allan_deviation'
        assert panel['xAxisPath']['value'] == f'{topic}.data[0:24].@log10'
        assert [path['value'] for path in panel['paths']] == [
            f'{topic}.data[{first}:{first + 24}].@log10' for first in (25, 50, 75)]


def test_the_security_policy_allows_what_the_node_uses_and_no_more(running: Ros) -> None:
    node, namespace = running.node, running.namespace
    used = {
        ('topic', 'publish'): node.get_publisher_names_and_types_by_node('imu_allan', namespace),
        ('topic', 'subscribe'): node.get_subscriber_names_and_types_by_node('imu_allan',
                                                                            namespace),
        ('service', 'reply'): node.get_service_names_and_types_by_node('imu_allan', namespace)}
    tree = ElementTree.parse(ROOT / 'config' / 'imu_allan.policy.xml')
    [profile] = tree.iter('profile')
    assert profile.attrib == {'ns': '/', 'node': 'imu_allan'}
    for (kind, right), endpoints in used.items():
        allowed = {entry.text or '' for group in profile.findall(f'{kind}s')
                   if group.get(right) == 'ALLOW' for entry in group}
        names = without_namespace(running, {name for name, _ in endpoints})
        assert names == allowed, (kind, right)


def test_the_topics_that_parameters_name_stand_in_the_policy_as_a_comment(ros: Ros) -> None:
    text = (ROOT / 'config' / 'imu_allan.policy.xml').read_text()
    [comment] = [part for part in re.findall(r'<!--(.*?)-->', text, re.DOTALL)
                 if '<topic>' in part]
    named = re.findall(r'<topic>(.*)</topic>', comment)
    gyro, accel, temperature = map(ros.name, named)
    node = ros.start('imu_allan_node', {
        'use_sim_time': True, 'gyro_topic': gyro, 'accel_topic': accel,
        'temperature_topic': temperature}, best_effort=True)
    ros.until(lambda: 'characterizing the IMU' in node.log)

    def subscribed() -> set[str]:
        found = ros.node.get_subscriber_names_and_types_by_node('imu_allan', ros.namespace)
        return without_namespace(ros, {name for name, _ in found})

    ros.until(lambda: ('imu_allan', ros.namespace) in ros.node.get_node_names_and_namespaces())
    ros.until(lambda: subscribed() == {*named, '/clock'})
