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
    # matplotlib would run text through LaTeX, and could not even decode the rest.
    (folder / 'matplotlibrc').write_bytes(b'text.usetex: True\n\xff\xfe\n')
    return folder


def installed(folder):
    """Return a command line as an installation leaves it: a script in a folder of its own."""
    script = folder / 'bin' / 'imu_allan'
    script.parent.mkdir(exist_ok=True)
    script.write_text('import shlex, sys\nfrom imu_allan.cli.main import main\n'
                      'sys.exit(max(main(shlex.split(line)) for line in sys.argv[1:]))\n')
    return [sys.executable, str(script)]


def run(current, *commands):
    """Run commands in a folder, one after the other; returns their standard output."""
    done = subprocess.run([*installed(current.parent), *commands], cwd=current,
                          capture_output=True, text=True, timeout=300, check=False)
    assert not (current.parent / 'ran').exists(), (current.parent / 'ran').read_text()
    assert (done.returncode, done.stderr) == (0, '')
    return done.stdout


def test_no_verb_imports_or_obeys_what_lies_in_the_current_folder(recordings, downloaded):
    result, model = downloaded / 'r.json', downloaded / 'm.yaml'
    model.write_text(MODEL)
    # A pipe that nobody writes to, instead of a file, would keep matplotlib waiting for ever.
    (downloaded / 'matplotlibrc').unlink()
    os.mkfifo(downloaded / 'matplotlibrc')
    size = sum(file.stat().st_size for file in (recordings / 'large').iterdir())
    assert size > 1 << 26
    shown = run(
        downloaded, f'info {recordings}/small',
        f'analyze {recordings}/small --json {result} --output out',
        f'simulate {model} --duration 1s --output simulated', f'export {result} --for kalibr',
        f'report {result} --output report', f'check {result} --spec {model} --allow-undecided',
        f'analyze {recordings}/small {recordings}/other --jobs 2',
        f'analyze {recordings}/large')
    assert shown.count(': 30 s, gyro N') == 2
    assert f'{LARGE:,} samples at 100 Hz, 36 min 40 s' in shown.splitlines()


def test_plots_are_the_same_whatever_settings_lie_in_the_current_folder(recordings, downloaded):
    elsewhere = downloaded.parent / 'elsewhere'
    elsewhere.mkdir()
    (downloaded / 'matplotlibrc').write_text('lines.linewidth: 20\nsavefig.pad_inches: 3\n')
    plots = []
    for current in (elsewhere, downloaded):
        run(current, f'analyze {recordings}/small --output out')
        plots.append((current / 'out' / 'allan_deviation.png').read_bytes())
    assert plots[0] == plots[1]
