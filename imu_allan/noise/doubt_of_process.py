# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the doubt whether there is a Gauss-Markov process leaves of the bias instability.

A process is told where it is beyond doubt, for flicker looks like one somewhere by chance. One
that is there and not told passes for flicker, which then is too large by several errors. Where it
would be observable as a term is, its time being given, the interval is that beside it, too.
"""

from dataclasses import replace

from imu_allan.noise.correlated import promising_time, with_process_column
from imu_allan.noise.groups import FLICKER
from imu_allan.noise.intervals import Estimate, estimate
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.trial import OBSERVABLE, Trial
from imu_allan.noise.walk_in_parts import either


def with_doubt_of_process(trial: Trial, dt: float, plain: Estimate, widening: float = 1.0
                          ) -> Estimate:
    """
    Widen the interval of flicker by what a process that was not told would leave of it.

    Parameters
    ----------
    trial : Trial
        Whose terms and band are those of the fit, without a process.
    dt : float
        Sample interval in seconds.
    plain : Estimate
        Of the flicker in it.
    widening : float, optional
        As for `estimate`.

    Returns
    -------
    Estimate
        The hull of the plain interval and of that beside the likeliest process.

    """
    time = promising_time(trial, dt)
    if time is None:
        return plain
    groups = with_process_column(trial.groups, trial.rolling, dt, time)
    beside = replace(trial, groups=groups, solution=maximise(
        groups, None, fixed=trial.fixed, trend='restricted'))
    if 2 * (trial.solution.loss - beside.solution.loss) < OBSERVABLE * trial.dispersion:
        return plain
    return either(plain, estimate(beside, FLICKER, widening))
