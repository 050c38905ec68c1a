# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Write docs/first_minutes.md from what the command prints on simulated recordings.

    .venv/bin/python docs/make_first_minutes.py
"""

import os
from pathlib import Path
import subprocess
import sys
import tempfile

HEAD = """\
# The first five minutes

A transcript of simulated recordings: you can type the same. Digits may differ between versions
of SciPy.
"""
DATASHEET = """\
name: My IMU
gyro: {noise_density: 0.03 deg/s/sqrt(Hz), bias_instability: 18 deg/h}
accel: {noise_density: 300 ug/sqrt(Hz)}
"""
STEPS = (
    ('No recording yet? Simulate one. Then look what is in it.',
     'imu_allan simulate consumer_mems --rate 200 --duration 20min --output imu_at_rest',
     'imu_allan info imu_at_rest'),
    ('Analyze it. The verdict comes first, then the numbers.',
     'imu_allan analyze imu_at_rest --output characterization'),
    ('What does that finding mean?',
     'imu_allan explain short_recording'),
    ('The numbers for a filter, with their provenance.',
     'imu_allan export characterization/result.json --for kalibr | head -11'),
    ('Is the unit as good as its datasheet (`datasheet.yaml`, [as printed](task_datasheet.md))?',
     'imu_allan check characterization/result.json --spec datasheet.yaml | head -4'),
    ('A recording that is too short.',
     'imu_allan simulate consumer_mems --duration 8s --output too_short',
     'imu_allan analyze too_short | head -2'),
    ('Mistakes are one line that says what there is.',
     'imu_allan analyze imu_at_rset',
     'imu_allan analyze imu_at_rest --topic /imu/data'),
)


def page() -> str:
    """Return the text of the page; runs every command, which takes half a minute."""
    parts = [HEAD]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, 'datasheet.yaml').write_text(DATASHEET)
        for what, *commands in STEPS:
            parts += [what, '', '```console']
            for command in commands:
                parts += [f'$ {command}', *transcript(command, folder)]
            parts += ['```', '']
    return '\n'.join(parts)


def transcript(command: str, folder: str) -> list[str]:
    """Return the lines that a command prints to a terminal of 80 columns."""
    path = f'{Path(sys.executable).parent}{os.pathsep}{os.environ["PATH"]}'
    done = subprocess.run(
        ['bash', '-c', command], cwd=folder, check=False, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env=os.environ | {'PATH': path, 'COLUMNS': '80'})
    return [line.rstrip() for line in done.stdout.splitlines()]


if __name__ == '__main__':
    Path(__file__).with_name('first_minutes.md').write_text(page())
