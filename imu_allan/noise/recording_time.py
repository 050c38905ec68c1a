# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Forecast of the recording time that is needed, from the Fisher information of longer records."""

from collections.abc import Mapping

from imu_allan.arrays import Array
from imu_allan.noise import spectrum
from imu_allan.noise.terms import LASTING_TERMS
import numpy as np


def further_times(coefficients: Mapping[str, float], observable: Mapping[str, bool], dt: float,
                  duration_s: float) -> dict[str, float | None]:
    """
    Forecast how much longer to record.

    `coefficients`: best SI value by key, including terms that are not observable yet.
    `observable`: which of them are observable. `duration_s`: length of the record so far in
    seconds. Returns: further times in seconds, by key, until the interval of an observable term
    should be half as wide, or until another one should become observable. None if the size of the
    term is unknown, or beyond 4096 times the record.
    """
    found: dict[str, float | None] = dict.fromkeys(LASTING_TERMS)
    theta = np.array([coefficients.get(key, 0.0) for key in LASTING_TERMS]) ** 2
    if theta[0] <= 0 or duration_s < 4 * dt:
        return found
    # Longer forecasts, beyond half a year for a record of an hour, would help nobody to plan.
    lengths: Array = duration_s * np.exp2(np.arange(13))
    errors = _standard_errors(theta, dt, lengths)
    for i, key in enumerate(LASTING_TERMS):
        if theta[i] > 0:
            # With this likelihood ratio, a slow term is probable enough to be reported.
            wanted = errors[0, i] / 2 if observable.get(key) else theta[i] / np.sqrt(5.5)
            found[key] = _first(lengths, errors[:, i], wanted)
    return found


def _first(lengths: Array, errors: Array, wanted: float) -> float | None:
    """Return the further time until an error falls to `wanted`, by log-log interpolation."""
    k = int(np.argmax(errors <= wanted))
    if k == 0:
        # Never, or the record is long enough already, so that something else hides the term.
        return None
    x = np.log(errors[k - 1:k + 1] / wanted)
    share = x[0] / (x[0] - x[1])
    return float(lengths[k - 1] * (lengths[k] / lengths[k - 1]) ** share - lengths[0])


def _standard_errors(theta: Array, dt: float, durations: Array) -> Array:
    """Return the Cramer-Rao bounds of the squared coefficients, shape (durations, 3)."""
    n = (durations / dt)[:, None]
    # Modes from here on are summed in 120 bands; 8 or 2048 change a bound by 0.02 %.
    rest = 32
    single = np.broadcast_to(np.arange(1, rest), (len(n), rest - 1))
    edges = np.geomspace(rest, np.maximum(n[:, 0], rest + 1), 120, axis=1) - 0.5
    j = np.concatenate((single, np.sqrt(edges[:, 1:] * edges[:, :-1])), axis=1)
    modes: Array = np.concatenate((single < n, np.diff(edges)), axis=1)
    nu = np.minimum(j / (2 * n), 0.5)
    shapes = np.stack((spectrum.white(nu, dt), spectrum.flicker(nu, dt),
                       spectrum.random_walk(nu, dt)), axis=2)
    # Terms at zero count as well, as they may be confused with the term in question.
    relative = shapes / (shapes @ theta)[..., None]
    information = np.swapaxes(relative * modes[..., None] / 2, 1, 2) @ relative
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    inverse = np.linalg.pinv(information / (scale[:, :, None] * scale[:, None]))
    variances = np.diagonal(inverse, axis1=1, axis2=2)
    return np.asarray(np.sqrt(np.maximum(variances, 0)) / scale)
