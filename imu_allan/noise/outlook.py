# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How much longer to record: the Fisher information of a longer record of the same noise."""

from collections.abc import Mapping

from imu_allan.noise import spectrum
from imu_allan.noise.terms import LASTING_TERMS
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Forecasts = dict[str, tuple[float | None, float | None]]

_SINGLE = 32
"""Modes taken one by one, 120 bands hold the rest: with 8 or 2048 a bound moves by 0.02 %."""


def outlook(coefficients: Mapping[str, float], observable: Mapping[str, bool], dt: float,
            duration_s: float) -> Forecasts:
    """
    Forecast further recording time.

    `coefficients`: best SI value by key, also of terms that are not observable yet. `observable`:
    which of them are observable. `duration_s`: length of the record so far in seconds. Returns: by
    key: time until the term is expected to become observable (None where it is, or where nothing
    hints at its size), and time until its interval is expected to be half as wide (None where it
    is not observable). Forecasts end at 4096 times the record.
    """
    found: Forecasts = {}
    theta = np.array([coefficients.get(key, 0.0) for key in LASTING_TERMS]) ** 2
    if theta[0] <= 0 or duration_s < 4 * dt:
        return dict.fromkeys(LASTING_TERMS, (None, None))
    # A forecast beyond 4096 records, half a year for one of an hour, helps nobody to plan.
    lengths: Array = duration_s * np.exp2(np.arange(13))
    errors = _standard_errors(theta, dt, lengths)
    for i, key in enumerate(LASTING_TERMS):
        if theta[i] <= 0:
            found[key] = (None, None)
        elif observable.get(key):
            reached = errors[:, i] <= errors[0, i] / 2
            found[key] = (None, _first(lengths, errors[:, i], errors[0, i] / 2, reached))
        else:
            # At this likelihood ratio a slow term is likely enough to be reported.
            wanted = theta[i] / np.sqrt(5.5)
            reached = errors[:, i] <= wanted
            found[key] = (_first(lengths, errors[:, i], wanted, reached), None)
    return found


def _first(lengths: Array, errors: Array, wanted: float, reached: NDArray[np.bool_]
           ) -> float | None:
    """Further time at which an error falls to `wanted`; straight lines between octaves."""
    if not reached.any():
        return None
    k = int(np.argmax(reached))
    if k == 0:
        # By this it should have shown already. What hides it is not the length of the record.
        return None
    x = np.log(errors[k - 1:k + 1] / wanted)
    share = x[0] / (x[0] - x[1])
    return float(lengths[k - 1] * (lengths[k] / lengths[k - 1]) ** share - lengths[0])


def _standard_errors(theta: Array, dt: float, durations: Array) -> Array:
    """Cramer-Rao bounds of the squared coefficients, shape (durations, 3)."""
    n = (durations / dt)[:, None]
    single = np.broadcast_to(np.arange(1, _SINGLE), (len(n), _SINGLE - 1))
    edges = np.geomspace(_SINGLE, np.maximum(n[:, 0], _SINGLE + 1), 120, axis=1) - 0.5
    j = np.concatenate((single, np.sqrt(edges[:, 1:] * edges[:, :-1])), axis=1)
    modes: Array = np.concatenate((single < n, np.diff(edges)), axis=1)
    nu = np.minimum(j / (2 * n), 0.5)
    shapes = np.stack((spectrum.white(nu, dt), spectrum.flicker(nu, dt),
                       spectrum.random_walk(nu, dt)), axis=2)
    # A term at zero counts too: it may pass for the one that is awaited.
    relative = shapes / (shapes @ theta)[..., None]
    information = np.swapaxes(relative * modes[..., None] / 2, 1, 2) @ relative
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    inverse = np.linalg.pinv(information / (scale[:, :, None] * scale[:, None]))
    variances = np.diagonal(inverse, axis1=1, axis2=2)
    return np.asarray(np.sqrt(np.maximum(variances, 0)) / scale)
