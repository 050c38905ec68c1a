# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The layout: every floor imports only what lies below it."""

from graphlib import TopologicalSorter
import re
import sys

from sources import imported, libraries, MODULES, ON_PYPI_ALONE, PACKAGE

FLOORS = (
    ('imu_allan.version', 'imu_allan.arrays', 'imu_allan.errors', 'imu_allan.process',
     'imu_allan.isolated_process', 'imu_allan.json_of_dataclasses', 'imu_allan.finding',
     'imu_allan.result', 'imu_allan.state', 'imu_allan.block', 'imu_allan.wording'),
    ('imu_allan.noise', 'imu_allan.cdr'),
    ('imu_allan.timeline', 'imu_allan.sensor'),
    ('imu_allan.finding_texts', 'imu_allan.finding_messages'),
    ('imu_allan.characterization', 'imu_allan.tuning', 'imu_allan.fleet'),
    ('imu_allan.datasheet',),
    ('imu_allan.writers', 'imu_allan.recordings'),
    ('imu_allan.analysis',),
    ('imu_allan.node', 'imu_allan.cli'),
    # The public names lead everywhere, and nothing inside takes them from there.
    ('imu_allan.__init__', 'imu_allan.__main__', 'imu_allan'),
)
ROS = {'rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'geometry_msgs', 'diagnostic_msgs',
       'builtin_interfaces', 'rcl_interfaces', 'rosgraph_msgs', 'ament_index_python'}


def floor(module):
    """Give the number of the floor of a module; every one has its place."""
    [number] = [number for number, parts in enumerate(FLOORS) for part in parts
                if module == part or (part != 'imu_allan' and module.startswith(f'{part}.'))]
    return number


def test_a_module_imports_nothing_from_a_floor_above_and_there_is_no_circle():
    needs = {module: imported(path) for module, path in MODULES.items()}
    assert not [(module, name) for module, names in needs.items() for name in names
                if name.split('.')[0] == 'imu_allan' and floor(name) > floor(module)]
    # Raises CycleError, which names the modules of the circle.
    TopologicalSorter({module.removesuffix('.__init__'): names
                       for module, names in needs.items()}).prepare()


def test_only_the_node_imports_ros_numerics_need_numpy_and_scipy_and_the_node_what_rosdep_has():
    allowed = {'imu_allan', 'numpy', 'scipy', *sys.stdlib_module_names}
    for module, path in MODULES.items():
        used, part = libraries(path), module.split('.')[1]
        assert part == 'node' or not used & ROS, module
        assert part != 'noise' or not used - allowed, module
        assert part in ('recordings', 'cli', 'writers') or not used & ON_PYPI_ALONE, module


def test_no_test_reaches_into_private_names():
    # As attributes, imported, or as words handed to `setattr`. os._exit is the library's word for
    # an end at once; what the node takes from inside of rclpy has tests of its own.
    reaching = re.compile(r"""(?<!\bself)(?<!\bcls)\._(?!_|exit\b|rclpy)[A-Za-z]\w*
                              |\bimport\ (?:\([^)]*|.*)\b_[A-Za-z]\w*
                              |attr\([^()]*['.]_[A-Za-z]\w*""", re.VERBOSE)
    assert not [(path, found) for path in (PACKAGE.parent / 'test').rglob('*.py')
                for found in reaching.findall(path.read_text())]


def test_tests_mirror_the_package_and_no_module_is_named_after_nothing():
    assert not {path.stem for path in PACKAGE.rglob('*.py')} & {
        'utils', 'util', 'helpers', 'helper', 'common', 'misc', 'tools'}
    tests = PACKAGE.parent / 'test'
    folders = {path.name for path in PACKAGE.iterdir() if any(path.glob('*.py'))}
    assert {path.name for path in tests.iterdir() if any(path.glob('test_*.py'))} >= folders
