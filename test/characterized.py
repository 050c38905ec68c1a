# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One axis through the doors of a characterization: its result, and its warnings by code."""

from math import gamma

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.characterization.axis import axis_results
from imu_allan.datasheet import check_state
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.joint_fit import joint_fit
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import Quantity
import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter

START_NS = 1_700_000_000_000_000_000
AXES = tuple(f'{sensor}_{letter}' for sensor in ('gyro', 'accel') for letter in 'xyz')
N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'


def unbiased(samples, gain, settled=0.0):
    """Do as imu_complementary_filter at rest: bias += gain * (sample - bias), of those before."""
    return (samples - lfilter([0, gain], [1, gain - 1], samples, axis=0))[int(settled / gain):]


def streamed(blocks, path='bag', kind='recording', topic='/imu'):
    """Return a characterization that has taken in blocks of messages."""
    stream = Characterization(kind=kind, path=path, topic=topic)
    stream.take(blocks)
    return stream


def celsius_at(seconds):
    """Temperature of an hour: settling by 12 K, with a dip that no ramp or warm-up has."""
    return 25 + 12 * (1 - np.exp(-seconds / 700)) - 3 * np.exp(-((seconds - 2000) / 300)**2)


def messages(rows, rate_hz, places=0, *, gyro_alone=False):
    """Wrap samples of six axes, at places of the grid or from a place on, into one block."""
    index = np.arange(len(rows)) + places if np.ndim(places) == 0 else places
    stamps = START_NS + np.rint(index / rate_hz * 1e9).astype(np.int64)
    return ImuBlock(stamps, stamps, rows, np.tile([False, gyro_alone], (len(rows), 1)), 'imu_link')


def in_blocks(rows, rate_hz, places=None, size=3001, **more):
    places = np.arange(len(rows)) if places is None else places
    for begin in range(0, len(rows), size):
        part = slice(begin, begin + size)
        yield messages(rows[part], rate_hz, places[part], **more)


def characterized(samples, rate_hz, thermometer=None):
    """Return the result of a record, and its warnings; `thermometer` is a TemperatureSeries."""
    estimator = taken_in(samples)
    fits = None if thermometer is None else fit_axes(estimator.finished(), 1 / rate_hz,
                                                     thermometer)
    return one_axis(estimator, rate_hz, fits)


def together(records, rate_hz):
    """Return the joint result of several records, and its warnings."""
    estimators = [taken_in(samples) for samples in records]
    return one_axis(estimators[0], rate_hz, joint_fits(
        [one.finished() for one in estimators], 1 / rate_hz))


def joint_fits(records, dt):
    """Fit the axis of several finished estimators at once, of those that have a fit."""
    fits = [fit for one in records for fit in fit_axes(one, dt) if fit is not None]
    return [joint_fit(fits, dt) if fits else None]


def results_of(estimator, rate_hz, fits=None):
    """Return for each axis of an estimator, as of a gyroscope, result and values of warnings."""
    quantities = [Quantity.ANGULAR_VELOCITY] * estimator.axes
    return [(axis, {remark.code: remark.values for remark in remarks})
            for axis, remarks in axis_results(estimator.finished(), rate_hz, quantities, fits)]


def one_axis(estimator, rate_hz, fits=None):
    [found] = results_of(estimator, rate_hz, fits)
    return found


def axes_of(estimator, rate_hz):
    return [axis for axis, _ in results_of(estimator, rate_hz)]


def several(records, rate_hz):
    """Return the results of records of one length: as axes of a sensor they take half the time."""
    return [axis for first in range(0, len(records), 12)
            for axis in axes_of(taken_in(np.transpose(records[first:first + 12])), rate_hz)]


def simulated(terms, samples, rate_hz, seeds):
    return several([simulate(terms, samples, rate_hz, seed) for seed in seeds], rate_hz)


def said(result, code):
    return [remark for remark in result.warnings if remark.code == code]


def taken_in(samples, interpolated=()):
    """Return an estimator that has taken in a record of one axis or, in columns, of several."""
    estimator = Estimator(1 if np.ndim(samples) == 1 else np.shape(samples)[1])
    estimator.update(samples, interpolated)
    return estimator


def shown(samples, interpolated=()):
    """Return it finished."""
    return taken_in(samples, interpolated).finished()


def ends(coefficient):
    """Return the interval of a coefficient; a bound is that from zero."""
    return coefficient.ci95 or (0.0, coefficient.upper95)


def covers(interval, truth):
    return interval[0] <= truth <= interval[1]


def holds(coefficient, truth):
    """Whether the interval, or the bound, of a coefficient holds its true value."""
    return covers(ends(coefficient), truth)


def power_law_noise(samples, rng, exponent):
    """Draw averaged noise with the spectrum 1/(2 pi f)^exponent, f in cycles per sample."""
    half = next_fast_len(samples, real=True)
    lag = np.arange(-2.0, half + 3)
    size = -1 / (2 * np.cos(np.pi * exponent / 2) * gamma(2 + exponent))
    # The covariance of the first difference is the fourth difference of that of the phase.
    phase = size * np.abs(lag)**(exponent + 1)
    covariance = phase[4:] + phase[:-4] - 4 * (phase[3:-1] + phase[1:-3]) + 6 * phase[2:-2]
    h = np.arange(half + 1.0)[10_001:]
    covariance[10_001:] = size * np.prod(exponent + 1 - np.arange(4)) * h**(exponent - 3) * (
        1 + (exponent - 3) * (exponent - 4) / (6 * h**2))
    power = np.maximum(rfft(np.concatenate((covariance, covariance[-2:0:-1]))).real, 0)
    normal = rng.standard_normal((2, half + 1))
    spectrum = np.sqrt(power * half) * (normal[0] + 1j * normal[1])
    spectrum[[0, -1]] = np.sqrt(2 * half * power[[0, -1]]) * normal[0, [0, -1]]
    return np.concatenate(([0.0], np.cumsum(irfft(spectrum, 2 * half)[:samples - 1])))


def state_of(stream, specification):
    """Return how a check of a stream stands."""
    result, record = stream.fitted()
    return check_state(result, [record], specification)
