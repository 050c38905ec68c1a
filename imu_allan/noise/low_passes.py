# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A low-pass over everything that a sensor gives: what may bend a spectrum besides its slow noise.

A roll-off of the white noise alone, as the fit of a band has it, is no rival to slow noise with an
exponent of its own where flicker reaches into the bend: a filter bends that, too.

References
----------
A. V. Oppenheim, R. W. Schafer, "Discrete-Time Signal Processing" (2010), chapters 5 and 7:
frequency responses of the recursive mean, of the moving mean, and of Butterworth's filters.

"""

from collections.abc import Callable

from imu_allan.noise.groups import Groups, QUANTIZATION
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.minimum import lowest_near
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CORNERS = 9
"""Tried of each filter, evenly in the logarithm; the best is refined between its neighbours."""
_LEAST = 1e-3
"""Of a response: behind a null is what leaks there."""


def _recursive_mean(nu: Array, corner: float) -> Array:
    return np.asarray(1 / (1 + (np.sin(np.pi * nu) / corner)**2))


def _moving_mean(nu: Array, corner: float) -> Array:
    return np.asarray(np.sinc(nu / corner)**2 / np.sinc(nu)**2)


def _butterworth(order: int) -> Callable[[Array, float], Array]:
    def response(nu: Array, corner: float) -> Array:
        return np.asarray(1 / (1 + (np.tan(np.pi * np.minimum(nu, 0.499)) / corner)**(2 * order)))

    return response


_FILTERS: tuple[tuple[Callable[[Array, float], Array], float, float], ...] = (
    (_recursive_mean, 0.01, 5.0), (_moving_mean, 0.02, 1.0), (_butterworth(1), 0.01, 20.0),
    (_butterworth(2), 0.01, 5.0), (_butterworth(4), 0.01, 5.0))
"""
Squared response to a frequency in cycles per sample, and between which corners it is tried: from
what leaves a hundredth of the band to what takes a few per cent at its edge.
"""


def likeliest_low_passed(groups: Groups, dt: float, start: Solution) -> float:
    """
    Fit the terms behind the likeliest of some low-passes.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    dt : float
        Sample interval in seconds.
    start : Solution
        Where to begin.

    Returns
    -------
    float
        The loss: the negative logarithm of the likelihood.

    """
    nu = np.minimum(groups.frequency * dt, 0.5)
    best = np.inf
    for response, narrowest, widest in _FILTERS:
        near = start

        def loss(log_corner: float, response: Callable[[Array, float], Array] = response) -> float:
            nonlocal near
            passed = np.maximum(response(nu, float(np.exp(log_corner))), _LEAST)
            near = maximise(groups.with_design(groups.design * passed[:, None]), near,
                            fixed={QUANTIZATION: 0.0}, trend='restricted', tolerance=1e-3)
            return near.loss

        corners = np.linspace(np.log(narrowest), np.log(widest), _CORNERS)
        losses = [loss(corner) for corner in corners]
        refined = lowest_near(loss, corners, int(np.argmin(losses)), 1e-2)[1]
        best = min(best, min(losses), refined)
    return float(best)
