# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The same in GTSAM: CombinedImuFactor with measured, tenfold and tuned numbers.

    pip install gtsam
    python examples/filter_consistency/with_gtsam.py --output gtsam_output
    python examples/filter_consistency/with_gtsam.py --recording my_bag --output my_output

An IMU lies still. Ten measurements a second are preintegrated, a CombinedImuFactor joins one
second to the next in a fixed-lag smoother, a position fix closes each but for a minute now and
then. The numbers come from the first half of the record, the smoother runs over the second. NIS is
what a fix says of the position predicted before it, NEES what the truth says of the outages, by
axis: 1 is right, above 1 overconfident.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
import sys

from consistency import (
    AIDED_S,
    Array,
    Densities,
    figure,
    FIX_SIGMA,
    GRAVITY,
    numbers,
    OUTAGE_S,
    recorded,
    simulated,
)
import imu_allan
from imu_allan.noise.terms import AXES
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.plot import render
import numpy as np

try:
    import gtsam
    from gtsam.symbol_shorthand import B, V, X
except ImportError:
    sys.exit('this example needs GTSAM: pip install gtsam')

PER_SECOND = 10
LAG_S = 3.0
UP = np.array([0, 0, GRAVITY])
FIRST_SIGMAS = {'pose': [1e-3] * 3 + [0.1] * 3, 'velocity': 0.1, 'bias': [0.05] * 3 + [1e-3] * 3}
"""Of what the smoother begins with: rotation [rad] and position [m], m/s, m/s^2 and rad/s."""


def parameters(densities: Densities) -> 'gtsam.PreintegrationCombinedParams':
    """Return the numbers as GTSAM takes them: continuous-time covariances, axis by axis."""
    n, k = densities
    params = gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY)
    params.setGyroscopeCovariance(np.diag(n[:3] ** 2))
    params.setAccelerometerCovariance(np.diag(n[3:] ** 2))
    params.setBiasOmegaCovariance(np.diag(k[:3] ** 2))
    params.setBiasAccCovariance(np.diag(k[3:] ** 2))
    # What the integration itself gets wrong at rest is nothing.
    params.setIntegrationCovariance(1e-14 * np.eye(3))
    return params


