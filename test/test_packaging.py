# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a ROS distribution, colcon, pip and a lawyer look at."""

from importlib import import_module
from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import imu_allan
import pytest
from sources import libraries, ON_PYPI_ALONE
from whole_lines import Varying

ROOT = Path(__file__).parents[1]
PACKAGE_XML = ElementTree.parse(ROOT / 'package.xml').getroot()
SETUP = (ROOT / 'setup.py').read_text()
SOURCES = sorted(path for folder in ('imu_allan', 'test', 'launch', 'demo', 'bench', 'docs',
                                     'examples')
                 for path in (ROOT / folder).rglob('*.py') if '_build' not in path.parts)


def dependencies(*kinds):
    return {element.text or '' for kind in kinds for element in PACKAGE_XML.findall(kind)}


def test_package_xml_is_format_3_of_an_ament_python_package_in_the_order_of_the_schema():
    assert PACKAGE_XML.get('format') == '3'
    order = ['name', 'version', 'description', 'maintainer', 'license', 'url', 'author']
    present = [element.tag for element in PACKAGE_XML if element.tag in order]
    assert present == sorted(present, key=order.index)
    assert PACKAGE_XML.findtext('name') == 'imu_allan'
    assert PACKAGE_XML.findtext('export/build_type') == 'ament_python'
    assert re.fullmatch(r'[\w.-]+@[\w-]+(\.[\w-]+)+', PACKAGE_XML.find('maintainer').get('email'))


def test_version_maintainer_and_licence_are_the_same_everywhere(output_of):
    version = PACKAGE_XML.findtext('version')
    assert output_of('--version') == f'imu_allan {imu_allan.__version__}\n'
    assert imu_allan.__version__ == version
    assert f"version='{version}'" in SETUP or 'version=__version__' in SETUP
    assert f"release = '{version}'" in (ROOT / 'docs' / 'conf.py').read_text()
    assert f'\nversion: {version}\n' in (ROOT / 'CITATION.cff').read_text()
    assert f"maintainer='{PACKAGE_XML.findtext('maintainer')}'" in SETUP
    licence = PACKAGE_XML.find('license')
    assert f"license='{licence.text}'" in SETUP
    assert 'Apache License' in (ROOT / licence.get('file')).read_text()


def test_what_is_imported_is_declared_and_no_ros_package_for_nothing():
    declared = {re.split(r'[<>=\[]', name)[0].lower()
                for name in re.findall(r"'([\w.\[\]-]+(?:[<>=]+[\w.]+)?)(?:; .*)?',?", SETUP)}
    needed = dependencies('exec_depend')
    used = {name for folder in ('imu_allan', 'launch')
            for path in (ROOT / folder).rglob('*.py') for name in libraries(path)}
    # The last two are part of every installation of rclpy.
    others = used - {'imu_allan', *sys.stdlib_module_names, *needed, 'ament_index_python',
                     'rpyutils'}
    assert {name.lower().replace('yaml', 'pyyaml') for name in others} <= declared
    assert {name for name in needed if not name.startswith('python3-')} <= used


@pytest.mark.parametrize('name', sorted(path.stem for path in ROOT.glob('bench/*.py')))
def test_a_benchmark_whose_figures_a_page_shows_finds_every_name_that_it_imports(name):
    import_module(name)


def test_every_source_file_begins_with_copyright_and_licence():
    begin = '# Copyright 2026 The imu_allan authors\n# SPDX-License-Identifier: Apache-2.0\n'
    assert len(SOURCES) > 200
    assert not [path for path in SOURCES if not re.match(
        rf'(#!.*\n)?{re.escape(begin)}', path.read_text())]


