# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated IMU at rest: a noise model in, blocks of Imu samples out.

It takes the place of a topic or a recording: the simulated sensor of the node and the recordings
that ``imu_allan simulate`` writes both come from here.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from imu_allan.arrays import Array
from imu_allan.block import ImuBlock
from imu_allan.noise.simulate import NoiseStream
from imu_allan.noise.terms import AXES
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import STANDARD_GRAVITY
import numpy as np


class SimulatedImu:
    """
    Six axes of noise, block after block, in constant memory.

    Parameters
    ----------
    model : NoiseModel
        Coefficients of each axis. An axis that is not in the model is noiseless. If no
        accelerometer has a mean, z measures gravity.
    sample_rate_hz : float
        Samples per second.
    seed : int, optional
        The same seed gives the same samples, however many are drawn at a time.

    """

    def __init__(self, model: NoiseModel, sample_rate_hz: float, seed: int = 0) -> None:
        self.sample_rate_hz = sample_rate_hz
        self._streams = [
            NoiseStream(axis_coefficients(model, name), sample_rate_hz, seed * len(AXES) + column)
            for column, name in enumerate(AXES)]
        self.absent = np.array([not any(name.startswith(sensor) for name in model.axes)
                                for sensor in ('gyro', 'accel')])
        self._ready = np.empty((0, len(AXES)))

    def draw(self, samples: int) -> Array:
        """Return the next samples, shape (samples, 6), in rad/s and m/s^2."""
        drawn = [self._ready]
        missing = samples - len(self._ready)
        # In smaller blocks numpy calls cost more than the noise. The samples of a seed depend on
        # it.
        at_once = 1024
        # The streams draw random numbers block by block: with blocks of one size, the samples do
        # not depend on how many are requested at a time.
        for _ in range(-(-missing // at_once)):
            drawn.append(np.stack([s.draw(at_once) for s in self._streams], axis=1))
        rows = np.concatenate(drawn)
        self._ready = rows[samples:]
        return rows[:samples]


def axis_coefficients(model: NoiseModel, axis: str) -> Mapping[str, Any]:
    """Return the coefficients of one axis of `model`, as `imu_allan.noise.simulate` takes them."""
    coefficients: dict[str, Any] = dict(model.axes.get(axis, {}))
    if axis in model.gauss_markov:
        process = model.gauss_markov[axis]
        coefficients['gauss_markov'] = {'sigma': process.sigma,
                                        'correlation_time_s': process.correlation_time_s}
    if axis in model.mean:
        coefficients['mean'] = model.mean[axis]
    elif axis == 'accel_z' and not any(name.startswith('accel') for name in model.mean):
        coefficients['mean'] = STANDARD_GRAVITY
    return coefficients


def simulated_blocks(model: NoiseModel, sample_rate_hz: float, samples: int, *, seed: int = 0,
                     start_ns: int = 0, frame_id: str = 'imu_link',
                     block_samples: int = 10_000) -> Iterator[ImuBlock]:
    """Yield samples of a simulated IMU in blocks, the first sample stamped `start_ns`."""
    imu = SimulatedImu(model, sample_rate_hz, seed)
    for first in range(0, samples, block_samples):
        index = np.arange(first, min(first + block_samples, samples))
        stamps = start_ns + np.rint(index / sample_rate_hz * 1e9).astype(np.int64)
        drawn = imu.draw(len(index))
        yield ImuBlock(stamps, stamps, drawn, np.tile(imu.absent, (len(index), 1)), frame_id)
