# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Sensors that come in halves, and the marks that every way of uniting them leaves.

Gyroscope and accelerometer then have rates of their own.
RealSense and OAK cameras publish them on two topics, the other half of each message being zero;
PX4 logs them as two types. United into one topic, the slower half is either repeated until its
next sample or interpolated between two.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.choose_topic import choose_topic
from imu_allan.recordings.recording import Recording
import numpy as np
from numpy.typing import NDArray

Half = Literal['gyro', 'accel']

_COLUMNS: dict[Half, slice] = {'gyro': slice(0, 3), 'accel': slice(3, 6)}
_OTHER: dict[Half, Half] = {'gyro': 'accel', 'accel': 'gyro'}
_ENOUGH = 64
"""Messages: the share of repeats is known to 0.06 (one sigma), a fifth of `_REPEATED`."""
_REPEATED = 0.3
"""Share of messages that repeat a half: 400 Hz over 250 Hz, the closest pair of a RealSense,
repeats 0.38 of them."""
_BAND = 64
"""Bins of a spectrum that share one level; lines that stand sixteen times above it are cut out."""


@dataclass(frozen=True)
class Stream:
    """
    What is read of a topic.

    Attributes
    ----------
    topic : str
        Its name among the topics of the recording.
    half : {'gyro', 'accel'} or None
        The only half that is taken from it; None for both.
    only_new : bool
        Whether messages that repeat the half of the one before are left out.

    """

    topic: str
    half: Half | None = None
    only_new: bool = False

    def taken(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Give of `blocks` what belongs to the stream."""
        last: NDArray[np.float64] | None = None
        for block in blocks:
            if self.half is None:
                yield block
                continue
            block = block.only(self.half)
            if not self.only_new or not len(block):
                yield block
                continue
            half = block.samples[:, _COLUMNS[self.half]]
            before = half[:1] + 1 if last is None else last
            new = (half != np.concatenate([before, half[:-1]])).any(axis=1)
            last = half[-1:].copy()
            if new.any():
                yield block.part(new)


def choose_streams(recording: Recording, topic: str | None = None) -> list[Stream]:
    """
    Choose what to read of a recording as one IMU: a topic, or two halves of different rates.

    Parameters
    ----------
    recording : Recording
        Open.
    topic : str, optional
        The user's choice; may be left out where one topic, or one pair of halves, is there.

    Returns
    -------
    list of Stream
        One, or the gyroscope and the accelerometer.

    Raises
    ------
    ImuAllanError
        As `choose_topic`; where one half is named without the other, and where two are apart.

    """
    gyro, accel = recording.options.gyro_topic, recording.options.accel_topic
    if (gyro is None) != (accel is None):
        given, needed = ('--gyro-topic', '--accel-topic') if accel is None else (
            '--accel-topic', '--gyro-topic')
        raise ImuAllanError(f'{given} needs {needed}, too: an IMU on two topics has both')
    if gyro is not None:
        if topic is not None:
            raise ImuAllanError('--topic names one topic, --gyro-topic and --accel-topic two; '
                                'give the one or the two')
        return _two(choose_topic(recording, gyro), choose_topic(recording, accel))
    if topic is None and recording.apart:
        raise ImuAllanError(f'{printable(recording.path)}: {recording.apart}')
    if topic is None and recording.preferred:
        _report_choice(recording)
        if len(recording.preferred) == 2:
            return _two(*recording.preferred)
        [topic] = recording.preferred
    # A robot has fewer IMUs.
    if topic is None and 1 < len(recording.topics) <= 16:
        halves = [(half_of(recording, imu.name) or '', imu.name) for imu in recording.topics
                  if imu.count != 0]
        if sorted(half for half, _ in halves) == ['accel', 'gyro']:
            names = dict(halves)
            return _two(names['gyro'], names['accel'])
    chosen = choose_topic(recording, topic)
    _report_filtered(recording, chosen)
    return _united(recording, chosen)


def _two(gyro: str, accel: str) -> list[Stream]:
    return [Stream(gyro, 'gyro'), Stream(accel, 'accel')]


def _report_filtered(recording: Recording, topic: str) -> None:
    """
    Say so where samples have passed an orientation filter that changes them.

    By REP 145 ``imu/data_raw`` comes from the sensor and ``imu/data`` from the filter behind it.
    Most hand the samples through; imu_complementary_filter subtracts the bias that it estimates.
    """
    raw = f'{topic}_raw'
    if not topic.endswith('/data') or raw not in recording.by_name:
        return
    filtered, sensor = (
        {stamp: sample for block in _beginning(recording, name)
         for stamp, sample in zip(block.header_ns.tolist(), block.samples, strict=True)}
        for name in (topic, raw))
    common = filtered.keys() & sensor.keys()
    changed = sum(not np.allclose(filtered[stamp], sensor[stamp], rtol=1e-5, atol=1e-9)
                  for stamp in common)
    if len(common) >= _ENOUGH and changed > len(common) / 2:
        recording.remark(
            'filtered', by='orientation', topic=printable(topic), raw=printable(raw))


def _report_choice(recording: Recording) -> None:
    """Name what else could have been chosen than what is preferred."""
    chosen = recording.preferred
    others = [imu.name for imu in recording.topics if imu.name not in chosen]
    if others:
        recording.remark(
            'chosen_topic', topics=len(recording.topics), chosen=[*map(printable, chosen)],
            reason=recording.preferred_for, others=[*map(printable, others)])


def half_of(recording: Recording, topic: str) -> Half | None:
    """Return which half a topic holds where the other is exactly zero; None for both."""
    known = recording.imu(topic).messages.half
    if known is not None:
        return known
    for block in _beginning(recording, topic):
        if block.samples.any():
            return next((half for half, other in _OTHER.items()
                         if not block.samples[:, _COLUMNS[other]].any()), None)
    return None


def _united(recording: Recording, topic: str) -> list[Stream]:
    """Take apart what a driver united from two rates; say so where it cannot be."""
    count = recording.imu(topic).count
    blocks = [] if count is not None and count < _ENOUGH else list(_beginning(recording, topic))
    if sum(map(len, blocks)) < _ENOUGH:
        return [Stream(topic)]
    samples = np.concatenate([block.samples for block in blocks])
    stamps = np.concatenate([block.header_ns for block in blocks])
    made = {half: _upsampled(samples[:, columns], stamps)
            for half, columns in _COLUMNS.items()}
    interpolated, repeated = ([half for half in _OTHER if made[half] == how]
                              for how in ('interpolated', 'repeated'))
    if len(interpolated) == 1:
        recording.remark('interpolated', topic=printable(topic), half=interpolated[0])
    # Of a sensor that is polled faster than it samples both halves repeat at once.
    if not repeated or (len(repeated) == 2 and not _alternate(samples)):
        return [Stream(topic)]
    recording.remark('repeated_half', topic=printable(topic),
                     half=repeated[0] if len(repeated) == 1 else None)
    return [Stream(topic, half, only_new=half in repeated) for half in _OTHER]


def _alternate(samples: NDArray[np.float64]) -> bool:
    """Whether a message has news of one half alone, as realsense2_camera united until 2019."""
    new = [(samples[1:, columns] != samples[:-1, columns]).any(axis=1)
           for columns in _COLUMNS.values()]
    # All messages have news of one half alone, unless one is lost or both come at once.
    return bool((new[0] != new[1]).mean() > 0.9)


def _beginning(recording: Recording, topic: str) -> Iterator[ImuBlock]:
    """Read the first messages of a topic; the reading itself reports what is wrong there."""
    seen = 0
    with recording.again() as apart, suppress(ImuAllanError, OSError):
        for block, _ in apart.decoded(topic):
            yield block
            seen += len(block)
            # Some seconds show two rates plainly.
            if seen >= 4096:
                break


@np.errstate(over='ignore', invalid='ignore')
def _upsampled(half: NDArray[np.float64], stamps: NDArray[np.int64],
               ) -> Literal['repeated', 'interpolated'] | None:
    """
    Find how a half was made of fewer samples: many then follow from those beside them.

    A sample that is held is held for k or k + 1 messages; a coarse sensor at rest repeats itself,
    too, but as chance will have it. One that is interpolated lies on the line between two others,
    where three fit between two samples of the sensor; else its variance goes up and down.
    """
    news = np.diff(half, axis=0)
    same = (news == 0).all(axis=1)
    if _REPEATED <= same.mean() < 1:
        lengths = np.diff(np.flatnonzero(np.concatenate([[True], ~same, [True]])))[1:-1]
        if len(lengths) and np.ptp(np.percentile(lengths, [5, 95])) <= 1:
            return 'repeated'
    steps = np.diff(stamps) * 1e-9
    if not same.any() and (steps > 0).all():
        bends = np.abs(np.diff(news / steps[:, np.newaxis], axis=0)).max(axis=1)
        usual = np.percentile(bends, 90)
        # Next to no bend is a line: 400 Hz over 100 Hz leaves half of all triples straight. Three
        # samples span two steps, so of two rates closer than 2 : 1 none is.
        if usual > 0 and (bends < 1e-4 * usual).mean() >= 0.2:
            return 'interpolated'
    return 'interpolated' if _is_cyclostationary(half) else None


@np.errstate(over='ignore', invalid='ignore', divide='ignore')
def _is_cyclostationary(half: NDArray[np.float64]) -> bool:
    """
    Whether the variance of the samples goes up and down with one period, as of two rates.

    A sample on a fraction f of the way from one sample of the sensor to the next has the part
    (1 - f)^2 + f^2 of its variance: all of it on the samples, half of it between two. At twice the
    rate f takes two values, half apart, of which the variances may be the same; then the
    covariance of neighbours goes up and down, between f (1 - f) and more.
    """
    noise = _without_lines(half)
    if noise is None:
        return False
    correlation = np.atleast_2d(np.corrcoef(noise.T))[np.triu_indices(3, 1)]
    # Two axes that beat together are one vibration: the correlation is the part of its power that
    # beats. That of a sensor interpolated from 63 to 400 Hz is 0 +- 0.06.
    if np.abs(correlation).max() > 0.2:
        return False
    variance, covariance = _spectrum_of_products(noise, 0), _spectrum_of_products(noise, 1)
    last = len(variance) - 1
    peak = int(np.argmax((np.abs(variance[:last]) ** 2).sum(axis=1)))
    # A vibration at a quarter of the rate beats there, too, but leaves the upper band as it is.
    # The amplitude of the beat, relative to the mean square, 2 (1 - f + f^2) - 1 of a phase f that
    # takes all values, is 3 / pi^2 = 0.30; of few values, at simple ratios, 0.2 to 0.4.
    # In white noise the beat of 4096 samples reaches seven times its level by chance.
    beats = _stands_out(variance, peak, (0.17, 0.43), 16.0)
    # At twice the rate, where f is decides whether variance or covariance goes up and down, one at
    # least by 0.15; 0.09 where f wanders. This is twice the amplitude there.
    # One frequency alone, which is not searched for, reaches ten times once in 100,000.
    twice = any(_stands_out(each, last, (0.1, 0.8), 10.0) for each in (variance, covariance))
    return (beats and peak < last - _BAND) or ((beats or twice) and _lacks_upper_band(noise))


def _without_lines(half: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Leave out vibrations, and what is slow; None where the samples are too few."""
    n = len(half) // (2 * _BAND) * 2 * _BAND
    if n < 1024 or not np.isfinite(half).all():
        return None
    spectrum = np.fft.rfft((half[:n] - half[:n].mean(axis=0)) * np.hanning(n)[:, None], axis=0)
    power = np.abs(spectrum[:-1]) ** 2
    level = np.median(power.reshape(-1, _BAND, 3), axis=1).repeat(_BAND, axis=0) / np.log(2)
    line = power > 16 * level
    for shift in (-2, -1, 1, 2):
        # What the window spreads a line over, whose square would beat, too.
        line |= np.roll(power > 16 * level, shift, axis=0)
    spectrum[:-1][line] = 0
    spectrum[:n // _BAND] = 0
    return np.fft.irfft(spectrum, n, axis=0)


def _lacks_upper_band(noise: NDArray[np.float64]) -> bool:
    """Whether the upper quarter of the band holds next to nothing: half the rate has none."""
    power = (np.abs(np.fft.rfft(noise, axis=0)) ** 2).sum(axis=1)
    quarter = len(power) // 4
    return bool(power[-quarter:].sum() < power[:quarter].sum() / 4)


def _spectrum_of_products(noise: NDArray[np.float64], lag: int) -> NDArray[np.complex128]:
    """Return amplitudes of what the products of samples do, over their mean square."""
    products = noise * np.roll(noise, -lag, axis=0)
    beat: NDArray[np.complex128] = 2 * np.fft.rfft(products, axis=0)[8:] / (noise ** 2).sum(axis=0)
    return beat


def _stands_out(beat: NDArray[np.complex128], at: int, bounds: tuple[float, float],
                clear: float) -> bool:
    """Whether one frequency, of all axes together, is clear of all others."""
    total = (np.abs(beat) ** 2).sum(axis=1)
    amplitude = np.abs(beat[at])
    # A vibration whose frequency wanders beats broadly.
    beside = np.concatenate([total[max(at - 16, 0):max(at - 3, 0)], total[at + 4:at + 17]])
    return bool(total[at] > clear * np.median(total) and total[at] > 4 * beside.max()
                and bounds[0] < amplitude.min() and amplitude.max() < bounds[1]
                and np.abs(beat[at].sum()) > 0.9 * amplitude.sum())
