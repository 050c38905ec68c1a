# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
IMUs whose gyroscope and accelerometer, here called halves, have different rates.

RealSense and OAK cameras publish the halves on two topics and fill the other half of each message
with zeros. PX4 logs them as two message types. Drivers that merge them into one topic either
repeat the slower half until its next sample or interpolate it. This module recognizes each case.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from imu_allan.arrays import Array, Ints
from imu_allan.block import Half, ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.choose_topic import choose_topic
from imu_allan.recordings.recording import Recording
import numpy as np
from numpy.typing import NDArray

_COLUMNS: dict[Half, slice] = {'gyro': slice(0, 3), 'accel': slice(3, 6)}
_BAND = 64
"""Frequency bins that share one noise level. Lines more than 16 times above it are removed."""


@dataclass(frozen=True)
class Stream:
    """
    The part of a topic that is read.

    Attributes
    ----------
    topic : str
        Name of the topic in the recording.
    half : {'gyro', 'accel'} or None
        The only half to read; None for both.
    only_new : bool
        Whether to skip messages whose half equals that of the message before.

    """

    topic: str
    half: Half | None = None
    only_new: bool = False

    def select(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Yield the part of `blocks` that belongs to the stream."""
        last: Array | None = None
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
    """Choose what to read as one IMU: one topic, or a gyroscope and an accelerometer."""
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
    if topic is None and recording.preferred:
        _report_choice(recording)
        if len(recording.preferred) == 2:
            return _two(*recording.preferred)
        [topic] = recording.preferred
    # A robot has no more than a few IMUs, so a longer list is not searched for halves.
    if topic is None and 1 < len(recording.topics) <= 16:
        halves = [(half_of(recording, imu.name) or '', imu.name) for imu in recording.topics
                  if imu.count != 0]
        if sorted(half for half, _ in halves) == ['accel', 'gyro']:
            names = dict(halves)
            return _two(names['gyro'], names['accel'])
    chosen = choose_topic(recording, topic)
    return _split_if_merged(recording, chosen)


def _two(gyro: str, accel: str) -> list[Stream]:
    return [Stream(gyro, 'gyro'), Stream(accel, 'accel')]


def _report_choice(recording: Recording) -> None:
    """Report which topics were preferred and which others could have been chosen."""
    chosen = recording.preferred
    others = [imu.name for imu in recording.topics if imu.name not in chosen]
    if others:
        recording.remark(
            'chosen_topic', topics=len(recording.topics), chosen=[*map(printable, chosen)],
            reason=recording.preferred_for, others=[*map(printable, others)])


def half_of(recording: Recording, topic: str) -> Half | None:
    """Return the half that a topic holds if the other is exactly zero; None for both."""
    known = recording.imu(topic).messages.half
    if known is not None:
        return known
    for block in _beginning(recording, topic):
        if block.samples.any():
            gyro, accel = (block.samples[:, columns].any() for columns in _COLUMNS.values())
            return 'gyro' if not accel else 'accel' if not gyro else None
    return None


def _split_if_merged(recording: Recording, topic: str) -> list[Stream]:
    """Separate halves that a driver merged from two rates; report those that were interpolated."""
    count = recording.imu(topic).count
    # Of so many messages, the share of repeats has a standard error of 0.06, a fifth of the share
    # from which a half counts as repeated.
    enough = 64
    blocks = [] if count is not None and count < enough else list(_beginning(recording, topic))
    if sum(map(len, blocks)) < enough:
        return [Stream(topic)]
    samples = np.concatenate([block.samples for block in blocks])
    stamps = np.concatenate([block.header_ns for block in blocks])
    made = {half: _upsampled(samples[:, columns], stamps)
            for half, columns in _COLUMNS.items()}
    interpolated, repeated = ([half for half in _COLUMNS if made[half] == how]
                              for how in ('interpolated', 'repeated'))
    if len(interpolated) == 1:
        recording.remark('interpolated', topic=printable(topic), half=interpolated[0])
    # If both halves repeat at once, the driver merely polls the sensor faster than it samples.
    if not repeated or (len(repeated) == 2 and not _alternate(samples)):
        return [Stream(topic)]
    recording.remark('repeated_half', topic=printable(topic),
                     half=repeated[0] if len(repeated) == 1 else None)
    return [Stream(topic, half, only_new=half in repeated) for half in _COLUMNS]


def _alternate(samples: Array) -> bool:
    """Return whether each message updates only one half, as in realsense2_camera before 2019."""
    new = [(samples[1:, columns] != samples[:-1, columns]).any(axis=1)
           for columns in _COLUMNS.values()]
    # The share is below 1 only if a message is lost or both halves are updated at once.
    return bool((new[0] != new[1]).mean() > 0.9)


def _beginning(recording: Recording, topic: str) -> Iterator[ImuBlock]:
    """Read the first messages of a topic; damage is reported later, by the actual reading."""
    seen = 0
    with recording.for_another_topic() as reader, suppress(ImuAllanError, OSError):
        for block, _ in reader.decoded(topic):
            yield block
            seen += len(block)
            # A few seconds are enough to recognize two rates.
            if seen >= 4096:
                break


@np.errstate(over='ignore', invalid='ignore')
def _upsampled(half: Array, stamps: Ints) -> Literal['repeated', 'interpolated'] | None:
    """
    Detect whether a half was upsampled from fewer samples, and how.

    A repeated sample is held for k or k + 1 messages. A coarse sensor at rest also repeats values,
    but for irregular times. Interpolated samples lie on straight lines if at least three fit
    between two samples of the sensor; otherwise their variance varies periodically.
    """
    news = np.diff(half, axis=0)
    same = (news == 0).all(axis=1)
    # The closest pair of rates of a RealSense, 400 Hz and 250 Hz, repeats 0.38 of the messages.
    if 0.3 <= same.mean() < 1:
        lengths = np.diff(np.flatnonzero(np.concatenate([[True], ~same, [True]])))[1:-1]
        if len(lengths) and np.ptp(np.percentile(lengths, [5, 95])) <= 1:
            return 'repeated'
    steps = np.diff(stamps) * 1e-9
    if not same.any() and (steps > 0).all():
        bends = np.abs(np.diff(news / steps[:, np.newaxis], axis=0)).max(axis=1)
        usual = np.percentile(bends, 90)
        # Almost no change of slope means a straight line. Upsampling from 100 to 400 Hz leaves
        # half of all triples straight. Three samples span two steps, so no triple is straight if
        # the ratio of the rates is below 2.
        if usual > 0 and (bends < 1e-4 * usual).mean() >= 0.2:
            return 'interpolated'
    return 'interpolated' if _is_cyclostationary(half) else None


@np.errstate(over='ignore', invalid='ignore', divide='ignore')
def _is_cyclostationary(half: Array) -> bool:
    """
    Return whether the variance of the samples varies periodically, as after interpolation.

    A sample interpolated at fraction f between two sensor samples has (1 - f)^2 + f^2 times their
    variance. That is 1 at a sensor sample and 1/2 midway. At twice the sensor rate, f takes two
    values that differ by 1/2, and both may give the same variance. Then the covariance of
    neighbours varies instead, between f (1 - f) and a larger value.
    """
    noise = _without_lines(half)
    if noise is None:
        return False
    correlation = np.atleast_2d(np.corrcoef(noise.T))[np.triu_indices(3, 1)]
    # Correlated axes mean a vibration: the correlation is the share of power that is modulated. A
    # sensor interpolated from 63 to 400 Hz gives 0 +- 0.06.
    if np.abs(correlation).max() > 0.2:
        return False
    variance, covariance = _spectrum_of_products(noise, 0), _spectrum_of_products(noise, 1)
    last = len(variance) - 1
    peak = int(np.argmax((np.abs(variance[:last]) ** 2).sum(axis=1)))
    # A vibration at a quarter of the rate is modulated at that frequency too, but leaves the upper
    # band intact. Relative to the mean square, the modulation is 2 (1 - f + f^2) - 1. If f takes
    # all values, its amplitude is 3 / pi^2 = 0.30; at simple ratios of the rates, 0.2 to 0.4. In
    # 4096 samples of white noise the largest amplitude reaches seven times the level by chance.
    beats = _is_dominant(variance, peak, (0.17, 0.43), 16.0)
    # At twice the rate, f decides whether the variance or the covariance alternates. At least one
    # does so by 0.15, or 0.09 if f drifts; the bounds are for twice that amplitude. Only this one
    # frequency is tested: it exceeds ten times the level by chance once in 100,000.
    twice = any(_is_dominant(each, last, (0.1, 0.8), 10.0) for each in (variance, covariance))
    return (beats and peak < last - _BAND) or ((beats or twice) and _lacks_upper_band(noise))


def _without_lines(half: Array) -> Array | None:
    """Remove vibrations and low frequencies; return None if there are too few samples."""
    n = len(half) // (2 * _BAND) * 2 * _BAND
    if n < 1024 or not np.isfinite(half).all():
        return None
    spectrum = np.fft.rfft((half[:n] - half[:n].mean(axis=0)) * np.hanning(n)[:, None], axis=0)
    power = np.abs(spectrum[:-1]) ** 2
    level = np.median(power.reshape(-1, _BAND, 3), axis=1).repeat(_BAND, axis=0) / np.log(2)
    line = power > 16 * level
    for shift in (-2, -1, 1, 2):
        # Include neighbouring bins, into which the window spreads a line: its square would be
        # modulated too.
        line |= np.roll(power > 16 * level, shift, axis=0)
    spectrum[:-1][line] = 0
    spectrum[:n // _BAND] = 0
    return np.fft.irfft(spectrum, n, axis=0)


def _lacks_upper_band(noise: Array) -> bool:
    """Return whether the upper quarter of the band is nearly empty, as after upsampling."""
    power = (np.abs(np.fft.rfft(noise, axis=0)) ** 2).sum(axis=1)
    quarter = len(power) // 4
    return bool(power[-quarter:].sum() < power[:quarter].sum() / 4)


def _spectrum_of_products(noise: Array, lag: int) -> NDArray[np.complex128]:
    """Return the amplitude spectrum of lagged products, relative to their mean square."""
    products = noise * np.roll(noise, -lag, axis=0)
    beat: NDArray[np.complex128] = 2 * np.fft.rfft(products, axis=0)[8:] / (noise ** 2).sum(axis=0)
    return beat


def _is_dominant(beat: NDArray[np.complex128], at: int, bounds: tuple[float, float],
                 clear: float) -> bool:
    """Return whether one frequency, over all axes, exceeds all others and lies within bounds."""
    total = (np.abs(beat) ** 2).sum(axis=1)
    amplitude = np.abs(beat[at])
    # A vibration with a varying frequency gives a broad peak, so nearby bins must be low.
    beside = np.concatenate([total[max(at - 16, 0):max(at - 3, 0)], total[at + 4:at + 17]])
    return bool(total[at] > clear * np.median(total) and total[at] > 4 * beside.max()
                and bounds[0] < amplitude.min() and amplitude.max() < bounds[1]
                and np.abs(beat[at].sum()) > 0.9 * amplitude.sum())
