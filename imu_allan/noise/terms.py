# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The noise terms of an inertial sensor and their Allan variances.

Terms, symbols and formulas are those of IEEE Std 952 (Annex C). A sample is the average of the
continuous rate over the sample interval; then the formulas hold at every cluster size.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from math import cos, gamma, log, pi, sqrt

from imu_allan.arrays import Array
from imu_allan.noise.gauss_markov_means import rest_of_mean
from imu_allan.result import Tone
import numpy as np
from numpy.typing import ArrayLike

FLICKER_FLOOR = sqrt(2 * log(2) / pi)
"""Allan deviation of flicker relative to its bias instability B: 0.66428."""


class Quantity(str, Enum):
    """Physical quantity of an axis, named after the field in sensor_msgs/Imu."""

    ANGULAR_VELOCITY = 'angular_velocity'
    LINEAR_ACCELERATION = 'linear_acceleration'

    @property
    def unit(self) -> str:
        """SI unit of a sample (REP-103)."""
        return 'rad/s' if self is Quantity.ANGULAR_VELOCITY else 'm/s^2'


AXES = {f'{sensor}_{letter}': quantity
        for sensor, quantity in zip(('gyro', 'accel'), Quantity, strict=True) for letter in 'xyz'}
"""The six axes of an Imu message, in the column order of every sample array."""


@dataclass(frozen=True)
class Term:
    """
    One term of the Allan variance.

    Attributes
    ----------
    key : str
        Name in result files, topics, model and datasheet files.
    symbol : str
        Letter of IEEE Std 952.
    gyro_name, accel_name : str
        Name of the term for a gyroscope and for an accelerometer.
    slope : float
        Slope of the Allan deviation on log-log axes.
    read_at : float or None
        Averaging time in seconds at which the line of the term equals the coefficient. None for
        the flat term, whose line lies at ``FLICKER_FLOOR`` times its coefficient.
    gyro_unit, accel_unit : str
        SI unit of the coefficient.

    """

    key: str
    symbol: str
    gyro_name: str
    accel_name: str
    slope: float
    read_at: float | None
    gyro_unit: str
    accel_unit: str

    def unit(self, quantity: Quantity) -> str:
        """SI unit of the coefficient for `quantity`."""
        return self.gyro_unit if quantity is Quantity.ANGULAR_VELOCITY else self.accel_unit

    def name(self, quantity: Quantity) -> str:
        """Name of the term for `quantity`, as used in the field."""
        return self.gyro_name if quantity is Quantity.ANGULAR_VELOCITY else self.accel_name

    def adev(self, coefficient: float, tau: ArrayLike) -> Array:
        """
        Allan deviation of this term alone.

        `coefficient`: in the SI unit of the term. `tau`, shape (n,): averaging times in seconds.
        Returns shape (n,): in the unit of a sample.
        """
        tau = np.asarray(tau, dtype=np.float64)
        if self.read_at is None:
            return np.full(tau.shape, FLICKER_FLOOR * abs(coefficient))
        return np.asarray(abs(coefficient) * (tau / self.read_at) ** self.slope)


TERMS: dict[str, Term] = {
    term.key: term
    for term in (
        Term('quantization_noise', 'Q', 'quantization noise', 'quantization noise',
             -1.0, sqrt(3), 'rad', 'm/s'),
        Term('noise_density', 'N', 'angle random walk', 'velocity random walk',
             -0.5, 1.0, 'rad/s/sqrt(Hz)', 'm/s^2/sqrt(Hz)'),
        Term('bias_instability', 'B', 'bias instability', 'bias instability',
             0.0, None, 'rad/s', 'm/s^2'),
        Term('rate_random_walk', 'K', 'rate random walk', 'acceleration random walk',
             0.5, 3.0, 'rad/s^2/sqrt(Hz)', 'm/s^3/sqrt(Hz)'),
        Term('rate_ramp', 'R', 'drift rate ramp', 'drift ramp',
             1.0, sqrt(2), 'rad/s^2', 'm/s^3'),
    )
}
"""The five power-law terms by key, in order of slope."""

LASTING_TERMS = ('noise_density', 'bias_instability', 'rate_random_walk')
"""N, B and K belong to the sensor itself; Q belongs to its output, R to a single record."""
SPECTRAL_TERMS = ('quantization_noise', *LASTING_TERMS)
"""Terms that are noise and have a spectrum: all but the ramp."""
SLOW_TERMS = ('bias_instability', 'rate_random_walk')
"""Noise terms that a filter tracks as a bias, and that need the longest records."""


def gauss_markov_avar(sigma: float, correlation_time_s: float, tau: ArrayLike) -> Array:
    """
    Allan variance of a first-order Gauss-Markov process.

    `sigma`: standard deviation, in the unit of a sample. `correlation_time_s`: correlation time.
    `tau`, shape (n,): averaging times in seconds. Returns shape (n,):
    2 sigma^2 T/tau [1 - T/(2 tau) (3 - 4 exp(-tau/T) + exp(-2 tau/T))].

    References
    ----------
    IEEE Std 952-1997, C.1.1.6 (exponentially correlated noise).

    Examples
    --------
    Its deviation is highest at 1.89 correlation times, where it is 0.617 sigma:

    >>> np.sqrt(gauss_markov_avar(1.0, 100.0, [10.0, 189.0, 10_000.0])).round(3)
    array([0.249, 0.617, 0.14 ])

    """
    # The variance of a mean minus the covariance of neighbours.
    return np.asarray(sigma**2 * rest_of_mean(correlation_time_s, tau))