def run(rates: Array, densities: Densities, seed: int) -> tuple[Array, Array]:
    """
    Smooth an IMU at rest.

    Parameters
    ----------
    rates : ndarray, shape (measurements, 6)
        Errors of gyro x, y, z and accel x, y, z, `PER_SECOND` a second.
    densities : tuple of ndarray
        What the factors are fed with.
    seed : int
        Of the fixes.

    Returns
    -------
    nees : ndarray, shape (outages, OUTAGE_S)
        Of the position, by seconds into the outage; divided by 3, so that 1 is right.
    nis : ndarray, shape (fixes,)

    """
    rng = np.random.default_rng(seed)
    params = parameters(densities)
    settings = gtsam.ISAM2Params()
    # The bias moves by millionths in a second: Cholesky's method would square that.
    settings.setFactorization('QR')
    smoother = gtsam.IncrementalFixedLagSmoother(LAG_S, settings)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    state, bias = gtsam.NavState(), gtsam.imuBias.ConstantBias()
    for key, value, sigmas in ((X(0), state.pose(), FIRST_SIGMAS['pose']),
                               (B(0), bias, FIRST_SIGMAS['bias'])):
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.array(sigmas))
        values.insert(key, value)
        graph.push_back((gtsam.PriorFactorPose3 if key == X(0) else
                         gtsam.PriorFactorConstantBias)(key, value, noise))
    values.insert(V(0), np.zeros(3))
    graph.push_back(gtsam.PriorFactorVector(
        V(0), np.zeros(3), gtsam.noiseModel.Isotropic.Sigma(3, FIRST_SIGMAS['velocity'])))
    smoother.update(graph, values, {X(0): 0.0, V(0): 0.0, B(0): 0.0})
    fix_noise = gtsam.noiseModel.Isotropic.Sigma(3, FIX_SIGMA)
    nees: list[list[float]] = []
    nis = []
    for step in range(len(rates) // PER_SECOND):
        measured = gtsam.PreintegratedCombinedMeasurements(params, bias)
        for rate in rates[step * PER_SECOND:(step + 1) * PER_SECOND]:
            measured.integrateMeasurement(rate[3:] + UP, rate[:3], 1 / PER_SECOND)
        predicted = measured.predict(state, bias)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.push_back(gtsam.CombinedImuFactor(X(step), V(step), X(step + 1), V(step + 1),
                                                B(step), B(step + 1), measured))
        for key, value in ((X(step + 1), predicted.pose()), (V(step + 1), predicted.velocity()),
                           (B(step + 1), bias)):
            values.insert(key, value)
        now = float(step + 1)
        smoother.update(graph, values, {X(step + 1): now, V(step + 1): now, B(step + 1): now})
        pose = smoother.calculateEstimatePose3(X(step + 1))
        # The covariance of a pose is in its own axes.
        turn = pose.rotation().matrix()
        p = turn @ smoother.marginalCovariance(X(step + 1))[3:, 3:] @ turn.T
        error = -pose.translation()     # the truth is the origin
        place = step % (AIDED_S + OUTAGE_S)
        if place >= AIDED_S:
            if place == AIDED_S:
                nees.append([])
            nees[-1].append(float(error @ np.linalg.solve(p, error)) / 3)
        else:
            fix = FIX_SIGMA * rng.standard_normal(3)
            innovation = fix + error
            if step > 4 * AIDED_S and place > 0:
                nis.append(float(innovation @ np.linalg.solve(p + FIX_SIGMA**2 * np.eye(3),
                                                              innovation)) / 3)
            fixes = gtsam.NonlinearFactorGraph()
            fixes.push_back(gtsam.GPSFactor(X(step + 1), fix, fix_noise))
            smoother.update(fixes, gtsam.Values(), {})
        state = gtsam.NavState(smoother.calculateEstimatePose3(X(step + 1)),
                               smoother.calculateEstimateVector(V(step + 1)))
        bias = smoother.calculateEstimateConstantBias(B(step + 1))
    # The first outages still show how the smoother began.
    return np.array([one for one in nees if len(one) == OUTAGE_S][3:]), np.array(nis)


def compared(samples: Mapping[str, Array], rate_hz: float) -> dict[str, tuple[Array, Array]]:
    """Take the numbers from the first half and smooth the second, for each way to feed it."""
    half = len(samples['gyro_x']) // 2
    axes = {name: imu_allan.characterize(values[:half], rate_hz, AXES[name].value)
            for name, values in samples.items()}
    size = round(rate_hz / PER_SECOND)
    count = half // size
    # At rest the truth is the mean: earth rate and gravity are no errors.
    rates = np.stack([(values[half:half + count * size] - values[:half].mean())
                      .reshape(count, size).mean(axis=1) for values in samples.values()], axis=1)
    return {name: run(rates, densities, 7) for name, densities in numbers(axes).items()}


def main() -> int:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--recording', help='an IMU at rest, instead of a simulated one')
    parser.add_argument('--hours', type=float, default=6.0, help='of the simulated record')
    parser.add_argument('--output', default='gtsam_output')
    options = parser.parse_args()
    samples, rate = (recorded(options.recording) if options.recording
                     else (simulated(options.hours, 50.0, 1), 50.0))
    found = compared(samples, rate)
    print(f'{"fed with":14}{"NIS":>8}{"NEES 10 s":>12}{"60 s":>8}')
    for name, (nees, nis) in found.items():
        print(f'{name:14}{nis.mean():8.2f}{nees[:, 9].mean():12.2f}{nees[:, -1].mean():8.2f}')
    path = Path(options.output) / 'gtsam.png'
    write_atomically(path, render(figure(found), 'png'))
    print(path)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
