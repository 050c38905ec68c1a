# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The C++ of docs/ros_interface.md compiles and reads what the node publishes."""

from pathlib import Path
import re
import shutil
import subprocess

from imu_allan.analysis import analyze
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
import pytest

PAGE = (Path(__file__).parents[2] / 'docs' / 'ros_interface.md').read_text()
SNIPPETS = re.findall(r'^```cpp\n(.*?)^```', PAGE, re.MULTILINE | re.DOTALL)

RCLCPP = """
#pragma once
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
// Stands in for rclcpp, as far as the examples use it: a subscription is called at once.
namespace rclcpp {
struct Logger {};
struct QoS { explicit QoS(size_t) {} QoS & transient_local() {return *this;} };
template<typename T> struct Subscription
{ using SharedPtr = std::shared_ptr<Subscription<T>>; std::function<void(const T &)> callback; };
template<typename T> T & latest() {static T message; return message;}
struct Node
{
  explicit Node(const std::string &) {}
  Logger get_logger() const {return Logger();}
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
#define RCLCPP_INFO(logger, ...) (static_cast<void>(logger), std::printf(__VA_ARGS__), \\
  std::printf("\\n"))
"""
STRING = """
#pragma once
#include <string>
namespace std_msgs::msg { struct String { std::string data; }; }
"""
VECTOR = """
#pragma once
namespace geometry_msgs::msg {
struct Vector3 { double x{1}, y{2}, z{3}; };
struct Vector3Stamped { Vector3 vector; };
}
"""
MAIN = """
#include <fstream>
#include <iterator>
int main(int, char ** arguments)
{
  std::ifstream file(arguments[1]);
  rclcpp::latest<std_msgs::msg::String>().data = std::string(
    std::istreambuf_iterator<char>(file), {});
  Reader reader;
}
"""


def compiled(folder: Path, name: str, text: str) -> Path:
    """Compile a program with the stand-ins; skip where it cannot be compiled."""
    compiler = shutil.which('g++') or shutil.which('clang++')
    if compiler is None:
        pytest.skip('no C++ compiler')
    for path, content in (('rclcpp/rclcpp.hpp', RCLCPP), ('std_msgs/msg/string.hpp', STRING),
                          ('geometry_msgs/msg/vector3_stamped.hpp', VECTOR)):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)
    source, program = folder / f'{name}.cpp', folder / name
    source.write_text(text)
    if 'nlohmann/json.hpp' in text and subprocess.run(
            [compiler, '-E', '-x', 'c++', '-'], input='#include <nlohmann/json.hpp>', text=True,
            capture_output=True, check=False).returncode:
        pytest.skip('no nlohmann/json.hpp (Debian: nlohmann-json3-dev)')
    done = subprocess.run(
        [compiler, '-std=c++17', '-O0', '-Wall', '-Wextra', '-Werror', f'-I{folder}', str(source),
         '-o', str(program)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def test_the_example_that_reads_a_coefficient_compiles(tmp_path: Path) -> None:
    program = compiled(tmp_path, 'filter', f'{SNIPPETS[0]}\nint main() {{Filter filter;}}\n')
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert done.stdout == 'imu_allan/gyro/noise_density\n'


@pytest.mark.slow
def test_the_example_that_reads_the_result_finds_value_and_interval(tmp_path: Path) -> None:
    program = compiled(tmp_path, 'reader', SNIPPETS[1] + MAIN)
    model = parse_model('gyro: {noise_density: 0.3 deg/sqrt(h)}\n'
                        'accel: {noise_density: 150 ug/sqrt(Hz)}\n')
    result = analyze(write_recording(tmp_path / 'a', simulated_blocks(
        model, 100.0, 3000, start_ns=10**18)))
    (tmp_path / 'result.json').write_text(result.to_json())
    done = subprocess.run([program, tmp_path / 'result.json'], capture_output=True, text=True,
                          check=True)
    topic, *lines = done.stdout.splitlines()
    assert topic == 'imu_allan/result'
    expected = {}
    for name, axis in result.axes.items():
        found = axis.coefficients['noise_density']
        assert found.ci95 is not None
        expected[name] = f'{name}: {found.value:g} ({found.ci95[0]:g} .. {found.ci95[1]:g})'
    assert sorted(lines) == sorted(expected.values())
