# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The layout: every floor imports only what lies below it."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path
import sys

import pytest

PACKAGE = Path(__file__).parents[1] / 'imu_allan'
MODULES = {'.'.join(('imu_allan', *path.relative_to(PACKAGE).with_suffix('').parts)): path
           for path in PACKAGE.rglob('*.py')}

ANY_FLOOR = {'imu_allan', 'imu_allan.version', 'imu_allan.errors', 'imu_allan.isolated',
             'imu_allan.result', 'imu_allan.block', 'imu_allan.wording'}
FLOORS = (
    ('imu_allan.noise', 'imu_allan.cdr'),
    ('imu_allan.timeline', 'imu_allan.sensor'),
    ('imu_allan.characterization', 'imu_allan.tuning', 'imu_allan.fleet'),
    ('imu_allan.writers', 'imu_allan.recordings'),
    ('imu_allan.analysis',),
    ('imu_allan.node', 'imu_allan.cli'),
)
ROS = {'rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'geometry_msgs', 'diagnostic_msgs',
       'builtin_interfaces', 'rcl_interfaces', 'rosgraph_msgs', 'ament_index_python'}


def imported(path: Path) -> set[str]:
    """Give the full names of the modules that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: relative import'
            assert node.module is not None
            parts = {f'{node.module}.{alias.name}' for alias in node.names
                     if f'{node.module}.{alias.name}' in MODULES}
            found |= parts
            if len(parts) < len(node.names):
                found.add(node.module)
    return found


def floor(module: str) -> int:
    for number, parts in enumerate(FLOORS):
        if any(module == part or module.startswith(f'{part}.') for part in parts):
            return number
    return -1


@pytest.mark.parametrize('module', sorted(MODULES))
def test_a_module_imports_nothing_from_a_floor_above(module: str) -> None:
    if module in ('imu_allan.__init__', 'imu_allan.__main__'):
        pytest.skip('the public names lead everywhere')
    own = floor(module)
    assert own >= 0 or module in ANY_FLOOR
    above = {name for name in imported(MODULES[module]) if floor(name) > own}
    assert not above


def test_no_circle_of_imports() -> None:
    needs = {module.removesuffix('.__init__'): imported(path) for module, path in MODULES.items()
             if module not in ('imu_allan.__init__', 'imu_allan.__main__')}
    # Raises CycleError, which names the modules of the circle.
    TopologicalSorter(needs).prepare()


@pytest.mark.parametrize('module', sorted(MODULES))
def test_only_the_node_imports_ros(module: str) -> None:
    if not module.startswith('imu_allan.node'):
        names = {name.partition('.')[0] for name in imported(MODULES[module])}
        assert not names & ROS


@pytest.mark.parametrize('module', sorted(name for name in MODULES if '.noise.' in name))
def test_numerics_need_numpy_and_scipy_alone(module: str) -> None:
    allowed = {'imu_allan', 'numpy', 'scipy', *sys.stdlib_module_names}
    assert {name.partition('.')[0] for name in imported(MODULES[module])} <= allowed


def test_no_module_is_named_after_nothing() -> None:
    assert not {path.stem for path in PACKAGE.rglob('*.py')} & {
        'utils', 'util', 'helpers', 'helper', 'common', 'misc', 'tools'}


def test_tests_mirror_the_package() -> None:
    tests = PACKAGE.parent / 'test'
    folders = {path.name for path in PACKAGE.iterdir() if any(path.glob('*.py'))}
    assert {path.name for path in tests.iterdir() if any(path.glob('test_*.py'))} >= folders
