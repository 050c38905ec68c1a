# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Why an axis by itself does not measure, for a while or throughout; decided here alone."""

from typing import NamedTuple

from imu_allan.noise.faults.deadband import deadband
from imu_allan.noise.faults.saturation import cut_off, CutOff
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.signal_over_time import stood_still
from imu_allan.result import Deadband
import numpy as np
from numpy.typing import NDArray

_COARSE_STEP = 2.0
"""In noise of a sample: with coarser steps a mean between two borders often gives one value, and
the noise changes with the place of the mean between them."""


class Constant(NamedTuple):
    """Every sample is this value, in the unit of a sample."""

    value: float


class StoodStill(NamedTuple):
    """One and the same value for so many samples, from the first of them on."""

    first: int
    samples: int


AxisFault = Constant | Deadband | StoodStill | CutOff


def axis_fault(finished: Estimator, axis: int) -> AxisFault | None:
    """
    Tell why an axis does not measure; without a fault it has coefficients.

    Returns the first that holds of `Constant`, `Deadband`, `StoodStill` and `CutOff`.

    Examples
    --------
    >>> estimator = Estimator()
    >>> estimator.update(np.full(2000, 9.81))
    >>> axis_fault(estimator.finished(), 0)
    Constant(value=9.81)

    """
    if finished.samples and finished.census.lowest[axis] == finished.census.highest[axis]:
        return Constant(float(finished.mean[axis]))
    if (dead := deadband(finished, axis)) is not None:
        return dead
    # Coarse steps give one value for long by nature.
    if (not steps_hide_noise(finished)[axis]
            and (still := stood_still(finished.signal.columns(), axis)) is not None):
        return StoodStill(*still)
    return cut_off(finished, axis)


def steps_hide_noise(finished: Estimator) -> NDArray[np.bool_]:
    """Tell of every axis whether its output steps by more than its noise shows."""
    return np.asarray(finished.census.step > _COARSE_STEP * sample_noise(finished))


def sample_noise(finished: Estimator) -> NDArray[np.float64]:
    """Return the noise of one sample about its neighbours, shape (axes,); 0 when unknown."""
    pyramid = finished.pyramid
    # White noise: the mean squared second difference of phase over single samples is 2 sigma^2.
    return np.asarray(np.sqrt(pyramid.sums[0] / max(2 * pyramid.counts[0], 1)))
