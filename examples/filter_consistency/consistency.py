# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Run an inertial navigation filter with measured, tenfold and tuned numbers, and see how it does.

    python examples/filter_consistency/consistency.py --output consistency_output
    python examples/filter_consistency/consistency.py --recording my_bag --output my_output

An IMU lies still; an error-state Kalman filter of 15 states (position, velocity, attitude, both
biases) is corrected by a position fix every second and left alone for a minute now and then. The
numbers come from the first half of the record, the filter runs over the second. Two figures: NEES
of the position during the outages, and NIS of the fixes. 1 is right, above 1 overconfident.

`with_gtsam.py` beside this file does the same with GTSAM's CombinedImuFactor.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import imu_allan
from imu_allan.noise.terms import AXES
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.panels import COLOURS, DASHES, empty_figure, MARKERS, plot_style
from imu_allan.writers.plot import render
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Densities = tuple[Array, Array]     # N and K of gyro x, y, z and accel x, y, z

STEP_S = 1.0
FIX_SIGMA = 0.02                    # m
OUTAGE_S, AIDED_S = 60, 120
GRAVITY = 9.80665
SENSOR = {
    'gyro': {'noise_density': 8e-5, 'bias_instability': 2.5e-5},
    'accel': {'noise_density': 1e-3, 'bias_instability': 4e-4},
}


def simulated(hours: float, rate_hz: float, seed: int) -> dict[str, Array]:
    """Draw a consumer IMU at rest, z up."""
    samples = round(3600 * hours * rate_hz)
    return {name: imu_allan.simulate(SENSOR[name.partition('_')[0]], samples, rate_hz, seed + i)
            for i, name in enumerate(AXES)}


def recorded(path: str) -> tuple[dict[str, Array], float]:
    """Read the samples of a recording."""
    from imu_allan.recordings import choose_topic, open_recording, read_blocks
    with open_recording(path) as recording:
        blocks = list(read_blocks(recording, choose_topic(recording)))
    samples = np.concatenate([block.samples for block in blocks])
    stamps = np.concatenate([block.header_ns for block in blocks])
    rate = (len(stamps) - 1) / (float(stamps[-1] - stamps[0]) * 1e-9)
    return dict(zip(AXES, samples.T, strict=True)), rate


def numbers(axes: Mapping[str, imu_allan.AxisResult]) -> dict[str, Densities]:
    """Return the pair of every axis in three ways."""
    def measured(axis: imu_allan.AxisResult, key: str) -> float:
        coefficient = axis.coefficients[key]
        return float((coefficient.value if coefficient.observable else coefficient.upper95) or 0)

    n = np.array([measured(axis, 'noise_density') for axis in axes.values()])
    k = np.array([measured(axis, 'rate_random_walk') for axis in axes.values()])
    tuned = [imu_allan.tune(axis, STEP_S, OUTAGE_S) for axis in axes.values()]
    return {'as measured': (n, k), 'ten times K': (n, 10 * k),
            'tuned': (np.array([t.noise_density for t in tuned]),
                      np.array([t.random_walk or 0.0 for t in tuned]))}


def transition(step_s: float) -> Array:
    """Error dynamics at rest: p' = v, v' = g x phi + b_a, phi' = b_g."""
    a = np.zeros((15, 15))
    a[0:3, 3:6] = a[3:6, 12:15] = a[6:9, 9:12] = np.eye(3)
    a[3, 7], a[4, 6] = GRAVITY, -GRAVITY
    total, term = np.eye(15), np.eye(15)
    for order in range(1, 5):       # the fourth power of `a` is zero
        term = term @ a * step_s / order
        total = total + term
    return total


def process_noise(densities: Densities, step_s: float, parts: int = 20) -> Array:
    """Integrate the noise over a step."""
    n, k = densities
    spectral = np.zeros(15)
    spectral[3:6], spectral[6:9] = n[3:] ** 2, n[:3] ** 2
    spectral[9:12], spectral[12:15] = k[:3] ** 2, k[3:] ** 2
    total = np.zeros((15, 15))
    for i in range(parts):
        f = transition((i + 0.5) * step_s / parts)
        total += f @ np.diag(spectral) @ f.T * step_s / parts
    return total


