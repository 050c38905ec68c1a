# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The demonstration, with minutes of simulated time in place of hours."""

import os
from pathlib import Path
import signal
import subprocess
import sys

from imu_allan.cli.main import main
from processes import living, marked, wait_until
import pytest
from whole_lines import Varying

pytest.importorskip('rosbags', reason='the demo records: needs rosbags, which rosdep does not '
                                      'install: pip install rosbags')

ROOT = Path(__file__).parents[1]
DEMO = ROOT / 'demo' / 'run_demo.py'
FILES = {'report.html', 'allan_deviation.png', 'imu.yaml', 'result.json', 'curve.csv'}


def test_node_and_recording_show_the_same_numbers_and_every_file_is_there(tmp_path):
    pytest.importorskip('rclpy')
    output = tmp_path / 'demo output'
    with subprocess.Popen([sys.executable, str(DEMO), '--hours', '0.05', '--output', str(output)],
                          stdout=subprocess.PIPE, text=True, env=marked(tmp_path)) as process:
        shown = process.stdout.read()
    assert process.returncode == 0, shown
    assert Varying('The same numbers: node and recording differ by at most <number> (relative, '
                   '<number> numbers from 18,000 and 18,000 samples).') in shown.splitlines()
    assert '(true 0.48 deg/sqrt(h))' in shown
    assert {path.name for path in output.iterdir()} == FILES | {'recording', 'live'}
    assert any((output / 'recording').glob('*.mcap'))
    assert living(tmp_path) == []
    # Simulated time as fast as it goes is no fault of a clock.
    assert 'speed of clocks' not in shown + (output / 'live' / 'imu_allan_node.log').read_text()


def test_ctrl_c_ends_every_process_of_the_demo(tmp_path):
    pytest.importorskip('rclpy')
    with subprocess.Popen([sys.executable, str(DEMO), '--output', str(tmp_path / 'demo')],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          start_new_session=True, env=marked(tmp_path)) as process:
        while 'times real time' not in (line := process.stdout.readline()):
            assert line, 'the demo ended by itself'
        os.killpg(process.pid, signal.SIGINT)
        _, complaints = process.communicate(timeout=60)
    assert process.returncode == 130
    assert 'Traceback' not in complaints
    wait_until(lambda: not living(tmp_path), 10)
    assert not (tmp_path / 'demo' / 'recording').exists()


def test_recording_of_the_user_is_analyzed_instead(tmp_path):
    bag, output = tmp_path / 'my bag', tmp_path / 'out'
    assert main(['simulate', str(ROOT / 'config' / 'tactical_mems.yaml'), '--duration', '1min',
                 '--output', str(bag)]) == 0
    done = subprocess.run(['make', '--silent', '-C', str(ROOT), 'demo', f'RECORDING={bag}',
                           f'RUN={Path(sys.executable).parent}', f'DEMO_OUTPUT={output}',
                           'STAMP='], check=True, capture_output=True, text=True)
    assert '6,000 samples at 100 Hz, 60 s' in done.stdout.splitlines()
    assert {path.name for path in output.iterdir()} == FILES
