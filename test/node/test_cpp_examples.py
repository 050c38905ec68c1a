# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The C++ of docs/ros_interface.md compiles and subscribes to what the node publishes."""

from pathlib import Path
import re
import shutil
import subprocess

import pytest

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()
[SNIPPET] = re.findall(r'^```cpp\n(.*?)^```', PAGE, re.MULTILINE | re.DOTALL)

RCLCPP = """
#pragma once
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
// Stands in for rclcpp, as far as the examples use it: a subscription is called at once.
namespace rclcpp {
struct QoS { explicit QoS(size_t) {} QoS & transient_local() {return *this;} };
template<typename T> struct Subscription
{ using SharedPtr = std::shared_ptr<Subscription<T>>; std::function<void(const T &)> callback; };
template<typename T> T & latest() {static T message; return message;}
struct Node
{
  explicit Node(const std::string &) {}
  template<typename T, typename F>
  typename Subscription<T>::SharedPtr create_subscription(
    const std::string & topic, const QoS &, F callback)
  {
    std::printf("%s\\n", topic.c_str());
    auto made = std::make_shared<Subscription<T>>();
    made->callback = callback;
    made->callback(latest<T>());
    return made;
  }
};
}
"""
VECTOR = """
#pragma once
namespace geometry_msgs::msg {
struct Vector3 { double x{1}, y{2}, z{3}; };
struct Vector3Stamped { Vector3 vector; };
}
"""


def compiled(folder: Path, name: str, text: str) -> Path:
    """Compile a program with the stand-ins; skip where it cannot be compiled."""
    compiler = shutil.which('g++') or shutil.which('clang++')
    if compiler is None:
        pytest.skip('no C++ compiler')
    for path, content in (('rclcpp/rclcpp.hpp', RCLCPP),
                          ('geometry_msgs/msg/vector3_stamped.hpp', VECTOR)):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)
    source, program = folder / f'{name}.cpp', folder / name
    source.write_text(text)
    done = subprocess.run(
        [compiler, '-std=c++17', '-O0', '-Wall', '-Wextra', '-Werror', f'-I{folder}', str(source),
         '-o', str(program)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def test_the_example_that_reads_a_coefficient_compiles(tmp_path: Path) -> None:
    program = compiled(tmp_path, 'filter', f'{SNIPPET}\nint main() {{Filter filter;}}\n')
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert done.stdout == 'imu_allan/gyro/noise_density\n'