def power_law_avar(amplitude: float, exponent: float, tau: ArrayLike) -> Array:
    """
    Allan variance of noise whose two-sided density is ``amplitude**2/(2 pi f)**exponent``.

    `amplitude`: a noise density for exponent 0, a bias instability for 1, a random walk for 2.
    `exponent`: above -1, below 3. `tau`, shape (n,): averaging times in seconds. Returns shape
    (n,): amplitude^2 tau^(a - 1) (4 - 2^(1 + a))/(2 cos(pi a/2) Gamma(2 + a)) for exponent a.

    References
    ----------
    J. A. Barnes et al., "Characterization of frequency stability", IEEE Trans. Instrum. Meas. 20
    (1971): the integral (2) of docs/statistics.md of a power law.

    Examples
    --------
    White noise, flicker and a random walk of amplitude 1:

    >>> [power_law_avar(1.0, exponent, [9.0]).round(4).item() for exponent in (0.0, 1.0, 2.0)]
    [0.1111, 0.4413, 3.0]

    """
    # For exponent 1, numerator and denominator are both zero.
    factor = (2 * log(2) / pi if exponent == 1
              else (4 - 2 ** (1 + exponent)) / (2 * cos(pi * exponent / 2) * gamma(2 + exponent)))
    return np.asarray(amplitude**2 * factor * np.asarray(tau, dtype=np.float64) ** (exponent - 1))


def line_avar(frequency_hz: float, amplitude: float, tau: ArrayLike) -> Array:
    """
    Allan variance of a sine wave.

    `frequency_hz`, `amplitude`: of the sine wave. `tau`, shape (n,): averaging times in seconds.
    Returns shape (n,): [a sin^2(pi f tau)/(pi f tau)]^2, zero at whole numbers of periods.

    References
    ----------
    IEEE Std 952-1997, C.1.1.7 (sinusoidal noise).

    Examples
    --------
    >>> np.sqrt(line_avar(1.0, 0.2, [0.5, 1.0])).round(4)
    array([0.1273, 0.    ])

    """
    x = np.pi * (frequency_hz * np.asarray(tau, dtype=np.float64))
    return np.asarray((amplitude * np.sin(x) ** 2 / x) ** 2)


def line_power(tones: Iterable[Tone], interval_s: ArrayLike) -> Array:
    """Return the variance that lines of random phase cause in the mean over an interval."""
    interval = np.asarray(interval_s, dtype=np.float64)
    total = np.zeros(interval.shape)
    for tone in tones:
        total = total + tone.amplitude**2 / 2 * np.sinc(tone.frequency_hz * interval) ** 2
    return total


def filtered_share(size: ArrayLike, nu: ArrayLike, passed: ArrayLike) -> Array:
    """
    Share of the Allan variance of white noise that is left behind a filter.

    Parameters
    ----------
    size : array_like, shape (n,)
        Samples in a cluster.
    nu : array_like, shape (k,)
        Rising frequencies in cycles per sample; below the first one, everything passes.
    passed : array_like, shape (k,)
        Share of the power that passes at these frequencies.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    The mean of two samples: a quarter of the variance at first, all of it later.

    >>> nu = np.geomspace(1e-4, 0.5, 500)
    >>> filtered_share([1, 2, 1000], nu, np.cos(np.pi * nu)**2).round(2)
    array([0.25, 0.62, 1.  ])

    """
    nu, size = np.asarray(nu, np.float64), np.asarray(size, np.float64)
    octaves = np.log2(0.5 / nu[0])
    step = octaves / np.ceil(32 * octaves)
    fine = nu[0] * 2.0 ** (step * np.arange(round(octaves / step) + 1))
    passes = np.interp(np.log(fine), np.log(nu), np.asarray(passed, np.float64))
    # The share varies slowly with the cluster size: four sizes an octave are enough.
    known = np.unique(np.rint(2.0 ** (np.arange(4 * np.log2(size.max()) + 1) / 4)))[:, None]
    # Beyond a few cycles, the sine is as good as its mean over a band.
    above = np.where(known * fine < 4, np.sin(np.pi * known * fine)**4, 3 / 8)
    weight = 4 * above / (known * np.sin(np.pi * fine)**2) * fine * step * log(2)
    weight[:, [0, -1]] /= 2
    lost = weight @ (1 - passes)
    # Where little is left, the difference from 1 would be inexact.
    left = np.log(np.maximum(np.where(lost < 0.5, 1 - lost, weight @ passes), 1e-12))
    return np.asarray(np.exp(np.interp(np.log(size), np.log(known[:, 0]), left)))


def allan_variance(coefficients: dict[str, float], tau: ArrayLike) -> Array:
    """
    Allan variance of a sum of independent terms: equation (1) of docs/statistics.md.

    Parameters
    ----------
    coefficients : dict
        Coefficient by key of `TERMS`, SI units; a missing key means zero.
    tau : array_like, shape (n,)
        Averaging times in seconds.

    Returns
    -------
    ndarray, shape (n,)
        In the squared unit of a sample.

    Examples
    --------
    >>> allan_variance({'noise_density': 0.1, 'rate_ramp': 0.01}, [1.0, 100.0])
    array([0.01005, 0.5001 ])

    """
    tau = np.asarray(tau, dtype=np.float64)
    total = np.zeros(tau.shape)
    for key, value in coefficients.items():
        total = total + TERMS[key].adev(value, tau) ** 2
    return total
