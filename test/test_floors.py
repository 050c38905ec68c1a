# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The layout: every floor imports only what lies below it."""

import ast
from graphlib import TopologicalSorter
import re
import subprocess
import sys

import pytest
from sources import imported, libraries, MODULES, PACKAGE, tree_of

FLOORS = (
    ('imu_allan.version', 'imu_allan.errors', 'imu_allan.isolated_process',
     'imu_allan.blas_threads', 'imu_allan.quick_start', 'imu_allan.json_of_dataclasses',
     'imu_allan.finding', 'imu_allan.result', 'imu_allan.verdict', 'imu_allan.state',
     'imu_allan.block', 'imu_allan.wording', 'imu_allan.interruption', 'imu_allan.arguments'),
    ('imu_allan.noise', 'imu_allan.cdr'),
    ('imu_allan.timeline', 'imu_allan.sensor'),
    ('imu_allan.characterization', 'imu_allan.tuning', 'imu_allan.fleet'),
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


def test_only_the_node_imports_ros_and_numerics_need_numpy_and_scipy_alone():
    allowed = {'imu_allan', 'numpy', 'scipy', *sys.stdlib_module_names}
    for module, path in MODULES.items():
        assert module.startswith('imu_allan.node') or not libraries(path) & ROS, module
        assert '.noise.' not in module or not libraries(path) - allowed, module


WITHOUT_SCIPY = """
import sys
from imu_allan.cli.main import main
status = main(sys.argv[1:])
print([name for name in sys.modules if name == 'scipy'], file=sys.stderr)
sys.exit(status)
"""


def test_a_verb_that_estimates_nothing_does_not_wait_for_scipy(short_recording):
    for words in (['explain'], ['info', short_recording]):
        done = subprocess.run([sys.executable, '-c', WITHOUT_SCIPY, *words],
                              capture_output=True, text=True, check=True)
        assert done.stderr == '[]\n'


def private(tree):
    """Names of others that begin with an underscore, also as words handed to `setattr`."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute) and not (
                isinstance(node.value, ast.Name) and node.value.id in ('self', 'cls')):
            found.append(node.attr)
        elif isinstance(node, ast.Call) and (
                getattr(node.func, 'attr', None) or getattr(node.func, 'id', '')).endswith('attr'):
            found += [word.value.rpartition('.')[2] for word in node.args
                      if isinstance(word, ast.Constant) and isinstance(word.value, str)]
    return [name for name in found if name.startswith('_') and not name.startswith('__')]


def test_no_test_reaches_into_private_names():
    # os._exit is the library's word for an end at once.
    found = {path: private(tree_of(path)) for path in (PACKAGE.parent / 'test').rglob('*.py')}
    assert not {path: names for path, names in found.items() if set(names) - {'_exit'}}


def test_tests_mirror_the_package_and_no_module_is_named_after_nothing():
    assert not {path.stem for path in PACKAGE.rglob('*.py')} & {
        'utils', 'util', 'helpers', 'helper', 'common', 'misc', 'tools'}
    tests = PACKAGE.parent / 'test'
    folders = {path.name for path in PACKAGE.iterdir() if any(path.glob('*.py'))}
    assert {path.name for path in tests.iterdir() if any(path.glob('test_*.py'))} >= folders


@pytest.mark.parametrize('page', ['CONTRIBUTING.md', 'docs/how_it_works.md'])
def test_modules_that_a_page_names_are_there(page):
    root = PACKAGE.parent
    files = [path.relative_to(root).as_posix() for folder in (PACKAGE, root / 'test',
                                                              root / 'bench', root / 'docs')
             for path in folder.rglob('*.py')]
    named = set(re.findall(r'[\w/]+\.py\b', (root / page).read_text()))
    assert len(named) > 10
    assert not {name for name in named
                if not any(f'/{file}'.endswith(f'/{name.lstrip("/")}') for file in files)}
