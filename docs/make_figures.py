# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures and the figures that README and the FAQ show, from simulated sensors alone.

    .venv/bin/python docs/make_figures.py            # a few minutes

Pictures go to docs/images/; tables are printed, to be copied into the pages.
"""

import os
from pathlib import Path
import subprocess
import sys
import tempfile

import imu_allan
from imu_allan.sensor.noise_model import load_model
from imu_allan.sensor.simulated_imu import axis_coefficients
from imu_allan.sensor.units import engineering
from imu_allan.writers.plot import overview_figure, render, sensor_figure
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / 'docs' / 'images'
MODEL = load_model(ROOT / 'config' / 'consumer_mems.yaml')
GYRO = axis_coefficients(MODEL, 'gyro_x')
RATE_HZ = 100.0


def pictures() -> None:
    """Draw what `imu_allan simulate` and `imu_allan analyze` make of a consumer MEMS IMU."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, '-m', 'imu_allan', 'simulate',
             str(ROOT / 'config' / 'consumer_mems.yaml'), '--rate', '200', '--duration', '12h',
             '--seed', '1', '--output', 'imu_at_rest'], check=True, cwd=folder)
        # The heading names the recording as the user would.
        os.chdir(folder)
        result = imu_allan.analyze('imu_at_rest')
        os.chdir(ROOT)
    (IMAGES / 'overview.png').write_bytes(render(overview_figure(result), 'png', dpi=110))
    (IMAGES / 'gyro.png').write_bytes(render(sensor_figure(result, 'gyro'), 'png', dpi=110))


def how_long(seeds: int = 12) -> None:
    """Print what each length of a recording shows of a consumer gyroscope."""
    print('| recording | N | B | K |\n| --- | --- | --- | --- |')
    for name, seconds in (('1 min', 60), ('10 min', 600), ('1 h', 3600), ('3 h', 10_800),
                          ('12 h', 43_200), ('24 h', 86_400)):
        cells = []
        axes = [imu_allan.characterize(
            imu_allan.simulate(GYRO, round(seconds * RATE_HZ), RATE_HZ, seed), RATE_HZ)
            for seed in range(seeds)]
        for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
            found = [axis.coefficients[key] for axis in axes]
            widths = [(c.ci95[1] - c.ci95[0]) / 2 / GYRO[key] for c in found if c.observable]
            bounds = [c.upper95 / GYRO[key] for c in found if not c.observable]
            text = []
            if widths:
                text.append(f'±{np.median(widths):.2g}'
                            + (f' in {len(widths)} of {seeds}' if bounds else ''))
            if bounds:
                text.append(f'< {np.median(bounds):.2g} x truth in {len(bounds)} of {seeds}')
            cells.append('; '.join(text))
        print(f'| {name} | {" | ".join(cells)} |', flush=True)


def adev(samples: np.ndarray, dt: float, taus: np.ndarray) -> np.ndarray:
    """Overlapping Allan deviation."""
    phase = np.concatenate(([0.0], np.cumsum(samples - samples.mean()))) * dt
    sizes = np.maximum(np.rint(taus / dt).astype(int), 1)
    return np.array([np.sqrt(np.mean((phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m])**2)
                             / (2 * (m * dt)**2)) for m in sizes])


def how_tools_go_wrong(seeds: int = 20) -> None:
    """Print the ways in which one sensor gets different numbers."""
    seconds = 10_800
    dt = 1 / RATE_HZ
    octaves = dt * 2.0 ** np.arange(int(np.log2(seconds / dt / 3)))
    rows: dict[str, list[float]] = {}

    def note(name: str, value: float) -> None:
        rows.setdefault(name, []).append(value)

    for seed in range(seeds):
        samples = imu_allan.simulate(GYRO, round(seconds * RATE_HZ), RATE_HZ, seed)
        white = imu_allan.simulate({'noise_density': GYRO['noise_density']},
                                   round(seconds * RATE_HZ), RATE_HZ, seed)
        curve = adev(samples, dt, octaves)
        own = imu_allan.characterize(samples, RATE_HZ).coefficients
        note('N, imu_allan', own['noise_density'].value / GYRO['noise_density'])
        note('N, read at 1 s', adev(samples, dt, np.array([1.0]))[0] / GYRO['noise_density'])
        note('N, every 4th sample taken, none averaged',
             adev(samples[::4], 4 * dt, np.array([1.0]))[0] / GYRO['noise_density'])
        note('N, rate set to 400 Hz instead of 100 Hz',
             adev(samples, dt / 4, np.array([1.0]))[0] / GYRO['noise_density'])
        note('N, value per sample instead of per sqrt(Hz)',
             GYRO['noise_density'] * np.sqrt(RATE_HZ) / GYRO['noise_density'])
        if own['bias_instability'].observable:
            note('B, imu_allan', own['bias_instability'].value / GYRO['bias_instability'])
        note('B, minimum of the curve', curve.min() / GYRO['bias_instability'])
        note('B, minimum over 0.664', curve.min() / 0.664 / GYRO['bias_instability'])
        # A line of slope +1/2 through the whole curve, as if all of it were random walk.
        pure = adev(white, dt, octaves)
        line = np.exp(np.mean(np.log(pure) - 0.5 * np.log(octaves / 3)))
        note('K of pure white noise (in truth 0), +1/2 line over all taus [deg/h/sqrt(h)]',
             engineering(line, 'rad/s^2/sqrt(Hz)')[0])
        note('K of pure white noise: imu_allan calls it observable',
             float(imu_allan.characterize(white, RATE_HZ).coefficients[
                 'rate_random_walk'].observable))
    for name, values in rows.items():
        print(f'| {name} | {np.mean(values):.4g} | {np.std(values):.2g} |')


if __name__ == '__main__':
    IMAGES.mkdir(exist_ok=True)
    chosen = sys.argv[1:] or ['pictures', 'how_long', 'how_tools_go_wrong']
    for name in chosen:
        print(f'== {name}')
        globals()[name]()
