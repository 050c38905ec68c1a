# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise coefficients from several records of one sensor, by their joint likelihood.

The records are independent given the coefficients, so their likelihoods multiply, and their
spectra are fitted side by side. All records share the noise. The trends of the mean are determined
from each record alone; they enter the joint model as separate regressors, like each ramp.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise.axis_fit import AxisFit
from imu_allan.noise.posterior.posterior import posteriors
from imu_allan.noise.posterior.report import reported
from imu_allan.noise.record.groups import joined_groups
from imu_allan.result import Tone


def joint_fit(records: Sequence[AxisFit], dt: float) -> AxisFit:
    """
    Fit one axis to several records at once: equation (7) of docs/statistics.md, summed over them.

    Parameters
    ----------
    records : sequence of AxisFit
        Results of `fit_axes` for the axis in each record, all of the same sample interval.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    AxisFit
        There are no joint trends: those of the mean belong to single records.

    Examples
    --------
    >>> from imu_allan.noise.axis_fit import fit_axes
    >>> from imu_allan.noise.record.estimator import Estimator
    >>> from imu_allan.noise.simulate import simulate
    >>> fits = []
    >>> for seed in range(2):
    ...     estimator = Estimator()
    ...     estimator.update(simulate({'noise_density': 1e-3}, 20_000, 100.0, seed))
    ...     fits += fit_axes(estimator.finished(), 0.01)
    >>> density = joint_fit(fits, 0.01).fit.estimates['noise_density']
    >>> bool(density.low < 1e-3 < density.high)
    True

    """
    groups = joined_groups([one.record.groups() for one in records if one.record is not None])
    [posterior] = posteriors([groups], dt)
    # Noise that changes within a record is as uncertain over all of them. Where none is known to
    # change, it is that of the record which is least likely to be steady.
    change = max((one.change for one in records), key=lambda one: (one.typical, -one.weight[0]))
    report = reported(replace(posterior, change=change), dt,
                      quarters=[one.quarters for one in records])
    corners_hz = [one.fit.high_pass_hz for one in records if one.fit.high_pass_hz is not None]
    if corners_hz:
        report = replace(report, high_pass_hz=max(corners_hz))
    with_lines = joined_groups([one.with_lines for one in records])
    return AxisFit(report, _lines(records), groups, with_lines)


def _lines(records: Sequence[AxisFit]) -> list[Tone]:
    """Return the lines of all records by amplitude, each once with its largest amplitude."""
    kept: list[Tone] = []
    for line in sorted((line for one in records for line in one.lines),
                       key=lambda line: -line.amplitude):
        # The lines of a sensor drift by this much between records.
        if all(abs(line.frequency_hz - other.frequency_hz) > 2e-3 * other.frequency_hz
               for other in kept):
            kept.append(line)
    return kept
