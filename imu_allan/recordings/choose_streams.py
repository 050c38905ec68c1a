# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Choice of the topic, or of the two topics or halves of one, that are read as one IMU.

RealSense and OAK cameras publish gyroscope and accelerometer, here called halves, on two topics
and fill the other half of each message with zeros. PX4 logs them as two message types. Drivers
that merge them into one topic either repeat the slower half until its next sample or interpolate
it; others publish both in turn, each in messages of its own. Each case is recognized.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

from imu_allan.arrays import Array, Ints
from imu_allan.block import Half, HALVES, ImuBlock
from imu_allan.errors import brief, error_about, ImuAllanError, printable
from imu_allan.recordings.messages.type_names import may_hold_imu
from imu_allan.recordings.recording import Recording
from imu_allan.wording import counted, NO_TOPIC
import numpy as np


def choose_topic(recording: Recording, topic: str | None = None) -> str:
    """
    Choose the topic to read and return its name.

    Parameters
    ----------
    recording : Recording
        An open recording.
    topic : str, optional
        The user's choice, with or without a leading slash. May be omitted if the recording has
        exactly one Imu topic.

    Raises
    ------
    ImuAllanError
        If the topic does not exist, is of another type or has no messages. Also if `topic` is
        omitted and there are several Imu topics.

    """
    names = recording.by_name
    if topic is None and len(names) > 1:
        raise error_about(
            recording.path, f'{len(names)} Imu topics; choose one with --topic, or analyze each '
            f'with --all-topics: {_list_topics(recording)}')
    spellings = [*names] if topic is None else [topic, f'/{topic}', topic.removeprefix('/')]
    chosen = next((name for name in spellings if name in names), None)
    if chosen is None:
        other = next((name for name in spellings if name in recording.other_topics), None)
        if other is not None:
            raise error_about(recording.path, f'topic {brief(other)} is of type '
                              f'{brief(recording.other_topics[other])}, not sensor_msgs/msg/Imu'
                              f'{_reason(recording, [other])}')
        asked = '' if topic is None else f'no topic {brief(topic)}; '
        raise error_about(recording.path, f'{asked}{_what_there_is(recording)}')
    if names[chosen].count == 0:
        raise error_about(recording.path, f'topic {brief(chosen)} has no messages; record it '
                          'while the IMU driver runs')
    return chosen


def _what_there_is(recording: Recording) -> str:
    if NO_TOPIC in recording.by_name:
        return 'a CSV file has no topics: leave out --topic'
    if recording.topics:
        return f'its Imu topics are {_list_topics(recording)}'
    if not recording.other_topics:
        return 'it holds no topics at all: the recording is empty'
    others = sorted(recording.other_topics.items())
    why = _reason(recording, sorted(recording.other_topics))
    if not why and any(may_hold_imu(kind) for _, kind in others):
        why = '; if the fields of one are those of an IMU, name them with --gyro and --accel'
    listed = _first_ten([f'{brief(name)} ({brief(kind)})' for name, kind in others])
    return f'no topic of type sensor_msgs/msg/Imu; it holds {listed}{why}'


def _reason(recording: Recording, topics: list[str]) -> str:
    """Return why the first of `topics` that has a reason is not read."""
    for topic in topics:
        if topic in recording.reasons:
            named = '' if len(topics) == 1 else f'{brief(topic)}: '
            return f'; {named}{recording.reasons[topic]}'
    return ''


def _list_topics(recording: Recording) -> str:
    return _first_ten([
        brief(topic.name)
        + ('' if topic.count is None else f' ({counted(topic.count, "message")})')
        for topic in sorted(recording.topics, key=lambda topic: topic.name)])


def _first_ten(texts: list[str]) -> str:
    return ', '.join(texts[:10]) + (f' and {len(texts) - 10} more' if len(texts) > 10 else '')


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
    polled : bool
        Whether messages repeat the samples of the half.

    """

    topic: str
    half: Half | None = None
    polled: bool = False

    def select(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Yield the part of `blocks` that belongs to the stream."""
        for block in blocks:
            if self.half is not None:
                block = block.only(self.half)
            if self.polled:
                # The other half is new in each message, which hides what repeats.
                absent = np.repeat(block.absent, 3, axis=1)
                block = replace(block, samples=np.where(absent, np.nan, block.samples))
            if len(block):
                yield block


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
        others = [name for name in recording.by_name if name not in recording.preferred]
        if others:
            recording.remark('chosen_topic', topics=len(recording.topics),
                             chosen=[*map(printable, recording.preferred)],
                             reason=recording.preferred_for, others=[*map(printable, others)])
        if len(recording.preferred) == 2:
            return _two(*recording.preferred)
        [topic] = recording.preferred
    # A robot has no more than a few IMUs, so a longer list is not searched for halves.
    if topic is None and 1 < len(recording.topics) <= 16:
        halves = [(_half_of(recording, imu.name) or '', imu.name) for imu in recording.topics
                  if imu.count != 0]
        if sorted(half for half, _ in halves) == ['accel', 'gyro']:
            names = dict(halves)
            return _two(names['gyro'], names['accel'])
    chosen = choose_topic(recording, topic)
    return _split_if_merged(recording, chosen)


def _two(gyro: str, accel: str) -> list[Stream]:
    return [Stream(gyro, 'gyro'), Stream(accel, 'accel')]


def _half_of(recording: Recording, topic: str) -> Half | None:
    """Return the half that a topic holds if the other is exactly zero; None for both."""
    known = recording.imu(topic).messages.half
    if known is not None:
        return known
    for block in _beginning(recording, topic):
        if block.samples.any():
            gyro, accel = (block.samples[:, columns].any() for columns in HALVES.values())
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
    provided = np.concatenate([block.provided for block in blocks])
    if provided.any(axis=0).all() and np.mean(provided.sum(axis=1) == 1) > 0.1:
        return _two(topic, topic)
    samples = np.concatenate([block.samples for block in blocks])
    stamps = np.concatenate([block.header_ns for block in blocks])
    made = {half: _upsampled(samples[:, columns], stamps) for half, columns in HALVES.items()}
    interpolated, repeated = ([half for half in HALVES if made[half] == how]
                              for how in ('interpolated', 'repeated'))
    if len(interpolated) == 1:
        recording.remark('interpolated', topic=printable(topic), half=interpolated[0])
    # If both halves repeat at once, the driver merely polls the sensor faster than it samples; so
    # it does if the other half never changes or is not there.
    changing = [np.any(np.diff(samples[:, columns], axis=0) > 0) for columns in HALVES.values()]
    if len(repeated) != 1 or not all(changing):
        return [Stream(topic)]
    recording.remark('repeated_half', topic=printable(topic), half=repeated[0])
    return [Stream(topic, half, polled=half in repeated) for half in HALVES]


def _beginning(recording: Recording, topic: str) -> Iterator[ImuBlock]:
    """Read the first messages of a topic; damage is reported later, by the actual reading."""
    seen = 0
    with suppress(ImuAllanError, OSError):
        for block, _ in recording.for_another_topic().decoded(topic):
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
    between two samples of the sensor. With fewer, only the top of the band is lost, which the fit
    recognizes as a band limit.
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
    return None
