# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that are started: when they end, and that nothing in the current folder runs."""

import os
import signal
import subprocess
import sys

from processes import living, marked, python, wait_until
import pytest

STARTS = """
import time
from imu_allan.isolated_process import start_python
# What it calls reads no pipe and looks after nothing.
child = start_python('signal', 'pause')
print('ready', flush=True)
time.sleep(100)
"""


@pytest.mark.skipif(sys.platform != 'linux', reason='the kernel of Linux does it')
@pytest.mark.usefixtures('children_unmeasured')
def test_a_process_ends_with_its_parent_whatever_it_is_at(tmp_path):
    with subprocess.Popen([sys.executable, '-c', STARTS], stdout=subprocess.PIPE, text=True,
                          env=marked(tmp_path)) as parent:
        parent.stdout.readline()
        # The kernel shows the mark of a process once it has begun its program.
        wait_until(lambda: len(living(tmp_path)) == 2, 20)
        parent.kill()
    try:
        wait_until(lambda: not living(tmp_path), 20)
    finally:
        for child in living(tmp_path):
            os.kill(child, signal.SIGKILL)


PLANTED = ('pickle', 'struct', 'numpy', 'multiprocessing', 'imu_allan', 'matplotlib', 'argparse',
           'signal', 'subprocess', 'typing', 'threading', 'sqlite3', 'yaml', 'mcap', 'zstandard',
           'sitecustomize', 'usercustomize', 'encodings', 'distributed',
           'jinja2')
# As an installation leaves it, a script in a folder of its own; it reads all by other processes.
SCRIPT = """
import shlex, sys
from imu_allan.cli.main import main
from imu_allan.recordings import reading
reading.WORTHWHILE_BYTES *= 0
sys.exit(max(main(shlex.split(line)) for line in sys.argv[1:]))
"""


def test_no_verb_imports_or_obeys_what_lies_in_the_current_folder(tmp_path, short_recording):
    # Every module that might be imported from here leaves a trace.
    downloaded, trace = tmp_path / 'downloaded', tmp_path / 'ran'
    downloaded.mkdir()
    for name in PLANTED:
        (downloaded / f'{name}.py').write_text(
            f'open({str(trace)!r}, "a").write("{name}\\n")\nraise SystemExit(99)\n')
    (downloaded / 'm.yaml').write_text('gyro: {noise_density: 0.3 deg/sqrt(h)}\n')
    script = tmp_path / 'bin' / 'imu_allan'
    script.parent.mkdir()
    script.write_text(SCRIPT)
    done = python(
        script, f'info {short_recording}',
        f'analyze {short_recording} --json r.json --output out',
        'simulate m.yaml --duration 30s --output simulated', 'export r.json --for kalibr',
        'report r.json --output report', 'check r.json --spec m.yaml --allow-undecided',
        f'analyze {short_recording} simulated --jobs 2', cwd=downloaded)
    assert not trace.exists(), trace.read_text()
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.count(': Gyroscope: use with care: 30 s at rest.') == 2
