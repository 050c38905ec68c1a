# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Noise of an axis that none of the five terms is, as lines with a name for a picture."""

from imu_allan.noise.fitted_model import reported_model
from imu_allan.noise.terms import gauss_markov_avar, power_law_avar
from imu_allan.result import AxisResult
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import duration, number
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def beside_terms(axis: AxisResult, tau: Array) -> list[tuple[Array, int, list[str]]]:
    """
    Return the noise of an axis that none of the terms is.

    Parameters
    ----------
    axis : AxisResult
        Whose noise.
    tau : ndarray, shape (n,)
        Averaging times in seconds.

    Returns
    -------
    list of (ndarray of shape (n,), int, list of str)
        Allan deviation in the unit of a sample, the point at which to name it, and its name.

    """
    found = []
    if (process := axis.gauss_markov) is not None:
        line = np.sqrt(gauss_markov_avar(process.sigma, process.correlation_time_s, tau))
        sigma, unit = engineering(process.sigma, axis.unit)
        found.append((line, int(np.argmax(line)), [
            f'Gauss-Markov, {number(sigma, 3)} {typeset(unit)}',
            f'correlated over {duration(process.correlation_time_s)}']))
    if axis.power_law is not None and (law := reported_model(axis).power_law) is not None:
        found.append((np.sqrt(power_law_avar(*law, tau)), len(tau) // 2, [
            f'1/f to the power of {axis.power_law.exponent:.2f}', 'no flicker']))
    return found


def law_instead(axis: AxisResult, key: str) -> str:
    """Return in brief the slow noise that an axis has instead of a term, '' where it has none."""
    law = axis.power_law
    return f'no flicker, 1/f^{law.exponent:.2f}' if law and key == 'bias_instability' else ''
