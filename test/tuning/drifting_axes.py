# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Axes whose drift model is stated, with the curve that it gives."""

from imu_allan.noise.drift_model import drift_avar
from imu_allan.result import AxisResult, Curve, DriftModel, GaussMarkov, GoodnessOfFit, Tone
import numpy as np

FLICKER = tuple((3e-4 * np.sqrt(np.log(4) / np.pi), 0.01 * 4.0**k) for k in range(16))
"""Processes that together are flicker of 3e-4."""


def axis_of(
        noise_density=0.0, walk=0.0, processes=(), tones=(), known=(0.01, 3000.0),
        quantity='angular_velocity', **fields):
    """Return an axis with this drift model; processes are (sigma, time), tones (hertz, a)."""
    model = DriftModel(noise_density, walk, tuple(GaussMarkov(*p) for p in processes), *known)
    lines = tuple(Tone(*tone) for tone in tones)
    tau = 0.01 * 2.0 ** np.arange(19)
    adev = np.sqrt(drift_avar(model, lines, tau))
    edf = np.maximum(1.0, 1.5 * 3 * known[1] / tau)
    pairs = tuple(zip(adev.tolist(), adev.tolist(), strict=True))
    curve = Curve(tuple(tau.tolist()), tuple(adev.tolist()), tuple(edf.tolist()), pairs, pairs,
                  tuple(adev.tolist()))
    unit = 'rad/s' if quantity == 'angular_velocity' else 'm/s^2'
    return AxisResult(quantity, unit, 0.0, None, lines, {}, GoodnessOfFit(0.5, 0.0, True), curve,
                      drift_model=model, **fields)
