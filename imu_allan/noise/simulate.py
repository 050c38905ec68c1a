# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Simulation of the samples of an inertial sensor.

`simulate` draws a whole record. Its averaged samples have exactly the covariance of the model, at
every cluster size. The usual approximations (filtered flicker, a running sum for the random walk)
err by up to 44 % in Allan variance at the shortest averaging times. `NoiseStream` draws the
same process in blocks without end, for a live simulated sensor. There flicker is a sum of averaged
Gauss-Markov processes, whose spectrum is within 0.2 % of 1/f up to periods of years.

References
----------
R. B. Davies and D. S. Harte, "Tests for Hurst effect", Biometrika 74 (1987): circulant embedding.

"""

from collections.abc import Mapping
from typing import Any

from imu_allan.arrays import Array
from imu_allan.errors import positive, real, shown, whole
from imu_allan.noise.gauss_markov_means import on_mean, rest_of_mean
from imu_allan.noise.terms import TERMS
import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter


def simulate(coefficients: Mapping[str, Any], samples: int, sample_rate_hz: float,
             seed: int = 0) -> Array:
    """
    Draw one axis, exactly with the spectra (3) of docs/statistics.md.

    Parameters
    ----------
    coefficients : mapping
        SI coefficient by key of `TERMS`, and optionally ``gauss_markov``, a mapping with ``sigma``
        and ``correlation_time_s``, and ``mean``. A missing key means that the term is absent.
    samples : int
        Length of the record.
    sample_rate_hz : float
        Samples per second.
    seed : int, optional
        The same seed gives the same record. Each term has its own random stream, so that leaving
        one out does not change the others.

    Returns
    -------
    ndarray, shape (samples,)
        In the unit of a sample.

    Raises
    ------
    ValueError
        If a key is unknown, one of `gauss_markov` is missing, a number other than ramp and mean is
        negative, or `samples` or `sample_rate_hz` is not positive.

    Examples
    --------
    >>> record = simulate({'noise_density': 1e-3}, 100_000, 100.0)
    >>> round(float(record.std()), 3)  # N / sqrt(dt)
    0.01

    """
    _check(coefficients)
    seed, samples = whole('seed', seed), whole('samples', samples, 1)
    own = {**coefficients, 'bias_instability': 0.0}
    total = NoiseStream(own, sample_rate_hz, seed, settled=True).draw(samples)
    if exact := float(coefficients.get('bias_instability', 0.0)):
        total += exact * _flicker(samples, _stream_of('bias_instability', seed))
    return total


def _stream_of(key: str, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, [*TERMS, 'gauss_markov'].index(key)])


class NoiseStream:
    """
    Endless stream of samples of one axis, drawn in blocks and in constant memory.

    Parameters
    ----------
    coefficients : mapping
        As for `simulate`.
    sample_rate_hz : float
    seed : int, optional
    settled : bool, optional
        Whether slow processes begin anywhere, not at zero.

    """

    def __init__(self, coefficients: Mapping[str, Any], sample_rate_hz: float,
                 seed: int = 0, *, settled: bool = False) -> None:
        _check(coefficients)
        self._c = {key: float(coefficients.get(key, 0.0)) for key in (*TERMS, 'mean')}
        self._dt = 1.0 / positive('sample_rate_hz', sample_rate_hz)
        self._rng = {key: _stream_of(key, seed) for key in TERMS}
        self._index = 0
        self._phase = float(self._rng['quantization_noise'].standard_normal())
        self._walk = 0.0
        self._fast_flicker = 0.0
        times, sigmas = [], []
        if self._c['bias_instability']:
            # Ratio of successive correlation times: the Allan deviation has ripples of 0.03 %
            # (0.01 % with a ratio of 2, 0.5 % with 8).
            ratio = 4.0
            # Up to ten years, so that the noise is flicker for as long as any stream runs.
            count = np.log(3e8 / (self._dt / 64)) / np.log(ratio)
            bank_times = self._dt / 64 * ratio ** np.arange(int(np.ceil(count)))
            times += list(bank_times)
            sigma = self._c['bias_instability'] * np.sqrt(np.log(ratio) / np.pi)
            sigmas += [sigma] * len(bank_times)
            # Processes faster than the bank are white in the samples; their sum is geometric.
            self._fast_flicker = sigma * np.sqrt(2 / 64 / (ratio - 1))
        markov = coefficients.get('gauss_markov')
        if markov:
            times.append(float(markov['correlation_time_s']))
            sigmas.append(float(markov['sigma']))
        self._bank = MarkovBank(np.array(times), np.array(sigmas), self._dt,
                                _stream_of('gauss_markov', seed), settled=settled)

    def draw(self, samples: int) -> Array:
        """Return the next `samples` samples, shape (samples,), in the unit of a sample."""
        c, dt, rng = self._c, self._dt, self._rng
        total = np.full(samples, c['mean'])
        if c['quantization_noise']:
            phase = np.concatenate(([self._phase],
                                    rng['quantization_noise'].standard_normal(samples)))
            self._phase = float(phase[-1])
            total += c['quantization_noise'] / dt * np.diff(phase)
        if c['noise_density']:
            total += c['noise_density'] / np.sqrt(dt) * rng['noise_density'].standard_normal(
                samples)
        if c['rate_random_walk']:
            averages, self._walk = _random_walk(samples, rng['rate_random_walk'], self._walk)
            total += c['rate_random_walk'] * np.sqrt(dt) * averages
        if c['rate_ramp']:
            total += c['rate_ramp'] * dt * (self._index + np.arange(samples))
        if self._fast_flicker:
            total += self._fast_flicker * rng['bias_instability'].standard_normal(samples)
        total += self._bank.draw(samples)
        self._index += samples
        return total


def _check(coefficients: Mapping[str, Any]) -> None:
    if not isinstance(coefficients, Mapping):
        raise TypeError(f'coefficients must be a mapping, not {type(coefficients).__name__}')
    unknown = set(coefficients) - set(TERMS) - {'gauss_markov', 'mean'}
    if unknown:
        raise ValueError(f'unknown noise term {sorted(unknown)[0]!r}; known: {", ".join(TERMS)}')
    markov = coefficients.get('gauss_markov') or {}
    if markov and not (isinstance(markov, Mapping)
                       and set(markov) == {'sigma', 'correlation_time_s'}):
        raise ValueError(f'gauss_markov needs sigma and correlation_time_s, not {shown(markov)}')
    for key, given in {**coefficients, 'gauss_markov': 0.0, **markov}.items():
        value, signed = real(given), key in ('rate_ramp', 'mean')
        if value is None or not (np.isfinite(value) and (value >= 0 or signed)):
            raise ValueError(f'{key} must be a number in SI units'
                             f'{"" if signed else ", zero or more"}, not {shown(given)}')
    if markov:
        positive('correlation_time_s', markov['correlation_time_s'])


def _random_walk(samples: int, rng: np.random.Generator, start: float = 0.0
                 ) -> tuple[Array, float]:
    """Draw averages of a random walk of unit step per interval; return also its end value."""
    step = rng.standard_normal(samples)
    ends = start + np.cumsum(step)
    # A sample is the mean of the random walk over its interval. It lacks half of the last step,
    # and includes the mean of the Brownian bridge between the ends, of variance 1/12.
    within = rng.standard_normal(samples) / np.sqrt(12) - step / 2
    return ends + within, float(ends[-1]) if samples else start


def _flicker(samples: int, rng: np.random.Generator) -> Array:
    """Draw averaged flicker of unit bias instability, which begins at zero."""
    if samples == 1:
        return np.zeros(1)
    half = next_fast_len(samples, real=True)
    lag = np.arange(-2.0, half + 3)
    # `phase` is the generalised covariance of the phase of the noise. Its fourth difference is
    # the covariance of the first difference of the averaged samples.
    phase = lag**2 * np.log(np.maximum(np.abs(lag), 1)) / (2 * np.pi)
    covariance = phase[4:] + phase[:-4] - 4 * (phase[3:-1] + phase[1:-3]) + 6 * phase[2:-2]
    # Beyond a lag of 1e4, use the series, as the difference of large numbers loses digits.
    far = np.arange(half + 1) > 1e4
    h = np.arange(half + 1)[far].astype(np.float64)
    covariance[far] = -(1 / h**2 + 1 / h**4) / (2 * np.pi) * 2
    power = rfft(np.concatenate((covariance, covariance[-2:0:-1]))).real
    n = 2 * half
    power = np.maximum(power, 0)
    normal = rng.standard_normal((2, half + 1))
    spectrum = np.sqrt(power * n / 2) * (normal[0] + 1j * normal[1])
    spectrum[0] = np.sqrt(power[0] * n) * normal[0, 0]
    spectrum[-1] = np.sqrt(power[-1] * n) * normal[0, -1]
    steps = irfft(spectrum, n)[:samples - 1]
    return np.concatenate(([0.0], np.cumsum(steps)))


class MarkovBank:
    """
    Sum of averaged first-order Gauss-Markov processes, drawn exactly.

    Attributes
    ----------
    decay, gain, end, mean_on_end, mean_rest : ndarray, shape (processes,)
        Coefficients of each process over one interval. `decay` is the share of its value that
        remains, `gain` the effect of the value on the mean. `end` is the standard deviation of
        the innovation; the mean depends on it by `mean_on_end`, and varies by `mean_rest` beside.

    """

    def __init__(self, times: Array, sigmas: Array, dt: float, rng: np.random.Generator, *,
                 settled: bool = True) -> None:
        self._rng = rng
        # Joint distribution of end value and mean of an Ornstein-Uhlenbeck process.
        self.decay = np.exp(-dt / times)
        self.gain = sigmas * on_mean(times, dt)
        self.end = np.sqrt(-np.expm1(-2 * dt / times))
        on_end = on_mean(times, dt) * -np.expm1(-dt / times) / self.end
        self.mean_on_end = sigmas * on_end
        self.mean_rest = sigmas * np.sqrt(np.maximum(rest_of_mean(times, dt) - on_end**2, 0))
        # A stream starts slow processes at zero, so that its mean starts at that of the model.
        self._state = np.where(settled | (times < 10 * dt), rng.standard_normal(len(times)), 0.0)

    def draw(self, samples: int) -> Array:
        total = np.zeros(samples)
        for i, decay in enumerate(self.decay):
            drive = self._rng.standard_normal(samples)
            ends, _ = lfilter([1.0], [1.0, -decay], self.end[i] * drive,
                              zi=[decay * self._state[i]])
            starts = np.concatenate(([self._state[i]], ends[:-1]))
            total += self.gain[i] * starts + self.mean_on_end[i] * drive
            total += self.mean_rest[i] * self._rng.standard_normal(samples)
            if samples:
                self._state[i] = ends[-1]
        return total
