# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Simulated sensors whose truth is known, and the bound on what anybody can know of them.

The generator is not imu_allan's: the first difference of the averaged noise, all terms in one, is
drawn by circulant embedding from its covariance. Record r of case c has the seed
``[20261123, c, r]`` of numpy's default generator.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.recordings.write import write_recording
import numpy as np
from recorded import Array, AXES, B, K, N, Q, Recorded
from scipy.signal import butter, lfilter
from scipy.special import zeta

SEED = 20261123
START_NS = 1_700_000_000 * 10**9
DEGREE = np.pi / 180
_ACCEL = 10.0
"""Numbers of an accelerometer in m/s^2 over those of the gyroscope in rad/s."""
_SETTLING = 4000
CASE_A = {N: 0.0045 * DEGREE, B: 0.0014 * DEGREE, K: 6.5e-5 * DEGREE}
CASE_B = CASE_A | {K: 2.5e-4 * DEGREE}


@dataclass(frozen=True)
class Case:
    """
    A sensor and what befalls it.

    Attributes
    ----------
    title : str
    terms : mapping
        Coefficients of the gyroscope in SI units.
    rate_hz, hours : float
    low_pass : tuple, optional
        Numerator and denominator of a filter in the sensor.
    warm_up : float
        What the mean has to fall yet, in units of B, with a time constant of 10 min.
    outages : int
        Times of 20 s without messages.

    """

    title: str
    terms: Mapping[str, float]
    rate_hz: float = 100.0
    hours: float = 1.0
    low_pass: tuple[Array, Array] | None = None
    warm_up: float = 0.0
    outages: int = 0


CASES = {
    'a': Case('N, B, K: case A, 100 Hz, 3 h', CASE_A, hours=3.0),
    'b': Case('N, B, K: case B, 200 Hz, 1 h', CASE_B, rate_hz=200.0),
    'mems': Case('the founding MEMS, N and B, 1 h', {N: 0.03 * DEGREE, B: 18 * DEGREE / 3600}),
    'laser': Case('a ring laser, Q and N, 1 h', {Q: 1.62e-6, N: 0.015 * DEGREE / 60}),
    'white': Case('white noise alone, 1 h', {N: CASE_A[N]}),
    'walk': Case('N and K, 1 h', {N: CASE_A[N], K: CASE_B[K]}),
    'first': Case('case B behind a low-pass of first order, 20 Hz', CASE_B,
                  low_pass=butter(1, 20, fs=100.0)),
    'second': Case('case B behind a low-pass of second order, 5 Hz', CASE_B,
                   low_pass=butter(2, 5, fs=100.0)),
    'boxcar': Case('case B behind a mean of eight samples', CASE_B,
                   low_pass=(np.full(8, 1 / 8), np.ones(1))),
    'quantization': Case('case B with quantization noise', CASE_B | {Q: 2e-6}),
    'warm-up': Case('N and B, warming up by 10 B', {N: CASE_A[N], B: CASE_A[B]}, warm_up=10.0),
    'gaps': Case('case B with six outages of 20 s', CASE_B, outages=6),
}


def difference_covariance(terms: Mapping[str, float], dt: float, lags: int) -> Array:
    """Return the covariance of the first difference of averaged samples, at 0 to lags - 1."""
    h = np.abs(np.arange(-2, lags + 2, dtype=float))
    with np.errstate(divide='ignore', invalid='ignore'):
        flicker = np.where(h > 0, h**2 * np.log(h), 0.0)
    # Generalised covariance of the angle, and the second difference of it on both sides.
    angle = (-terms.get(N, 0.0)**2 * h * dt / 2 + terms.get(K, 0.0)**2 * (h * dt)**3 / 12
             + terms.get(B, 0.0)**2 * dt**2 * flicker / (2 * np.pi)
             + terms.get(Q, 0.0)**2 * (h == 0))
    weights = (1.0, -4.0, 6.0, -4.0, 1.0)
    found = sum(w * angle[i:i + lags] for i, w in enumerate(weights)) / dt**2
    # Fourth differences of large numbers: what is left of them far out is rounding.
    far = np.arange(lags) > 3000
    exact = terms.get(B, 0.0)**2 / np.pi / np.maximum(np.arange(lags), 1.0)**2
    return np.asarray(np.where(far, -exact, found))


