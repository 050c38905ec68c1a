# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Page, parameter file, analyzers, Foxglove layout and policy agree with the nodes."""

import json
from pathlib import Path
import re
import subprocess
from xml.etree import ElementTree

from imu_allan.node.parameters import CHARACTERIZATION, SIMULATOR
from processes import python
import pytest
from rclpy.node import Node
from ros_harness import Driver, ENTRY_POINTS, LATCHED
from std_msgs.msg import String
import yaml

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'ros_interface.md').read_text()


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_help_names_what_describes_a_node_and_starts_no_ros(program):
    start = (f'import sys; from {ENTRY_POINTS[program]} import main; status = main(); '
             'print("rclpy" in sys.modules); sys.exit(status)')
    usage, *others, imported = python('-c', start, '--help', check=True).stdout.splitlines()
    assert usage.startswith(f'usage: {program} --ros-args ')
    assert (len(others), imported) == (3, 'False')


@pytest.fixture(scope='module')
def running(shared_ros):
    shared_ros.start('imu_allan_node', {'use_sim_time': True})
    # The service that is made last.
    shared_ros.until(lambda: 'imu_allan/pause' in offered(shared_ros, 'imu_allan')['reply'])
    return shared_ros


def offered(ros, name):
    """Give what a node publishes, subscribes to and answers, without the namespace."""
    own = (name, ros.namespace)
    # A node that is not known yet has nothing.
    known = own in ros.node.get_node_names_and_namespaces()
    return {right: {topic.removeprefix(f'{ros.namespace}/') for topic, _ in found(*own)} if known
            else set() for right, found in (
                ('publish', ros.node.get_publisher_names_and_types_by_node),
                ('subscribe', ros.node.get_subscriber_names_and_types_by_node),
                ('reply', ros.node.get_service_names_and_types_by_node))}


def test_the_parameter_files_have_every_default_and_an_analyzer_for_every_status():
    own, analyzers = (yaml.safe_load((ROOT / 'config' / file).read_text())['/**'][
        'ros__parameters'] for file in ('imu_allan.yaml', 'imu_allan_diagnostics.yaml'))
    assert own == {setting.name: list(setting.default) if isinstance(setting.default, tuple)
                   else setting.default for setting in CHARACTERIZATION}
    [(name, analyzer)] = [one for one in analyzers.items() if isinstance(one[1], dict)]
    # The aggregator asks for a parameter of one type and ends where it has another.
    types = {'type': str, 'path': str, 'contains': list, 'timeout': float}
    assert {key: type(value) for key, value in analyzer.items()}.items() <= types.items()
    assert {key: type(value) for key, value in analyzers.items() if key != name} == {'path': str}
    assert (analyzer['type'], analyzer['contains']) == (
        'diagnostic_aggregator/GenericAnalyzer', [f': {part}' for part in (
            'reception', 'timeline', 'estimation', 'storage', 'specification', 'reference')])


def test_foxglove_layout_and_cpp_example_take_what_is_published_in_a_namespace_too(running):
    [command] = re.findall(r'^(sed .*imu_allan_foxglove_layout.json) > front.json$', PAGE,
                           re.MULTILINE)
    command = command.replace('/front/', f'{running.namespace}/')
    done = subprocess.run(command, shell=True, cwd=ROOT, capture_output=True, text=True,
                          check=True)
    topics = {topic.removeprefix(f'{running.namespace}/')
              for topic in re.findall(r'"(/[a-z0-9_/]+)', done.stdout)}
    assert len(topics) >= 7
    [example] = re.findall(r'^```cpp\n(.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    topics |= {*re.findall(r'"([\w/]+/[\w/]+)"', example)}
    assert topics <= offered(running, 'imu_allan')['publish']
    layout = json.loads(done.stdout)
    panels = layout['configById']
    assert {*re.findall(r'"(\w+!\w+)"', json.dumps(layout['layout']))} == {*panels}
    # Each axis is plotted over its averaging times.
    for sensor in ('gyro', 'accel'):
        panel = panels[f'Plot!{sensor}_curve']
        data = f'{running.namespace}/imu_allan/{sensor}/allan_deviation.data'
        assert [path['value'] for path in (panel['xAxisPath'], *panel['paths'])] == [
            f'{data}[{first}:{first + 24}].@log10' for first in (0, 25, 50, 75)]


def test_the_security_policy_allows_what_the_node_uses_and_no_more(running):
    [file] = re.findall(r'^ros2 security create_permission keystore /imu_allan (.*)$', PAGE,
                        re.MULTILINE)
    tree = ElementTree.parse(ROOT / file)
    [profile] = tree.iter('profile')
    assert profile.attrib == {'ns': '/', 'node': 'imu_allan'}
    for right, names in offered(running, 'imu_allan').items():
        assert names == {entry.text for group in profile.iter(
            'services' if right == 'reply' else 'topics')
            if group.get(right) == 'ALLOW' for entry in group}, right


def written(setting):
    default = setting.default
    if default == '':
        return 'empty'
    if isinstance(default, tuple):
        return f'`{list(default)}`'
    return f'`{default}`' if isinstance(default, str) else repr(default)


@pytest.mark.parametrize(('title', 'settings'), [
    ('Parameters', CHARACTERIZATION), ('The node `imu_simulator`', SIMULATOR)])
def test_every_parameter_is_documented_with_default_and_range(title, settings):
    [(_, section)] = re.findall(rf'^(#+) {re.escape(title)}\n(.*?)(?=^\1 |\Z)', PAGE,
                                re.MULTILINE | re.DOTALL)
    rows = dict(re.findall(r'^\| `(\w+)` \| (.*) \|$', section, re.MULTILINE))
    assert set(rows) == {setting.name for setting in settings}
    for setting in settings:
        default, *between, what = rows[setting.name].split(' | ')
        assert default == written(setting)
        if title == 'Parameters':
            assert setting.lowest is None or between[0].startswith(
                f'{setting.lowest:g} .. {setting.highest:.0f}')
            assert ('read-only' in what) == setting.read_only, setting.name


def test_the_python_example_and_the_expression_read_a_coefficient(ros):
    class InThisDomain(Node):
        def __init__(self, name):
            super().__init__(name, context=ros.node.context, namespace=ros.namespace)

    names = {}
    [code] = re.findall(r'^```python\n(import math\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    exec(compile(code, 'ros_interface.md', 'exec'), names)
    [expression] = re.findall(r'`(json\.loads.*?)`', PAGE)
    results = []
    example = type('Filter', (names['Filter'], InThisDomain), {})()
    example.create_subscription(String, 'imu_allan/result', results.append, LATCHED)
    ros.executor.add_node(example)
    try:
        ros.start('imu_allan_node', {'publish_period': 0.5})
        driver = Driver(ros).wait_for_node()
        driver.publish(4000)
        # White noise of 0.01 rad/s at 200 Hz.
        expected = [pytest.approx(0.01 / 200**0.5, rel=0.1)] * 3
        ros.until(lambda: list(example.gyro_noise_density) == expected)
        ros.until(lambda: results)
        low, high = eval(expression, {'json': json, 'message': results[-1]})
        assert low < example.gyro_noise_density[0] < high
    finally:
        example.destroy_node()
