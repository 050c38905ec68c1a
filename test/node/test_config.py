# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Parameter file, analyzers, Foxglove layout and security policy agree with the node."""

import json
from pathlib import Path
import re
import subprocess
from typing import Any
from xml.etree import ElementTree

from imu_allan.node.interface import SETTINGS
import pytest
from ros_harness import Driver, Health, Ros
import yaml

ROOT = Path(__file__).parents[2]


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


ANALYZER = {'type': str, 'path': str, 'contains': list, 'startswith': list, 'name': list,
            'expected': list, 'regex': list, 'remove_prefix': list,
            'find_and_remove_prefix': list, 'timeout': float, 'num_items': int,
            'discard_stale': bool}
"""Parameters of diagnostic_aggregator/GenericAnalyzer in ROS 2, each of one type only."""
STATUSES = ('reception', 'timeline', 'estimation', 'storage', 'specification', 'reference')


def analyzer() -> dict[str, Any]:
    document = yaml.safe_load((ROOT / 'config' / 'imu_allan_diagnostics.yaml').read_text())
    parameters = document['/**']['ros__parameters']
    assert isinstance(parameters['path'], str)
    [found] = [value for value in parameters.values() if isinstance(value, dict)]
    return dict(found)


def test_the_analyzers_take_in_every_status_of_the_node() -> None:
    assert analyzer()['type'] == 'diagnostic_aggregator/GenericAnalyzer'
    for name, value in analyzer().items():
        # The aggregator asks for a parameter of this type and ends where it has another.
        assert type(value) is ANALYZER[name], name
        assert name in ('type', 'path', 'timeout') or {type(item) for item in value} == {str}
    assert analyzer()['contains'] == [f': {part}' for part in STATUSES]


def test_the_parameter_file_has_every_parameter_at_its_default() -> None:
    document = yaml.safe_load((ROOT / 'config' / 'imu_allan.yaml').read_text())
    expected = {setting.name: list(setting.default) if isinstance(setting.default, tuple)
                else setting.default for setting in SETTINGS}
    assert document == {'/**': {'ros__parameters': expected}}


def test_the_foxglove_layout_shows_published_topics_in_a_namespace_too(running: Ros) -> None:
    page = (ROOT / 'docs' / 'ros_interface.md').read_text()
    [command] = re.findall(r'^(sed .*imu_allan_foxglove_layout.json) > front.json$', page,
                           re.MULTILINE)
    command = command.replace('/front/', f'{running.namespace}/')
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, text=True,
                          check=True)
    topics = set(re.findall(r'"(/[a-z0-9_/]+)', done.stdout))
    published = {name for name, _ in running.node.get_publisher_names_and_types_by_node(
        'imu_allan', running.namespace)}
    assert topics <= published
    assert len(topics) >= 7


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


def test_a_node_of_two_topics_and_a_thermometer_is_in_policy_and_aggregator(
        ros: Ros, health: Health) -> None:
    text = (ROOT / 'config' / 'imu_allan.policy.xml').read_text()
    [comment] = [part for part in re.findall(r'<!--(.*?)-->', text, re.DOTALL)
                 if '<topic>' in part]
    named = re.findall(r'<topic>(.*)</topic>', comment)
    gyro, accel, temperature = map(ros.name, named)
    node = ros.start('imu_allan_node', {
        'use_sim_time': True, 'gyro_topic': gyro, 'accel_topic': accel,
        'temperature_topic': temperature, 'state_file': str(ros.folder / 'state')},
        best_effort=True)
    ros.until(lambda: 'characterizing the IMU' in node.log)

    def subscribed() -> set[str]:
        found = ros.node.get_subscriber_names_and_types_by_node('imu_allan', ros.namespace)
        return without_namespace(ros, {name for name, _ in found})

    ros.until(lambda: ('imu_allan', ros.namespace) in ros.node.get_node_names_and_namespaces())
    ros.until(lambda: subscribed() == {*named, '/clock'})
    # No status is left to other analyzers.
    health.news()
    names = {status.name for status in health.heard}
    assert len(names) > 4
    assert not [name for name in names
                if not any(part in name for part in analyzer()['contains'])]
