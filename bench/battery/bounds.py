# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The exact Cramer-Rao bound of every coefficient of a record, by Whittle's likelihood.

It is that of one who knows what terms there are and what filter they came through, but neither
their sizes, nor time and exponent of other slow noise, nor the mean. `corner_costs` says how much
wider it is for one who knows the kind of the filter, but not its corner.
"""

from battery import simulated
from battery.sensors import B, Filter, N, Q, Sensor, TERMS
import numpy as np
from numpy.typing import NDArray
from scipy.signal import tf2zpk
from scipy.special import zeta

Array = NDArray[np.float64]

NORMAL95 = 1.959964
_EACH = 2000
"""Of the slowest frequencies each one counts; the others stand in a thousand groups."""
_STEP = 1e-3


def frequencies(samples: int) -> tuple[Array, Array]:
    """Return frequencies in cycles per sample, and how many of a record's each stands for."""
    index = np.arange(1, min(samples, _EACH) + 1, dtype=np.float64)
    count = np.ones(len(index))
    if samples > _EACH:
        ends = np.unique(np.round(np.geomspace(_EACH, samples - 1, 1000)))
        index = np.concatenate((index, (ends[1:] + ends[:-1] + 1) / 2))
        count = np.concatenate((count, np.diff(ends)))
    return index / (2 * samples), count


def slow_power(nu: Array, exponent: float) -> Array:
    """Power of (2 pi f)^-exponent averaged over seconds, per unit of frequency."""
    folded = zeta(2 + exponent, nu) + zeta(2 + exponent, 1 - nu)
    return np.asarray((2 * np.pi)**-exponent * (np.sin(np.pi * nu) / np.pi)**2 * folded)


def process_power(nu: Array, time: float) -> Array:
    """Power of a Gauss-Markov process of unit variance averaged over seconds."""
    decay, variance, next_one = simulated.process_covariance(time)
    turn = np.exp(-2j * np.pi * nu)
    return np.asarray(variance + 2 * (next_one * turn / (1 - decay * turn)).real)


def term_power(key: str, nu: Array, rate_hz: float) -> Array:
    """Power of a term of unit coefficient in samples."""
    sine = np.sin(np.pi * nu)**2
    if key == Q:
        return np.asarray(4 * sine * rate_hz**2)
    if key == N:
        return np.full(len(nu), rate_hz)
    return slow_power(nu, 1.0) if key == B else np.asarray(
        (1 - 2 * sine / 3) / (4 * sine * rate_hz))


def moved(roots: Array, scale: float) -> Array:
    """Move zeros or poles as the bilinear transform does where all frequencies are scaled."""
    finite = np.abs(roots + 1) > 1e-6
    analog = scale * (roots[finite] - 1) / (roots[finite] + 1)
    return np.concatenate(((1 + analog) / (1 - analog), roots[~finite]))


def passed(through: Filter, nu: Array, scale: float, folds: int) -> Array:
    """Power of white noise behind a filter whose corner is scaled, in the mean of a sample."""
    zeros, poles, _ = tf2zpk(through.numerator, through.denominator)
    zeros, poles = moved(zeros, scale), moved(poles, scale)

    def gain(turn: Array) -> Array:
        return np.asarray(np.abs(np.prod(turn[..., None] - zeros, axis=-1)
                                 / np.prod(turn[..., None] - poles, axis=-1)))

    place = np.abs(nu + np.arange(-folds, folds + 1)[:, None]) / through.times
    # The mean of so many values: sin(pi n x)/(n sin(pi x)).
    mean = np.sinc(place * through.times) / np.sinc(place)
    power = (gain(np.exp(2j * np.pi * place)) / gain(np.ones(1)) * mean)**2
    return np.asarray(power.sum(axis=0))


def corner_costs(sensor: Sensor) -> dict[str, float]:
    """
    Return by key the bound with an unknown corner of the filter, over that with a known one.

    1 where there is none, or where it passes no mean.
    """
    if sensor.through is None or sensor.process or sensor.law or abs(
            np.sum(sensor.through.numerator)) < 1e-6:
        return dict.fromkeys(TERMS, 1.0)
    nu, count = frequencies(sensor.samples)
    filtered: list[Array] = []
    for scale in (1 - _STEP, 1 + _STEP):
        white, slow = (passed(sensor.through, nu, scale, folds)
                       for folds in ((sensor.through.times - 1) // 2, 0))
        filtered.append(np.stack([size**2 * term_power(key, nu, sensor.rate_hz)
                                  * (white if key in (Q, N) else slow)
                                  for key, size in sensor.terms.items()]))
    middle = (filtered[0] + filtered[1]) / 2
    total = middle.sum(axis=0)
    scores = np.vstack((2 * middle, (filtered[1] - filtered[0]).sum(axis=0) / (2 * _STEP))) / total
    information = (scores * count / 2) @ scores.T
    free, known = (np.sqrt(np.diag(np.linalg.inv(part)))[:len(middle)]
                   for part in (information, information[:-1, :-1]))
    return dict.fromkeys(TERMS, 1.0) | dict(
        zip(sensor.terms, (free / known).tolist(), strict=True))


def reference_widths(sensor: Sensor) -> dict[str, float]:
    """
    Return the width of the bound's Gaussian 95 % interval by key, in units of the coefficient.

    Of a term that is not there it is the bound from zero that the standard error of its square
    gives.
    """
    rate_hz = sensor.rate_hz
    nu, count = frequencies(sensor.samples)
    powers = {key: term_power(key, nu, rate_hz) for key in TERMS}
    parts = [size**2 * powers[key] for key, size in sensor.terms.items()]
    changes = [2 * part for part in parts]
    if sensor.process is not None:
        sigma, time_s = sensor.process
        ends = [sigma**2 * process_power(nu, time_s * rate_hz * (1 + step))
                for step in (0.0, -_STEP, _STEP)]
        parts.append(ends[0])
        changes += [2 * ends[0], (ends[2] - ends[1]) / (2 * _STEP)]
    if sensor.law is not None:
        amplitude, exponent = sensor.law
        ends = [amplitude**2 * rate_hz**(1 - a) * slow_power(nu, a)
                for a in (exponent, exponent - _STEP, exponent + _STEP)]
        parts.append(ends[0])
        changes += [2 * ends[0], (ends[2] - ends[1]) / (2 * _STEP)]
    total = np.sum(parts, axis=0)

    def errors(columns: list[Array]) -> Array:
        scores = np.stack(columns) / total
        return np.asarray(np.sqrt(np.diag(np.linalg.inv((scores * count / 2) @ scores.T))))

    known = errors(changes)
    found = {key: 2 * NORMAL95 * sensor.terms[key] * float(error)
             for key, error in zip(sensor.terms, known[:len(sensor.terms)], strict=True)}
    for key in TERMS:
        if key not in sensor.terms:
            # In units in which the column is as large as the others, for the inverse.
            unit = float(np.exp(np.mean(np.log(total / powers[key]))))
            square = unit * errors([*changes, unit * powers[key]])[-1]
            found[key] = float(np.sqrt(NORMAL95 * square))
    return found
