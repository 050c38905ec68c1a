# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Every command and Python block that README and the pages by task print is executed."""

from importlib import import_module
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys

from browser import needs_browser
from imu_allan import datasheet
from imu_allan.cli.main import main
import numpy as np
from processes import python
import pytest
from test_packaging import cloned, SOURCES

ROOT = Path(__file__).parents[1]
# Where `ros2 run` looks: pip installs beside the interpreter, colcon below its prefix.
PATH = os.pathsep.join([
    str(Path(sys.executable).parent), *(f'{prefix}/lib/imu_allan' for prefix in os.environ.get(
        'AMENT_PREFIX_PATH', '').split(os.pathsep)), os.environ['PATH']])

WORKSPACE = 'test_workspace_is_built_as_printed_and_its_node_starts'
TESTED_ELSEWHERE = {
    'mkdir -p ~/ws/src && cp -r . ~/ws/src/imu_allan && cd ~/ws': WORKSPACE,
    'source /opt/ros/jazzy/setup.bash': 'a ROS installation',
    'rosdep install --from-paths src --ignore-src -y': 'package.xml',
    'colcon build --packages-select imu_allan': WORKSPACE,
    'source install/setup.bash': WORKSPACE,
    'ros2 launch imu_allan imu_allan.launch.py imu_topic:=/imu/data_raw': 'launch',
    'ros2 topic echo /imu_allan/coefficients': 'test/node',
    'ros2 service call /imu_allan/save std_srvs/srv/Trigger': 'test/node',
    'pip install .': 'test_packaging.py',
    "pip install '.[ros]'": 'the environment of this test',
    'pip install --user --break-system-packages rosbags mcap lz4 zstandard':
        'the environment of this test',
}
"""What needs ROS or the network, and where it is tested as far as it can be without."""

PAGES = ('README.md', 'docs/recipes.md', *(
    f'docs/{path.name}' for path in sorted(ROOT.glob('docs/task_*.md'))))
"""Pages whose commands a reader types one after the other."""


def blocks(page, language):
    return re.findall(rf'^```{language}\n(.*?)^```', (ROOT / page).read_text(),
                      re.MULTILINE | re.DOTALL)


def commands(page):
    """Give the commands of all blocks of a page, those over several lines in one."""
    lines = [re.sub(r'\s{2,}#.*', '', line).strip() for block in blocks(page, 'bash')
             for line in re.sub(r'\\\n\s*', '', block).splitlines()]
    return [line for line in lines if line]


@pytest.fixture(scope='module')
def workplace(tmp_path_factory):
    """Make a folder with the files that the pages take for granted."""
    # What `simulate` writes with: without it every test that wants this folder skips.
    for needed in ('mcap', 'rosbags'):
        import_module(needed)
    folder = tmp_path_factory.mktemp('reader')
    shutil.copytree(ROOT / 'config', folder / 'config')
    shutil.copy(ROOT / 'config' / 'consumer_mems.yaml', folder / 'consumer.yaml')
    (folder / 'datasheet.yaml').write_text(
        'name: My IMU\n'
        'gyro: {noise_density: 0.03 deg/s/sqrt(Hz), bias_instability: 18 deg/h}\n'
        'accel: {noise_density: 300 ug/sqrt(Hz)}\n')
    run = ['simulate', str(folder / 'consumer.yaml'), '--duration', '5min']
    assert main([*run, '--output', str(folder / 'imu_at_rest')]) == 0
    for number, name in (('1', 'before'), ('2', 'after')):
        recording = str(folder / 'recordings' / f'imu_{number}')
        assert main([*run, '--seed', number, '--duration', '2min', '--output', recording]) == 0
        assert main(['analyze', recording, '--json', str(folder / f'{name}.json')]) == 0
    # Commands of the pages make them; each can be tested alone.
    for made in ('characterization', 'results'):
        (folder / made).mkdir()
        shutil.copy(folder / 'before.json', folder / made / 'result.json')
    shutil.copytree(folder / 'imu_at_rest', folder / 'simulated')
    noise = np.random.default_rng(1).normal([0.1, 1.0], [0.05, 0.001], (20_000, 2))
    rows = ['gyro_x [deg/s],accel_z [g]', *(f'{gyro:.6f},{accel:.6f}' for gyro, accel in noise)]
    (folder / 'samples.csv').write_text('\n'.join(rows) + '\n')
    return folder


