# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Spectra of averaged samples.

All spectra are two-sided, in variance per unit of ``nu``, the frequency in cycles per sample
(``nu = f dt``). So the spectrum of white samples equals their variance. The mean of ``m`` samples
of such a process is the same process with ``m dt`` in place of ``dt``: the model is self-similar,
and one formula applies to every stage of decimation.

References
----------
IEEE Std 952-1997, Annex C. The sums over aliases are Hurwitz zeta functions, which for the random
walk reduce to elementary functions.

"""

from imu_allan.arrays import Array
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean
import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike
from scipy.special import zeta

# The Hurwitz zeta function at 1 - nu to 13 digits. At the thousands of frequencies of a record,
# that of scipy takes ten times as long.
_FLICKER_ALIASES = Chebyshev.interpolate(lambda nu: zeta(3, 1 - nu), 21, (0.0, 0.5))
# Mean power of the first orthonormal DCT-II coefficients of flicker, relative to its spectrum at
# j/(2 n). It is not 1 because the transform diagonalises flicker only asymptotically.
_FLICKER_DCT = np.array([.7737, .9028, .9311, .9499, .9592, .9664, .9709, .9747])


def white(nu: ArrayLike, dt: float) -> Array:
    """
    Spectrum of noise density 1, shape of `nu`: S_N of equation (3) of docs/statistics.md.

    Examples
    --------
    >>> white([0.1, 0.5], 0.01)
    array([100., 100.])

    """
    return np.full(np.shape(nu), 1.0 / dt)


def quantization(nu: ArrayLike, dt: float) -> Array:
    """
    Spectrum of quantization noise 1, shape of `nu`: S_Q of equation (3).

    Examples
    --------
    >>> quantization([0.25, 0.5], 1.0)
    array([2., 4.])

    """
    return np.asarray((2 * np.sin(np.pi * np.asarray(nu)) / dt) ** 2)


def random_walk(nu: ArrayLike, dt: float) -> Array:
    """
    Spectrum of rate random walk 1, shape of `nu`: S_K of equation (3).

    Examples
    --------
    Far below the sample rate it is dt/(2 pi nu)^2:

    >>> float((random_walk(1e-3, 0.01) * (2 * np.pi * 1e-3) ** 2 / 0.01).round(4))
    1.0

    """
    s2 = np.sin(np.pi * np.asarray(nu)) ** 2
    return np.asarray(dt * (1 - s2 / 1.5) / (4 * s2))


def flicker(nu: ArrayLike, dt: float) -> Array:
    """
    Spectrum of bias instability 1, shape of `nu`, the same for every `dt`: S_B of equation (3).

    Examples
    --------
    Far below the sample rate it is 1/(2 pi nu):

    >>> float((flicker(1e-3, 0.01) * 2 * np.pi * 1e-3).round(4))
    1.0

    """
    del dt
    nu = np.asarray(nu, dtype=np.float64)
    sine = np.sin(np.pi * nu)
    # By the reflection formula, zeta(3, nu) = zeta(3, 1 - nu) + pi^3 cos(pi nu)/sin(pi nu)^3.
    return np.asarray(sine**2 / np.pi**3 * _FLICKER_ALIASES(nu) + np.cos(np.pi * nu) / (2 * sine))


def power_law(nu: ArrayLike, dt: float, exponent: float) -> Array:
    """
    Spectrum of noise whose density is 1/(2 pi f)^exponent, shape of `nu`.

    `nu`, shape (n,): cycles per sample, in (0, 1/2]. `dt`: sample interval in seconds. `exponent`:
    between 0, white noise, and 2, a random walk; 1 is flicker. Returns shape (n,): the sum over
    all aliases, like S_B in equation (3) of docs/statistics.md.

    Examples
    --------
    >>> [bool(np.isclose(power_law(0.3, 0.1, 2.0), random_walk(0.3, 0.1))),
    ...  bool(np.isclose(power_law(0.3, 0.1, 1.0), flicker(0.3, 0.1)))]
    [True, True]

    """
    nu = np.asarray(nu, dtype=np.float64)
    s2 = np.sin(np.pi * nu) ** 2
    return np.asarray(dt ** (exponent - 1) * (2 * np.pi) ** -exponent * s2 / np.pi**2
                      * (zeta(2 + exponent, nu) + zeta(2 + exponent, 1 - nu)))


def gauss_markov(nu: ArrayLike, dt: float, correlation_time_s: float) -> Array:
    """
    Spectrum of a first-order Gauss-Markov process of unit standard deviation.

    `nu`, shape (n,): cycles per sample, in (0, 1/2]. `dt`: sample interval in seconds.
    `correlation_time_s`: of the process. Returns shape (n,): the summand of equation (8) of
    docs/statistics.md for averaged samples, summed over all aliases and divided by dt.

    Examples
    --------
    Far below the sample rate it is the spectrum of the continuous process, 2 T/(1 + (2 pi f T)^2):

    >>> f, dt, T = 0.01, 0.01, 1.0
    >>> density = gauss_markov([f * dt], dt, T) * dt
    >>> (density / (2 * T / (1 + (2 * np.pi * f * T) ** 2))).round(4)
    array([1.])

    """
    # Autocovariance of the averages: r0 at lag 0, tail exp(-(k - 1) dt/T) at lag k >= 1.
    r0, tail = mean_variance(correlation_time_s, dt), on_mean(correlation_time_s, dt)**2
    z = np.exp(2j * np.pi * np.asarray(nu))
    return np.asarray(r0 + 2 * tail * np.real(z / (1 - np.exp(-dt / correlation_time_s) * z)))


def flicker_dct_factor(j: ArrayLike) -> Array:
    """
    Mean power of DCT-II coefficient `j` of flicker, relative to its spectrum at ``j/(2 n)``.

    `j`, shape (n,): indices, at least 1. Returns shape (n,): about 1 - 2/(pi^2 j), less for the
    first few indices.

    Examples
    --------
    >>> flicker_dct_factor([1, 100]).round(4)
    array([0.7737, 0.998 ])

    """
    j = np.asarray(j)
    factor = 1 - 2 / (np.pi**2 * j)
    low = j <= len(_FLICKER_DCT)
    factor[low] = _FLICKER_DCT[j[low] - 1]
    return np.asarray(factor)


def ramp_dct(n: int, dt: float) -> Array:
    """
    Orthonormal DCT-II of a unit ramp (1 per second) of `n` samples, coefficients 1 to n - 1.

    `n`: length of the record. `dt`: sample interval in seconds. Returns shape (n - 1,): -dt
    cos(x)/(sqrt(2 n) sin(x)^2) with x = pi j/(2 n) at odd indices j, zero at even ones.

    Examples
    --------
    >>> from scipy.fft import dct
    >>> bool(np.allclose(ramp_dct(100, 0.5), dct(np.arange(100) * 0.5, norm='ortho')[1:]))
    True

    """
    j = np.arange(1, n)
    half = np.pi * j / (2 * n)
    value = -dt * np.sqrt(1 / (2 * n)) * np.cos(half) / np.sin(half) ** 2
    value[1::2] = 0
    return np.asarray(value)