def noise(terms: Mapping[str, float], rate_hz: float, count: int,
          rng: np.random.Generator) -> Array:
    """Draw two records of averaged samples, columns, exactly distributed up to a constant."""
    half = 1 << int(np.ceil(np.log2(count)))
    covariance = difference_covariance(terms, 1 / rate_hz, half + 1)
    spectrum = np.fft.rfft(np.concatenate([covariance, covariance[-2:0:-1]])).real
    worst = -spectrum.min() / spectrum.max()
    assert worst < 1e-6, f'not a covariance: {worst}'
    amplitude = np.sqrt(np.maximum(np.concatenate([spectrum, spectrum[-2:0:-1]]), 0.0)
                        / (2 * half))
    drawn = np.fft.fft(amplitude * (rng.standard_normal(2 * half)
                                    + 1j * rng.standard_normal(2 * half)))[:count]
    return np.cumsum(np.column_stack([drawn.real, drawn.imag]), axis=0)


def truth(case: Case, axis: str) -> dict[str, float]:
    """Return the coefficients of an axis in SI units; what is absent is not there."""
    scale = 1.0 if axis.startswith('gyro') else _ACCEL
    return {key: scale * value for key, value in case.terms.items()}


def record(key: str, number: int, folder: Path) -> Recorded:
    """Draw a record of a case and write it as a recording."""
    case = CASES[key]
    rng = np.random.default_rng([SEED, list(CASES).index(key), number])
    count = round(case.hours * 3600 * case.rate_hz)
    drawn = count + (_SETTLING if case.low_pass else 0)
    samples = np.hstack([noise(case.terms, case.rate_hz, drawn, rng) for _ in range(3)])
    if case.low_pass:
        samples = lfilter(*case.low_pass, samples, axis=0)[_SETTLING:]
    if case.warm_up:
        time = np.arange(count)[:, np.newaxis] / case.rate_hz
        samples = samples + case.warm_up * case.terms[B] * np.exp(-time / 600)
    samples = (samples - samples[0]) * np.where([a.startswith('gyro') for a in AXES], 1, _ACCEL)
    samples[:, AXES.index('accel_z')] += 9.81
    stamps = START_NS + np.round(np.arange(count) * 1e9 / case.rate_hz).astype(np.int64)
    kept = np.ones(count, np.bool_)
    for outage in range(case.outages):
        begin = (2 * outage + 1) * count // (2 * case.outages)
        kept[begin:begin + round(20 * case.rate_hz)] = False
    block = ImuBlock(stamps[kept], stamps[kept], np.ascontiguousarray(samples[kept]),
                     np.zeros((int(kept.sum()), 2), np.bool_), 'imu_link')
    path = write_recording(folder / f'{key}_{number}', [block], storage='mcap')
    return Recorded(path, block.samples, case.rate_hz)


def bound(case: Case) -> dict[str, float]:
    """
    Return the Cramer-Rao bound of each coefficient, relative, knowing which terms there are.

    Of a record without outages whose filter and warm-up are known. The spectra are those of the
    averaged samples, at the frequencies of the record's cosine transform.
    """
    dt, count = 1 / case.rate_hz, round(case.hours * 3600 * case.rate_hz)
    nu = np.arange(1, count) / (2 * count)
    sine = np.sin(np.pi * nu)**2
    spectra = {N: np.full(len(nu), 1 / dt), Q: 4 * sine / dt**2,
               K: dt * (1 - 2 / 3 * sine) / (4 * sine),
               B: sine / (2 * np.pi**3) * (zeta(3, nu) + zeta(3, 1 - nu))}
    present = {key: value**2 * spectra[key] for key, value in case.terms.items()}
    total = sum(present.values())
    columns = np.array([part / total for part in present.values()])
    information = 0.5 * columns @ columns.T
    # Of the logarithm of a square, so half of it is relative to the coefficient.
    return dict(zip(present, (0.5 * np.sqrt(np.diag(np.linalg.inv(information)))).tolist(),
                    strict=True))
