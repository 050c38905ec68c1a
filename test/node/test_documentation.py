# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""docs/ros_interface.md says what the nodes do."""

import json
from pathlib import Path
import re
import shutil
import subprocess
from typing import Any

from imu_allan.node.interface import Setting, SETTINGS, SIMULATOR_SETTINGS
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_harness import Driver, Ros
from std_msgs.msg import String

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()


def section(title: str) -> str:
    found = re.search(rf'^(#+) {re.escape(title)}\n(.*?)(?=^\1 |\Z)', PAGE,
                      re.MULTILINE | re.DOTALL)
    assert found is not None, title
    return found[2]


def written(setting: Setting) -> str:
    default = setting.default
    if default == '':
        return 'empty'
    if isinstance(default, tuple):
        return f'`{list(default)}`'
    return f'`{default}`' if isinstance(default, str) else repr(default)


@pytest.mark.parametrize(('title', 'settings'), [
    ('Parameters', SETTINGS),
    ('The node `imu_simulator`', SIMULATOR_SETTINGS)])
def test_every_parameter_is_documented_with_default_and_range(
        title: str, settings: tuple[Setting, ...]) -> None:
    rows = dict(re.findall(r'^\| `(\w+)` \| (.*) \|$', section(title), re.MULTILINE))
    assert set(rows) == {setting.name for setting in settings}
    for setting in settings:
        default, *between, what = rows[setting.name].split(' | ')
        assert default == written(setting)
        if title == 'Parameters':
            assert setting.lowest is None or between[0].startswith(
                f'{setting.lowest:g} .. {setting.highest:.0f}')
            assert ('read-only' in what) == setting.read_only, setting.name


def test_the_python_example_and_the_expression_read_a_coefficient(ros: Ros) -> None:
    from rclpy.node import Node

    class InThisDomain(Node):
        def __init__(self, name: str) -> None:
            super().__init__(name, context=ros.node.context, namespace=ros.namespace)

    names: dict[str, Any] = {}
    [code] = re.findall(r'^```python\n(import math\n.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    exec(compile(code, 'ros_interface.md', 'exec'), names)
    [expression] = re.findall(r'`(json\.loads.*?)`', PAGE)
    results: list[String] = []
    example = type('Filter', (names['Filter'], InThisDomain), {})()
    example.create_subscription(String, 'imu_allan/result', results.append, QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    ros.executor.add_node(example)
    try:
        ros.start('imu_allan_node', {'publish_period': 0.5})
        driver = Driver(ros).wait_for_node()
        driver.publish(4000)
        # White noise of 0.01 rad/s at 200 Hz.
        expected = 0.01 / 200**0.5
        ros.until(lambda: all(value == pytest.approx(expected, rel=0.1)
                              for value in example.gyro_noise_density))
        ros.until(lambda: results)
        low, high = eval(expression, {'json': json, 'message': results[-1]})
        assert low < example.gyro_noise_density[0] < high
    finally:
        example.destroy_node()


STAND_INS = {
    'rclcpp/rclcpp.hpp': """
#pragma once
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
// As far as the example uses it: a subscription is called at once.
namespace rclcpp {
struct QoS { explicit QoS(size_t) {} QoS & transient_local() {return *this;} };
template<typename T> struct Subscription
{ using SharedPtr = std::shared_ptr<Subscription<T>>; };
struct Node
{
  explicit Node(const std::string &) {}
  template<typename T>
  typename Subscription<T>::SharedPtr create_subscription(
    const std::string & topic, const QoS &, std::function<void(const T &)> callback)
  {
    std::printf("%s\\n", topic.c_str());
    callback(T());
    return nullptr;
  }
};
}
""",
    'geometry_msgs/msg/vector3_stamped.hpp': """
#pragma once
namespace geometry_msgs::msg {
struct Vector3 { double x{1}, y{2}, z{3}; };
struct Vector3Stamped { Vector3 vector; };
}
"""}


def test_the_cpp_example_compiles_and_subscribes_to_what_the_node_publishes(
        tmp_path: Path) -> None:
    compiler = shutil.which('g++') or shutil.which('clang++')
    if compiler is None:
        pytest.skip('no C++ compiler')
    for name, content in STAND_INS.items():
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(content)
    [example] = re.findall(r'^```cpp\n(.*?)^```', PAGE, re.MULTILINE | re.DOTALL)
    (tmp_path / 'filter.cpp').write_text(f'{example}\nint main() {{Filter filter;}}\n')
    subprocess.run([compiler, '-std=c++17', '-O0', '-Wall', '-Wextra', '-Werror', f'-I{tmp_path}',
                    'filter.cpp', '-o', 'filter'], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / 'filter'], capture_output=True, text=True, check=True)
    assert done.stdout == 'imu_allan/gyro/noise_density\n'
