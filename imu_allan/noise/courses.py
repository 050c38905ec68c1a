# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Courses of the mean laid to a fit: what they explain, and what is left for a random walk.

Parameters of the mean are compared by the likelihood, walks by the restricted likelihood under the
same regressors.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from imu_allan.noise import chi_square
from imu_allan.noise.groups import Spectra, WALK
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.mean_in_blocks import Course
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.trends import EachCourse, JointSpectrum, own_courses, RecordSpectrum
from imu_allan.noise.trial import OBSERVABLE, residuals, Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Spectrum = RecordSpectrum | JointSpectrum

Value = TypeVar('Value')
Calmed = Callable[[Course], tuple[Steadiness | None, Spectra]]
"""Gives what parts of a record say of each other, and their spectra, without a course of it."""

_SLOW = 128
"""Coefficients by which candidates are ranked: the faster ones do not see them."""


def in_each(level: float, amplitudes: int, records: int) -> float:
    """Likelihood ratio as rare as `level`, where every record has amplitudes of its own."""
    if records == 1:
        return level
    return float(chi_square.upper(float(chi_square.survival(level, amplitudes)),
                                  amplitudes * records))


def with_courses(trial: Trial, record: Spectrum, courses: Sequence[Course | EachCourse]) -> Trial:
    """Fit the same columns of the same band again, with courses of the mean beside the ramp."""
    full = record.groups(*courses)
    if trial.edge_hz is not None:
        full = full.below(trial.edge_hz)
    groups = replace(trial.groups, along=full.along, among=full.among, record=full.record)
    solution = maximise(groups, trial.solution, fixed=trial.fixed, trend='restricted')
    p_value, misfit, dispersion = residuals(groups, solution)
    return replace(trial, groups=groups, solution=solution, p_value=p_value, misfit=misfit,
                   dispersion=dispersion)


def has_walk(trial: Trial) -> bool:
    """Whether the walk of a fit is observable."""
    limit = trial.solution.loss + OBSERVABLE * trial.dispersion / 2
    return maximise(trial.groups, trial.solution, fixed={**trial.fixed, WALK: 0.0},
                    trend='restricted', tolerance=1e-3, limit=limit).loss >= limit


def likelihood_ratio(without: Trial, beside: Trial) -> float:
    """Likelihood ratio of courses of the mean, the noise fitted with and without."""
    plain = maximise(without.groups, without.solution, fixed=without.fixed, trend='likely',
                     tolerance=1e-3)
    fitted = maximise(beside.groups, beside.solution, fixed=beside.fixed, trend='likely',
                      tolerance=1e-3)
    return 2 * (plain.loss - fitted.loss) / without.dispersion


def best_course(trial: Trial, record: Spectrum, still: Solution, values: Sequence[Value],
                courses: Callable[[Value], Sequence[Course | EachCourse]]
                ) -> tuple[Value, float]:
    """Rank candidates by what they explain under noise without a walk: the best, and how much."""
    candidates = [courses(value) for value in values]
    gains = np.zeros(len(values))
    for number, one in enumerate(record.records):
        gains += _gains(trial, one, still, [own_courses(some, number) for some in candidates])
    best = int(np.argmax(gains))
    return values[best], float(gains[best]) / trial.dispersion


def _gains(trial: Trial, record: RecordSpectrum, still: Solution,
           candidates: Sequence[Sequence[Course]]) -> Array:
    """Fall of twice the loss that each candidate brings to one record, shape (candidates,)."""
    slow = record.slowest(_SLOW)
    columns = slow.regressors([course for some in candidates for course in some])
    theta = still.theta[:slow.design.shape[1]].copy()
    if trial.rolling:
        theta[0] = 0.0
    weight = 1 / np.maximum(slow.design @ theta, 1e-300)
    # What the ramp and the courses of the record explain is taken out of both sides.
    known = np.column_stack((slow.ramp, slow.regressors(record.courses))) if record.courses \
        else slow.ramp[:, None]
    root = np.sqrt(weight)[:, None]
    basis = np.linalg.qr(root * known)[0]
    signal = (slow.coefficient - (basis @ (basis.T @ (root[:, 0] * slow.coefficient)))
              / root[:, 0])
    columns = columns - basis @ (basis.T @ (root * columns)) / root
    each = columns.reshape(len(columns), len(candidates), -1)
    target = np.einsum('nca,n->ca', each, weight * signal)
    gram = np.einsum('nca,ncb,n->cab', each, each, weight, optimize=True)
    # A course that nothing of the record sees, a step between two runs, explains nothing.
    ridge = 1e-9 * np.einsum('caa->c', gram) + np.finfo(np.float64).tiny
    gram = gram + ridge[:, None, None] * np.eye(each.shape[2])
    return np.asarray(
        np.einsum('ca,ca->c', target, np.linalg.solve(gram, target[..., None])[..., 0]))
