# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures and the figures that README and the FAQ show, from simulated sensors alone.

    .venv/bin/python docs/make_figures.py            # a few minutes

Pictures go to docs/images/; tables are printed, to be copied into the pages.
"""

from collections.abc import Mapping
import os
from pathlib import Path
import subprocess
import sys
import tempfile

import imu_allan
from imu_allan.block import ImuBlock
from imu_allan.characterization.stream import Characterization
from imu_allan.result import Result
from imu_allan.sensor.noise_model import load_model
from imu_allan.sensor.simulated_imu import axis_coefficients
from imu_allan.sensor.units import engineering, typeset
from imu_allan.writers.curves import limits_of
from imu_allan.writers.panels import (
    COLOURS,
    DASHES,
    draw_curve,
    draw_signal,
    empty_figure,
    frame,
    MARKERS,
    plot_style,
)
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


def analyzed(name: str, samples: np.ndarray, rate_hz: float) -> Result:
    """Characterize one axis of a gyroscope, as from a recording of this name."""
    stream = Characterization(kind='recording', path=name)
    stamps = np.rint(np.arange(len(samples)) * 1e9 / rate_hz).astype(np.int64)
    rows = np.full((len(samples), 6), np.nan)
    rows[:, 0] = samples
    absent = np.tile([False, True], (len(samples), 1))
    for start in range(0, len(samples), 100_000):
        part = slice(start, start + 100_000)
        stream.update(ImuBlock(stamps[part], stamps[part], rows[part], absent[part], ''))
    stream.finish()
    return stream.result()


def beside(results: Mapping[str, Result], path: Path) -> None:
    """Draw the signal of each result, and beside all of them their Allan deviations."""
    with plot_style():
        figure = empty_figure(11.0, 3.0 + 0.45 * len(results))
        panel = figure.add_axes((0.6, 0.14, 0.345, 0.74))
        axes = [result.axes['gyro_x'] for result in results.values()]
        frame(panel, 'gyro', limits_of(axes))
        for place, (name, result) in enumerate(results.items()):
            letter = 'xyz'[place]
            shown = {f'gyro_{letter}': result.axes['gyro_x']}
            height = 0.74 / len(results)
            strip = figure.add_axes((0.065, 0.88 - (place + 0.86) * height, 0.42, 0.7 * height))
            draw_signal(strip, shown, result)
            if place < len(results) - 1:
                strip.set_xlabel('')
                strip.tick_params(labelbottom=False)
            figure.text(0.485, 0.905 - (place + 0.13) * height, name, ha='right', va='bottom',
                        fontsize=9, fontweight='bold', color=COLOURS[letter])
            draw_curve(panel, result.axes['gyro_x'], COLOURS[letter], MARKERS[letter],
                       result.timeline, DASHES[letter])
        path.write_bytes(render(figure, 'png', dpi=110))


def questions() -> None:
    """Draw what the FAQ answers: a warm-up, noise that changes, recordings that disagree."""
    rate_hz, hours = 50.0, 3
    time = np.arange(round(hours * 3600 * rate_hz)) / rate_hz
    noise = imu_allan.simulate(GYRO, len(time), rate_hz, 5)
    warm = np.deg2rad(0.3) * np.exp(-time / 900)
    settling = analyzed('settling', noise + warm, rate_hz)
    for remark in settling.warnings:
        print(remark.code, remark.message)
    beside({'from switching on': settling, 'the same without it': analyzed(
        'warm', noise, rate_hz)}, IMAGES / 'warm_up.png')
    machine = noise + np.where((time > 3600) & (time < 5400), 1.0, 0.0) * imu_allan.simulate(
        {'noise_density': GYRO['noise_density']}, len(time), rate_hz, 6)
    changing = analyzed('machine', machine, rate_hz)
    for remark in changing.warnings:
        print(remark.code, remark.message)
    parts_of(changing, IMAGES / 'noise_changes.png')
    nights = {f'night {number}': analyzed(f'night {number}', imu_allan.simulate(
        GYRO, len(time), rate_hz, number), rate_hz) for number in (1, 2)}
    nights['beside a fan'] = analyzed('fan', imu_allan.simulate(
        GYRO | {'noise_density': 1.3 * GYRO['noise_density']}, len(time), rate_hz, 3), rate_hz)
    for name, result in nights.items():
        for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
            found = result.axes['gyro_x'].coefficients[key]
            print(name, key, *(engineering(v, found.unit)[0] for v in (
                [found.value, *found.ci95] if found.observable else [found.upper95])))
    beside(nights, IMAGES / 'two_recordings.png')


def parts_of(result: Result, path: Path) -> None:
    """Draw the noise density of every part of a record with its 95 % interval."""
    axis = result.axes['gyro_x']
    assert axis.stationarity is not None
    density = axis.coefficients['noise_density']
    with plot_style():
        figure = empty_figure(11.0, 2.8)
        panel = figure.add_axes((0.065, 0.19, 0.88, 0.71))
        for segment in axis.stationarity.segments:
            middle = (segment.start_s + segment.duration_s / 2) / 3600
            value, low, high = (engineering(v, density.unit)[0]
                                for v in (segment.noise_density, *segment.ci95))
            panel.plot([middle, middle], [low, high], color=COLOURS['x'])
            panel.plot([middle], [value], MARKERS['x'], color=COLOURS['x'], markersize=5)
        low, high = (engineering(v, density.unit)[0] for v in density.ci95)
        panel.axhspan(low, high, color=COLOURS['soft'], alpha=0.2, linewidth=0)
        panel.set_xlabel('time [h]')
        panel.set_ylabel(f'N of each segment [{typeset(engineering(1.0, density.unit)[1])}]')
        panel.set_ylim(0, 0.9)
        panel.grid(True)
        panel.set_title('bars: 95 % of each segment; band: 95 % of the whole', loc='left',
                        fontsize=9, fontweight='normal')
        path.write_bytes(render(figure, 'png', dpi=110))


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
    chosen = sys.argv[1:] or ['pictures', 'questions', 'how_long', 'how_tools_go_wrong']
    for name in chosen:
        print(f'== {name}')
        globals()[name]()