@pytest.mark.parametrize('package', ['cli', 'node'])
def test_the_programs_keep_numpy_to_one_thread_unless_asked_otherwise(package):
    program = (f'import imu_allan.{package}, os, sys; '
               'print(os.environ.get("OPENBLAS_NUM_THREADS"), "numpy" in sys.modules)')
    plain = {name: value for name, value in os.environ.items()
             if name not in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS')}
    for asked, shown in (({}, '1'), ({'OPENBLAS_NUM_THREADS': '3'}, '3'),
                         ({'OMP_NUM_THREADS': '2'}, 'None')):
        assert subprocess.check_output([sys.executable, '-c', program], env=plain | asked,
                                       text=True) == f'{shown} False\n'


def fresh_environment():
    """Give the environment without what the ROS wheels leave in it for this interpreter alone."""
    return {key: value for key, value in os.environ.items()
            if key not in ('LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'PYTHONPATH')}


def environment(path, *packages):
    """Make a virtual environment with `packages`; return its folder of programs."""
    subprocess.run([sys.executable, '-m', 'venv', str(path)], check=True, env=fresh_environment())
    subprocess.run([str(path / 'bin' / 'python'), '-m', 'pip', 'install', '--quiet', *packages],
                   check=True, env=fresh_environment())
    return path / 'bin'


REFUSES = f"""
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {set(ON_PYPI_ALONE)}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Refuse())
"""


@pytest.mark.thorough
def test_a_workspace_that_rosdep_filled_collects_every_test_and_says_what_it_skips(tmp_path):
    (tmp_path / 'sitecustomize.py').write_text(REFUSES)
    node = ['test/node/test_interface.py'] if find_spec('rclpy') else []
    some = ['test/test_cdr.py', 'test/cli/test_recordings.py',
            'test/noise/test_allan_deviation.py', *node]
    for chosen in (['--collect-only'], some):
        done = subprocess.run(
            # As colcon has failures printed: in short.
            [sys.executable, '-m', 'pytest', '-q', '--tb=short', '-p', 'no:cacheprovider',
             *chosen], cwd=ROOT, env=fresh_environment() | {'PYTHONPATH': str(tmp_path)},
            check=False, capture_output=True, text=True)
        said = (done.stdout + done.stderr).splitlines()
        assert done.returncode == 0, said[-20:]
        assert [line for line in said if line.startswith('ERROR')] == []
    skipped = [line for line in said if line.startswith('SKIPPED')]
    assert skipped
    assert all(re.search(rf'needs ({"|".join(ON_PYPI_ALONE)}), which rosdep does not install: '
                         r'pip install \1$', line) for line in skipped), skipped


def cloned(folder):
    """Copy the checkout without what was made in it."""
    return shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(
        '.*', 'build', 'install', 'log', 'mutants', '*.egg-info', '_build', '__pycache__'))


@pytest.fixture(scope='module')
def distributions(tmp_path_factory):
    """Build sdist and wheel as they would be uploaded, and check what a package page shows."""
    folder = tmp_path_factory.mktemp('distributions')
    programs = environment(folder / 'venv', 'build', 'twine')
    subprocess.run([str(programs / 'python'), '-m', 'build', '--outdir', str(folder / 'dist'),
                    cloned(folder / 'clone')], check=True, env=fresh_environment())
    [sdist], [wheel] = (list((folder / 'dist').glob(kind)) for kind in ('*.tar.gz', '*.whl'))
    subprocess.run([str(programs / 'python'), '-m', 'twine', 'check', '--strict', str(sdist),
                    str(wheel)], check=True, env=fresh_environment())
    return {'sdist': sdist, 'wheel': wheel, 'checkout': ROOT}


@pytest.mark.slow
@pytest.mark.parametrize('source', ['sdist', 'wheel', 'checkout'])
def test_pip_installs_the_offline_tool_without_ros(tmp_path, distributions, source):
    programs = environment(tmp_path / 'venv', str(distributions[source]))
    [typed] = tmp_path.glob('venv/lib/*/site-packages/imu_allan/py.typed')
    assert typed.is_file()
    shared = tmp_path / 'venv' / 'share' / 'imu_allan'
    assert (shared / 'package.xml').is_file()
    model = shared / 'config' / 'consumer_mems.yaml'
    for command in (['simulate', 'consumer_mems', '--duration', '60', '--output', 'recording'],
                    ['info', 'recording'],
                    ['analyze', 'recording', '--output', 'out'],
                    ['export', 'out/result.json', '--for', 'kalibr'],
                    ['check', 'out/result.json', '--spec', str(model)],
                    ['report', 'out/result.json', '--output', 'report']):
        done = subprocess.run([str(programs / 'imu_allan'), *command], cwd=tmp_path, check=False,
                              capture_output=True, text=True, env=fresh_environment())
        assert done.returncode in ((0, 3, 4) if command[0] == 'check' else (0,)), done.stderr
    node = subprocess.run([str(programs / 'imu_allan_node')], cwd=tmp_path, check=False,
                          capture_output=True, text=True, env=fresh_environment())
    assert node.returncode == 1
    assert node.stderr == Varying(
        'imu_allan_node: needs ROS 2, which <words> cannot import (<words>); source a ROS 2 '
        'installation (source /opt/ros/jazzy/setup.bash) or install the wheels: pip install '
        "'imu_allan[ros]'\n")


ROSDEP = ('numpy', 'scipy', 'matplotlib', 'PyYAML', 'jinja2', 'rich', 'pytest', 'hypothesis',
          *(f'{pinned}; python_version < "3.13"' for pinned in (
              'PyYAML==6.0.1', 'Jinja2==3.1.2', 'rich==13.7.1', 'pytest==7.4.4',
              'hypothesis==6.98.15')),
          'ros-jazzy-rclpy[fastrtps]', *(
              f'ros-jazzy-{name}-msgs'
              for name in ('sensor', 'diagnostic', 'geometry', 'std', 'rosgraph')),
          'ros-jazzy-std-srvs')
"""What package.xml names, as wheels, in the versions of Ubuntu 24.04."""


@pytest.mark.slow
def test_colcon_builds_and_tests_with_what_package_xml_names(tmp_path):
    programs = environment(tmp_path / 'venv', 'colcon-common-extensions', *ROSDEP,
                           '--constraint', str(ROOT / '.ci' / 'jazzy-constraints.txt'))
    path = {'PATH': f'{programs}{os.pathsep}{os.environ["PATH"]}'}
    for arguments in (['build'], ['test', '--return-code-on-test-failure', '--event-handlers',
                                  'console_direct+']):
        subprocess.run([str(programs / 'colcon'), *arguments, '--base-paths', str(ROOT)],
                       cwd=tmp_path, check=True, env=fresh_environment() | path)
    installed = tmp_path / 'install' / 'imu_allan'
    assert {path.name for path in (installed / 'lib' / 'imu_allan').iterdir()} >= {
        'imu_allan', 'imu_allan_node', 'imu_simulator'}
    shared = installed / 'share'
    assert (shared / 'ament_index/resource_index/packages/imu_allan').is_file()
    for folder in ('config', 'launch'):
        assert ({path.name for path in (shared / 'imu_allan' / folder).iterdir()}
                == {path.name for path in (ROOT / folder).iterdir() if path.is_file()})
