# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What an output in coarse steps hides from a datasheet.

Rounding a sample to steps q makes white noise of q / sqrt(12) as long as the noise is half a step:
little more is seen than there is. Less noise stays within a step or jumps between two of them,
whatever it is. A driver that cuts towards zero, as a cast to an integer does, has a cell of two
steps there, which hides twice as much.
"""

from math import sqrt

from imu_allan.noise.terms import TERMS
from imu_allan.result import AxisResult

_STILL = 15.0
"""From which on less than 1 in 200 samples differs: a thousand in a row may be one value."""
_HIDDEN = sqrt(2.0)
"""Noise, in steps, from which on the noise of what is cut is larger than a step."""


def nearly_constant(axis: AxisResult) -> str | None:
    """Say that next to all samples of an axis are one value, as its output steps so coarsely."""
    ratio = _steps_of_noise(axis)
    if ratio <= _STILL:
        return None
    return (f'the axis is all but constant: its output steps by {axis.coarse_step:.3g} '
            f'{axis.unit}, {ratio:.0f} times the noise of one sample')


def hidden_by_steps(axis: AxisResult, key: str, limit: float) -> str | None:
    """
    Say why a limit of a noise coefficient lies below what the steps of an output can show.

    Parameters
    ----------
    axis : AxisResult
        With the step of its output.
    key : str
        What is limited; None but a key of `TERMS` is hidden.
    limit : float
        In SI units.

    Returns
    -------
    str or None
        None where the output is fine enough, or noise breaks the limit whatever it hides.

    """
    ratio = _steps_of_noise(axis)
    # Steps from zero: within, the mean of an axis that is cut towards zero falls into its cell.
    near_zero = axis.mean is not None and abs(axis.mean) < 2.0 * (axis.coarse_step or 0)
    # Steps, in noise of a sample, up to which rounding takes at most 6 % off a slow course.
    if key not in TERMS or not ratio or (ratio <= 2.0 and not near_zero):
        return None
    step = axis.coarse_step or 0.0
    if key == 'noise_density':
        a_step = step * sqrt(axis.curve.tau_s[0])
        interval = axis.coefficients[key].ci95
        # Noise, in steps, that a mean between two of them makes of next to none.
        if limit >= _HIDDEN * a_step or (
                interval is not None and interval[0]**2 - (0.5 * a_step)**2 > limit**2):
            return None
    return (f'the output steps by {step:.3g} {axis.unit}, {ratio:.1f} times the noise of one '
            'sample, and hides what is limited; record with a finer resolution')


def _steps_of_noise(axis: AxisResult) -> float:
    """Return the step of the output in noise of a sample; 0 where it is smaller than that."""
    noise = axis.curve.adev[0] if axis.curve.adev else 0.0
    return axis.coarse_step / noise if axis.coarse_step is not None and noise > 0 else 0.0
