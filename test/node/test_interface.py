# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""--help, parameter file, analyzers, Foxglove layout and security policy agree with the nodes."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree

from imu_allan.node.interface import CHARACTERIZATION, help_text, Interface, SETTINGS, SIMULATOR
import pytest
from ros_harness import ENTRY_POINTS, Health, Ros
import yaml

ROOT = Path(__file__).parents[2]
INTERFACES = {one.program: one for one in (CHARACTERIZATION, SIMULATOR)}
NAMES = {'imu_allan_node': 'imu_allan', 'imu_simulator': 'imu_simulator'}
TERMS = ('noise_density', 'bias_instability', 'rate_random_walk', 'filter_random_walk')


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_help_describes_a_node_without_starting_ros(program: str) -> None:
    start = (f'import sys; from {ENTRY_POINTS[program]} import main; status = main(); '
             'print("rclpy" in sys.modules); sys.exit(status)')
    text = help_text(INTERFACES[program])
    for option in ('--help', '-h'):
        done = subprocess.run([sys.executable, '-c', start, option], capture_output=True,
                              text=True, check=True)
        assert done.stdout == f'{text}\nFalse\n'
    assert text.startswith(f'usage: {program} ')
    for setting in INTERFACES[program].settings:
        assert f'  {setting.name} (' in text


def test_help_whose_reader_has_seen_enough_ends_without_a_word() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    start = 'import sys; from imu_allan.node.imu_simulator import main; sys.exit(main())'
    done = subprocess.run([sys.executable, '-c', start, '--help'], stdout=writer,
                          stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, '')


@pytest.fixture(scope='module')
def running(shared_ros: Ros) -> Ros:
    shared_ros.start('imu_allan_node', {'use_sim_time': True})
    shared_ros.start('imu_simulator')
    # The services that are made last.
    for name, last in ('imu_allan', 'pause'), ('imu_simulator', 'knock'):
        shared_ros.until(lambda name=name, last=last: f'{name}/{last}' in offered(
            shared_ros, name)['reply'])
    return shared_ros


def offered(ros: Ros, name: str) -> dict[str, set[str]]:
    """Give what a node publishes, subscribes to and answers, without the namespace."""
    own = (name, ros.namespace)
    # A node that is not known yet has nothing.
    known = own in ros.node.get_node_names_and_namespaces()
    return {right: {topic.removeprefix(f'{ros.namespace}/') for topic, _ in found(*own)} if known
            else set() for right, found in (
                ('publish', ros.node.get_publisher_names_and_types_by_node),
                ('subscribe', ros.node.get_subscriber_names_and_types_by_node),
                ('reply', ros.node.get_service_names_and_types_by_node))}


def expanded(interface: Interface, node: str) -> set[str]:
    names = set()
    for entries in (interface.subscribed, interface.published, interface.services):
        for written, _, _ in entries:
            for name in re.sub(r'(\S+)/low, \.\.\.(/high)', r'\1/low, \1\2', written).split(', '):
                names |= {name.replace('~', node).replace('SENSOR', sensor).replace('TERM', term)
                          for sensor in ('gyro', 'accel') for term in TERMS}
    return names


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_what_help_names_is_what_the_node_has(running: Ros, program: str) -> None:
    node = NAMES[program]
    # Nothing is measured of the tuned walk.
    wanted = {name for name in expanded(INTERFACES[program], node)
              if 'filter_random_walk/interval' not in name}
    found = set.union(*offered(running, node).values())
    assert wanted <= found
    assert {name for name in found - wanted if 'parameter' not in name} <= {
        '/rosout', f'{node}/get_type_description', '/clock'}


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
    topics = {topic.removeprefix(f'{running.namespace}/')
              for topic in re.findall(r'"(/[a-z0-9_/]+)', done.stdout)}
    assert topics <= offered(running, 'imu_allan')['publish']
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
    tree = ElementTree.parse(ROOT / 'config' / 'imu_allan.policy.xml')
    [profile] = tree.iter('profile')
    assert profile.attrib == {'ns': '/', 'node': 'imu_allan'}
    for right, names in offered(running, 'imu_allan').items():
        assert names == {entry.text for group in profile.iter(
            'services' if right == 'reply' else 'topics')
            if group.get(right) == 'ALLOW' for entry in group}, right


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
    ros.until(lambda: offered(ros, 'imu_allan')['subscribe'] == {*named, '/clock'})
    # No status is left to other analyzers.
    health.news()
    names = {status.name for status in health.heard}
    assert len(names) > 4
    assert not [name for name in names
                if not any(part in name for part in analyzer()['contains'])]