def run(rates: Array, densities: Densities, seed: int) -> tuple[Array, Array]:
    """
    Filter the errors of an IMU at rest.

    Parameters
    ----------
    rates : ndarray, shape (steps, 6)
        Mean errors of gyro x, y, z and accel x, y, z over each step.
    densities : tuple of ndarray
        What the filter is fed with.
    seed : int
        Of the fixes.

    Returns
    -------
    nees : ndarray, shape (outages, OUTAGE_S)
        Of the position, by seconds into the outage; divided by 3, so that 1 is right.
    nis : ndarray, shape (fixes,)

    """
    rng = np.random.default_rng(seed)
    f, q = transition(STEP_S), process_noise(densities, STEP_S)
    drive = np.zeros((15, 6))
    drive[3:6, 3:6] = drive[6:9, 0:3] = np.eye(3)
    # A mean over the step acts like a constant: integrate it through the dynamics.
    gain = sum((transition((i + 0.5) * STEP_S / 20) @ drive for i in range(20)),
               start=np.zeros((15, 6))) * STEP_S / 20
    p = np.diag(np.repeat([1.0, 1e-2, 1e-3, 1e-6, 1e-3], 3))
    truth, state = np.zeros(15), np.zeros(15)
    nees: list[list[float]] = []
    nis = []
    for step, rate in enumerate(rates):
        truth, state = f @ truth + gain @ rate, f @ state
        p = f @ p @ f.T + q
        place = step % (AIDED_S + OUTAGE_S)
        if place >= AIDED_S:
            if place == AIDED_S:
                nees.append([])
            error = truth[:3] - state[:3]
            nees[-1].append(float(error @ np.linalg.solve(p[:3, :3], error)) / 3)
            continue
        innovation = truth[:3] + FIX_SIGMA * rng.standard_normal(3) - state[:3]
        s = p[:3, :3] + FIX_SIGMA**2 * np.eye(3)
        if step > 4 * AIDED_S and place > 0:
            nis.append(float(innovation @ np.linalg.solve(s, innovation)) / 3)
        kalman = p[:, :3] @ np.linalg.inv(s)
        state = state + kalman @ innovation
        # Joseph's form: heading is not observed at rest, and the rest must not drown in its error.
        rest = np.eye(15)
        rest[:, :3] -= kalman
        p = rest @ p @ rest.T + FIX_SIGMA**2 * kalman @ kalman.T
        p = (p + p.T) / 2
    # The first outages still show how the filter began.
    return np.array([one for one in nees if len(one) == OUTAGE_S][3:]), np.array(nis)


def figure(found: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Draw NEES over the outage and NIS of the fixes, for each way to feed the filter."""
    looks = [(COLOURS[letter], DASHES[letter], MARKERS[letter]) for letter in 'xzy']
    with plot_style():
        drawn = empty_figure(9, 3.8)
        drawn.set_layout_engine('constrained')
        left, right = drawn.subplots(1, 2, width_ratios=[2, 1])
        seconds = np.arange(1, OUTAGE_S + 1)
        for (name, (nees, nis)), (colour, dashes, marker) in zip(found.items(), looks,
                                                                 strict=True):
            mean = nees.mean(axis=0)
            left.plot(seconds, mean, color=colour, linestyle=dashes, linewidth=1.8)
            left.plot(seconds[9::10], mean[9::10], marker, color=colour, markersize=5)
            left.annotate(name, (seconds[-1], mean[-1]), xytext=(7, 0), color=colour, va='center',
                          textcoords='offset points', fontweight='bold')
            right.plot([float(nis.mean())], [name], marker, color=colour, markersize=8)
        left.axhline(1, color=COLOURS['ink'], linewidth=0.8)
        left.set(yscale='log', xlim=(0, OUTAGE_S * 1.35), xticks=range(0, OUTAGE_S + 1, 10),
                 xlabel='seconds without a fix', ylabel='NEES of the position / 3')
        left.set_title('outages: 1 is right, above 1 overconfident', loc='left')
        left.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
        left.yaxis.set_minor_formatter(NullFormatter())
        right.axvline(1, color=COLOURS['ink'], linewidth=0.8)
        right.set(xlabel='NIS of the fixes / 3', xlim=(0.7, 1.3), ylim=(2.5, -0.5))
        right.set_title('while corrected', loc='left')
        for panel in (left, right):
            panel.grid(True)
        return drawn


def main() -> int:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--recording', help='an IMU at rest, instead of a simulated one')
    parser.add_argument('--hours', type=float, default=12.0, help='of the simulated record')
    parser.add_argument('--output', default='consistency_output')
    options = parser.parse_args()
    rate = 50.0
    if options.recording:
        samples, rate = recorded(options.recording)
    else:
        samples = simulated(options.hours, rate, 1)
    half = len(samples['gyro_x']) // 2
    axes = {name: imu_allan.characterize(values[:half], rate, AXES[name].value)
            for name, values in samples.items()}
    size = round(rate * STEP_S)
    count = half // size
    # At rest the truth is the mean: earth rate and gravity are no errors.
    rates = np.stack([(values[half:half + count * size] - values[:half].mean())
                      .reshape(count, size).mean(axis=1) for values in samples.values()], axis=1)
    found = {name: run(rates, densities, 7) for name, densities in numbers(axes).items()}
    print(f'{"fed with":14}{"NIS":>8}{"NEES 10 s":>12}{"60 s":>8}')
    for name, (nees, nis) in found.items():
        print(f'{name:14}{nis.mean():8.2f}{nees[:, 9].mean():12.2f}{nees[:, -1].mean():8.2f}')
    path = Path(options.output) / 'consistency.png'
    write_atomically(path, render(figure(found), 'png'))
    print(path)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