# One that several pages print is executed where it is printed first.
@pytest.mark.parametrize('command', dict.fromkeys(
    line for page in PAGES for line in commands(page) if line.startswith('imu_allan ')))
def test_command_of_the_tool_runs_as_printed(command, workplace, monkeypatch, capsys):
    output = re.search(r'simulate .*--output (\w+)', command)
    if output:
        shutil.rmtree(workplace / output[1], ignore_errors=True)
    # Of the shortened recording check cannot tell everything.
    well = (0, 4) if ' check ' in command else (0,)
    # Fewer looks, and a minute where a page takes hours: the options are the same.
    monkeypatch.setattr(datasheet, 'GROWTH', 2)
    shortened = re.sub(r'--duration \w+', '--duration 1min', command)
    if not set(command) & set('|&;<>*?$~'):
        # What needs no shell needs no process, whose start is half of the time.
        monkeypatch.chdir(workplace)
        status = main(shlex.split(shortened)[1:])
        assert (status in well, capsys.readouterr().err) == (True, '')
        return
    done = subprocess.run(
        ['bash', '-c', shortened], cwd=workplace, check=False, capture_output=True, text=True,
        env=os.environ | {'PATH': PATH})
    assert done.returncode in well, done.stderr
    assert done.stderr == ''


@pytest.mark.parametrize('block', [block for page in PAGES for block in blocks(page, 'python')])
def test_python_of_the_pages_runs(block, workplace, monkeypatch):
    import imu_allan
    monkeypatch.chdir(workplace)
    samples = imu_allan.simulate({'noise_density': 1e-3}, 20_000, 200.0, 1)
    exec(compile(block, 'page', 'exec'), {'samples': samples})


def said_until_ctrl_c(script, folder, home):
    """Run a script that ends as a node, which is interrupted when it is up; give what it says."""
    with subprocess.Popen(
            ['bash', '-c', script], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, env=os.environ | {
                'HOME': str(home), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF',
                'ROS_LOG_DIR': str(home), 'PATH': PATH}) as process:
        said = ''
        for line in process.stdout:
            said += line
            if '[INFO]' in line:
                process.send_signal(signal.SIGINT)
                break
        said += process.stdout.read()
    assert '[INFO]' in said
    assert process.returncode == 0, said
    return said


@pytest.mark.parametrize('command', [
    line for line in commands('README.md')
    if line.startswith(('ros2 run ', 'imu_allan_node', 'imu_simulator'))])
def test_node_starts_as_printed_and_ends_with_ctrl_c(command, tmp_path):
    pytest.importorskip('rclpy')
    program = command.removeprefix('ros2 run imu_allan ')
    said_until_ctrl_c(f'exec {program}', tmp_path, tmp_path)


def test_workspace_is_built_as_printed_and_its_node_starts(tmp_path):
    pytest.importorskip('rclpy')
    pytest.importorskip('colcon_ros')
    printed = [command for command in commands('README.md')
               if TESTED_ELSEWHERE.get(command) == WORKSPACE]
    node = 'install/imu_allan/lib/imu_allan/imu_allan_node'
    said = said_until_ctrl_c('\n'.join(['set -e', *printed, f'exec {node}']),
                             cloned(tmp_path / 'clone'), tmp_path)
    assert 'Finished <<< imu_allan' in said
    assert (tmp_path / 'ws' / node).is_file()


@pytest.mark.parametrize('page', [*PAGES, 'docs/ros_interface.md'])
def test_commands_are_seen_whole_on_a_screen(page):
    lines = [line for block in blocks(page, 'bash') for line in block.splitlines()]
    assert [line for line in lines if len(line) > 99] == []


