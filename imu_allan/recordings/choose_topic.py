# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Choose an Imu topic of a recording, or report what the recording holds if none fits."""

from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.recordings.recording import Recording
from imu_allan.wording import counted, NO_TOPIC


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
    path = printable(recording.path)
    names = recording.by_name
    if topic is not None:
        spellings = [topic, f'/{topic}', topic.removeprefix('/')]
        chosen = next((name for name in spellings if name in names), None)
        if chosen is None:
            other = next((name for name in spellings if name in recording.other_topics), None)
            if other is None:
                raise ImuAllanError(
                    f'{path}: no topic {brief(topic)}; {_what_there_is(recording)}')
            raise ImuAllanError(
                f'{path}: topic {brief(other)} is of type '
                f'{brief(recording.other_topics[other])}, not sensor_msgs/msg/Imu'
                f'{_reason(recording, [other])}')
    elif not names:
        raise ImuAllanError(f'{path}: {_what_there_is(recording)}')
    elif len(names) > 1:
        raise ImuAllanError(
            f'{path}: {len(names)} Imu topics; choose one with --topic: {_list_topics(recording)}')
    else:
        [chosen] = names
    if names[chosen].count == 0:
        raise ImuAllanError(
            f'{path}: topic {brief(chosen)} has no messages; record it while the IMU driver '
            'runs')
    return chosen


def _what_there_is(recording: Recording) -> str:
    if NO_TOPIC in recording.by_name:
        return 'a CSV file has no topics: leave out --topic'
    if recording.topics:
        return f'its Imu topics are {_list_topics(recording)}'
    if not recording.other_topics:
        return 'it holds no topics at all: the recording is empty'
    others = sorted(recording.other_topics.items())
    return ('no topic of type sensor_msgs/msg/Imu; it holds '
            + _first_ten([f'{brief(name)} ({brief(kind)})' for name, kind in others])
            + _reason(recording, sorted(recording.other_topics)))


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
