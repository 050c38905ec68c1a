# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The node runs nothing that lies in the folder it was started from."""

import signal
import subprocess
import sys

from processes import wait_until
import pytest

PLANTED = ('rclpy', 'sensor_msgs', 'numpy', 'scipy', 'pickle', 'struct', 'argparse', 'imu_allan',
           'matplotlib', 'multiprocessing', 'yaml', 'sitecustomize')


@pytest.mark.usefixtures('ros_context')
def test_the_node_imports_nothing_from_the_current_folder(tmp_path):
    current, trace, script = tmp_path / 'current', tmp_path / 'ran', tmp_path / 'bin' / 'node'
    current.mkdir()
    for name in PLANTED:
        (current / f'{name}.py').write_text(
            f'open({str(trace)!r}, "a").write("{name}\\n")\nraise SystemExit(99)\n')
    script.parent.mkdir()
    script.write_text('import sys\nfrom imu_allan.node.imu_allan_node import main\n'
                      'sys.exit(main())\n')
    with subprocess.Popen(
            [sys.executable, str(script), '--ros-args', '-p', 'topic:=/planted/imu',
             '-p', f'state_file:={tmp_path / "state"}'],
            cwd=current, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        wait_until(lambda: (tmp_path / 'state.lock').exists() or process.poll() is not None, 300)
        process.send_signal(signal.SIGINT)
        shown = process.communicate(timeout=300)[0]
    assert not trace.exists(), trace.read_text()
    assert 'Traceback' not in shown
