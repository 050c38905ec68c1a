# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""dedrunk-cli of PyPI: N and K of each sensor as a Kalibr file, or a refusal."""

from importlib.metadata import version
from pathlib import Path
import subprocess
import sys
import tempfile

from recorded import Answer, AXES, Estimate, K, N, Recorded, RefusedError
import yaml

NAME = 'dedrunk'
ORIGIN = f'PyPI dedrunk-cli {version("dedrunk-cli")}'


def answer(recording: Recorded) -> Answer:
    """Run the program and read the file it writes."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / 'imu.yaml'
        done = subprocess.run(
            [str(Path(sys.executable).with_name('dedrunk')), 'noise', str(recording.path), '-y',
             '--output', str(output), '--csv', str(Path(folder) / 'allan.csv')],
            capture_output=True, text=True, check=False)
        if done.returncode:
            raise RefusedError(done.stderr.strip().splitlines()[-1].removeprefix('error: '))
        written = yaml.safe_load(output.read_text())
    written = written.get('imu0', written)
    sensors = {'gyro': 'gyroscope', 'accel': 'accelerometer'}
    return {axis: {N: Estimate(float(written[f'{sensor}_noise_density'])),
                   K: Estimate(float(written[f'{sensor}_random_walk']))}
            for axis in AXES for sensor in [sensors[axis.partition('_')[0]]]}