@pytest.mark.parametrize('page', [*PAGES, 'CONTRIBUTING.md'])
def test_every_other_command_is_a_target_of_make_or_one_whose_test_is_known(page):
    targets = re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    for command in (*commands(page), *re.findall(r'`(make [^`]*)`', (ROOT / page).read_text())):
        if command.startswith('make '):
            assert command.split()[1] in targets, command
        else:
            assert (command in TESTED_ELSEWHERE or command.startswith(
                ('imu_allan ', 'ros2 run ', 'imu_allan_node ', 'imu_simulator'))), command


@pytest.mark.parametrize('page', ['README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md',
                                  *(f'docs/{path.name}' for path in ROOT.glob('docs/*.md'))])
def test_links_pictures_and_files_that_are_named_are_there(page):
    text = (ROOT / page).read_text()
    for target in re.findall(r'\]\(([^)\s]+)\)', text):
        if not target.startswith(('http', '#')):
            assert (ROOT / page).parent.joinpath(target.partition('#')[0]).exists(), target
    for name in re.findall(r'`((?:imu_allan|test|bench|docs|config)/[\w/.]+)`', text):
        assert (ROOT / name).exists(), name
    # The last two are of other packages.
    files = [f'/{path}' for path in (*SOURCES, 'setup.py', 'imu.py', 'ConfigReader.py')]
    for name in re.findall(r'[\w/.]+\.py\b', text):
        assert any(file.endswith(f'/{name.lstrip("./")}') for file in files), name


def made_by(program):
    """Return what a program prints that imports the makers of pages."""
    return python('-c', program, check=True, cwd=ROOT / 'docs').stdout


@pytest.mark.parametrize('page', ['commands', 'findings'])
def test_a_page_is_what_the_parsers_or_the_table_of_findings_say(page):
    shown = made_by(f'import make_{page} as made; print(made.page(), end="")')
    assert (ROOT / 'docs' / f'{page}.md').read_text() == shown


def test_the_first_minutes_show_the_commands_of_their_script(workplace, monkeypatch):
    monkeypatch.chdir(workplace)
    steps = made_by('import make_first_minutes as made\n'
                    'for _, *commands in made.STEPS: print(*commands, sep="\\n")').splitlines()
    page = (ROOT / 'docs' / 'first_minutes.md').read_text()
    assert re.findall(r'^\$ (.*)$', page, re.MULTILINE) == steps
    # Not 2: a page that was made before an option was renamed shows one that is gone.
    for command in steps:
        if command.startswith('imu_allan ') and 'simulate' not in command:
            assert main(shlex.split(command.partition(' | ')[0])[1:]) in (0, 1, 4), command


@pytest.fixture(scope='module')
def pages(tmp_path_factory):
    """Build the documentation as HTML; a warning is an error."""
    for module in ('sphinx', 'myst_parser', 'furo', 'sphinx-mathjax-offline'):
        pytest.importorskip(module)
    folder = tmp_path_factory.mktemp('pages')
    python('-m', 'sphinx', '--fail-on-warning', '--keep-going', '-n', '-q', '-d',
           folder / 'doctrees', ROOT / 'docs', folder / 'html', check=True)
    return folder / 'html'


def test_what_draws_the_formulas_lies_beside_the_pages(pages):
    page = (pages / 'statistics.html').read_text()
    [drawn_by] = re.findall(r'src="(_static/mathjax/[\w-]+\.js)"', page)
    assert (pages / drawn_by).is_file()
    assert not re.findall(r'<(?:script|link)[^>]*(?:src|href)="https?:', page)


@needs_browser
def test_every_equation_is_drawn_and_seen_whole_on_a_screen(pages, browser):
    browser.show(pages / 'statistics.html', width=1400)
    browser.cdp('Runtime.evaluate', expression='MathJax.startup.promise', awaitPromise=True)
    assert browser.run('return document.querySelectorAll("div.math mjx-container").length') > 9
    assert browser.run('return [...document.querySelectorAll("mjx-merror, div.math")].filter('
                       'item => item.tagName !== "DIV" || item.scrollWidth > item.clientWidth)'
                       '.map(item => item.textContent)') == []
