# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Goodness of fit of a noise model by half-octave, and how much less a misfitted spectrum counts.

References
----------
E. B. Wilson and M. M. Hilferty, Proc. Natl. Acad. Sci. 17 (1931): the cube root of a chi-square.
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.posterior import likelihood, thresholds_and_priors as thresholds
from imu_allan.noise.posterior.likelihood import LOW, N, Rows, Spectra
from imu_allan.noise.posterior.regression import residual_power
from imu_allan.noise.record.groups import half_octaves
import numpy as np

_FEWEST = 0.5
"""Degrees of freedom above which a half-octave has a residual; lines are left out."""


@dataclass(frozen=True)
class Goodness:
    """
    Goodness of fit of a noise model.

    Attributes
    ----------
    p_value, misfit : float
        Chi-square probability of the half-octave residuals, and their largest relative misfit
        beyond sampling error.
    acceptable : bool
        Whether the model describes enough of the noise, with tolerable residuals.
    divisors : ndarray, shape (groups,)
        Divisors for the degrees of freedom, from misfit and the uncertain shape of a filter.

    """

    p_value: float
    misfit: float
    acceptable: bool
    divisors: Array


def goodness_of_fit(spectra: Spectra, row: Rows) -> Goodness:
    """Test the residuals of a model by half-octave; there are none where all was left out."""
    [expected], _, [weight], size, covariance = likelihood.fitted_mean(spectra, row, row.x)
    residual = residual_power(spectra.power[row.spectrum], spectra.products[row.spectrum], size,
                              covariance)[0]
    dof = weight * expected
    _, octave = np.unique(half_octaves(spectra.frequency), return_inverse=True)
    count: Array = np.bincount(octave, dof).astype(np.float64)
    used = count > _FEWEST
    count = np.maximum(count, 1e-9)
    level = np.where(used, np.bincount(octave, dof * (residual / expected)) / count, 1.0)
    # Wilson-Hilferty: the cube root of a chi-square is normal even for a few degrees of freedom.
    normal = np.where(used, (np.cbrt(level) - (1 - 2 / (9 * count))) / np.sqrt(2 / (9 * count)), 0)
    free = max(int(used.sum()) - int(row.present.sum()), 1)
    p_value = float(chi_square.survival(float(normal @ normal), free))
    # A deviation counts as sampling error up to a tail probability of 1e-3.
    high = chi_square.upper(1e-3, count) / count
    low = chi_square.lower(1e-3, count) / count
    misfit = float(np.maximum(level - high, low - level).max(where=used, initial=0.0))
    acceptable = _described(spectra, row, expected) >= thresholds.LEAST_DESCRIBED and (
        p_value > thresholds.DESCRIBED or misfit <= thresholds.TOLERATED_MISFIT)
    attenuation = _attenuation(spectra, row)
    divisors = np.ones_like(attenuation)
    if attenuation.any():
        # Averages groups over half-octaves.
        averaging = np.where(
            octave == np.arange(len(count))[:, None], dof / count[octave], 0.0)
        _, slopes, parameters = likelihood.model_spectrum(spectra, row, row.x)
        *_, prior_information = likelihood.log_prior(spectra, row, row.x)
        error = _shape_error(
            normal * np.sqrt(2 / count), count / 2, averaging @ attenuation,
            averaging @ (slopes[:, 0] / expected).T, prior_information[0, parameters])
        nominal_dof = np.bincount(octave, spectra.nominal_dof[row.spectrum[0]])[octave]
        divisors = 1 + nominal_dof * (error * attenuation)**2 / 2
    if p_value < thresholds.DESCRIBED:
        divisors = _local_chi_square(normal)[octave] * divisors
    return Goodness(p_value, misfit, acceptable, divisors)


def _described(spectra: Spectra, row: Rows, expected: Array) -> float:
    """Return the share of the noise below the edge, white at the level there; 1 without one."""
    axis, edge = row.spectrum[0], int(row.edge[0])
    frequency, white = spectra.frequency, spectra.design[axis, N]
    if edge == len(frequency):
        return 1.0
    at = expected[edge - 1] / white[edge - 1]
    # The median passes over a vibration. What falls is unexplained all the same; what rises to
    # four times the level may be coarse quantization, which hides no more. Chosen by judgment.
    above = np.median(spectra.power[axis, edge:] / white[edge:])
    return float(1 / (1 + max(above / at / 4, 1.0) * (frequency[-1] / frequency[edge] - 1)))


def _local_chi_square(normal: Array) -> Array:
    """Return the mean square of residuals around each half-octave, and at least 1."""
    place = np.arange(len(normal))
    # Smoothed by a Gaussian of 1.5 half-octaves, with one more residual of 1.
    weight = np.exp(-0.5 * ((place[:, None] - place) / 1.5)**2)
    return np.asarray(np.maximum((weight @ normal**2 + 1) / (weight.sum(axis=1) + 1), 1.0))


def _attenuation(spectra: Spectra, row: Rows) -> Array:
    """Return how much the filter of a row attenuates each group, as a power of e."""
    attenuation, edge = np.zeros(len(spectra.frequency)), int(row.edge[0])
    if edge < len(attenuation):
        # What attenuates the unexplained groups begins below them.
        attenuation = np.minimum((spectra.frequency / spectra.frequency[edge])**2, 1.0)
    if row.present[0, LOW]:
        [log_response], _ = spectra.tables.low_pass.interpolated(row.low_pass, row.x[:, LOW])
        attenuation = np.maximum(attenuation, -log_response)
    return attenuation


def _shape_error(residual: Array, weight: Array, attenuation: Array, slopes: Array,
                 prior_information: Array) -> float:
    """
    Estimate the relative error of a filter's power, for each factor e that it attenuates.

    By restricted likelihood, since the fit of the parameters hides a part of the error. Shapes are
    (half-octaves,), of `slopes` by the parameters (half-octaves, parameters), of
    `prior_information` (parameters,). `weight`: inverse variance of the relative residuals.
    """
    errors = np.geomspace(1e-4, 1, 81)
    weights = weight / (1 + weight * (errors[:, None] * attenuation)**2)
    information = np.einsum('eh,hi,hj->eij', weights, slopes, slopes) + np.diag(
        prior_information + 1e-9)
    along = (weights * residual) @ slopes
    fitted = np.linalg.solve(information, along[:, :, None])[..., 0]
    off = np.log(errors / thresholds.SHAPE_MEDIAN) / thresholds.SHAPE_SPREAD
    log_density = 0.5 * (
        np.log(weights).sum(axis=1) - weights @ residual**2 + (along * fitted).sum(axis=1)
        - np.linalg.slogdet(information)[1] - off**2)
    return float(np.sqrt(np.average(errors**2, weights=np.exp(log_density - log_density.max()))))
