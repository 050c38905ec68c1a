# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Nothing that lies in the current folder runs: it may be a recording that somebody else made."""

import os
import subprocess
import sys

from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
import pytest

MODEL = 'gyro: {noise_density: 0.3 deg/sqrt(h)}\n'
PLANTED = ('pickle', 'struct', 'numpy', 'multiprocessing', 'imu_allan', 'matplotlib', 'argparse',
           'signal', 'subprocess', 'typing', 'threading', 'sqlite3', 'yaml', 'mcap', 'zstandard',
           'sitecustomize', 'usercustomize', 'encodings', 'distributed',
           'jinja2')
LARGE = 220_000
"""Messages of a recording that is larger than 64 MB, which is read by a process of its own."""


@pytest.fixture(scope='module')
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp('recordings')
    for name, count in (('large', LARGE), ('small', 3000), ('other', 3000)):
        write_recording(folder / name, simulated_blocks(
            parse_model(MODEL), 100.0, count, start_ns=10**18), compression='')
    return folder


@pytest.fixture
def downloaded(tmp_path):
    """Return a folder in which every module that might be imported from it leaves a trace."""
    folder = tmp_path / 'downloaded'
    folder.mkdir()
    trace = tmp_path / 'ran'
    for name in PLANTED:
        (folder / f'{name}.py').write_text(
            f'open({str(trace)!r}, "a").write("{name}\\n")\nraise SystemExit(99)\n')
    # A pipe that nobody writes to, instead of a file, would keep matplotlib waiting for ever.
    os.mkfifo(folder / 'matplotlibrc')
    return folder


def test_no_verb_imports_or_obeys_what_lies_in_the_current_folder(
        recordings, downloaded, tmp_path):
    result, model = downloaded / 'r.json', downloaded / 'm.yaml'
    model.write_text(MODEL)
    size = sum(file.stat().st_size for file in (recordings / 'large').iterdir())
    assert size > 1 << 26
    # As an installation leaves it: a script in a folder of its own.
    script = tmp_path / 'bin' / 'imu_allan'
    script.parent.mkdir()
    script.write_text('import shlex, sys\nfrom imu_allan.cli.main import main\n'
                      'sys.exit(max(main(shlex.split(line)) for line in sys.argv[1:]))\n')
    done = subprocess.run([
        sys.executable, str(script), f'info {recordings}/small',
        f'analyze {recordings}/small --json {result} --output out',
        f'simulate {model} --duration 1s --output simulated', f'export {result} --for kalibr',
        f'report {result} --output report', f'check {result} --spec {model} --allow-undecided',
        f'analyze {recordings}/small {recordings}/other --jobs 2',
        f'analyze {recordings}/large'], cwd=downloaded, capture_output=True, text=True,
        timeout=300, check=False)
    assert not (tmp_path / 'ran').exists(), (tmp_path / 'ran').read_text()
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.count(': 30 s, gyro N') == 2
    assert f'{LARGE:,} samples at 100 Hz, 36 min 40 s' in done.stdout.splitlines()
