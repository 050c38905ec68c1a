# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every kind of recording offers, and the choice of a topic in it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.recordings.read_ahead import larger_blocks, read_ahead
from imu_allan.recordings.reading_process import pays, ReadingProcess
from imu_allan.result import Remark

IMU_TYPES = frozenset({'sensor_msgs/msg/Imu', 'sensor_msgs/Imu'})
"""Names of the type in ROS 2 and ROS 1."""


@dataclass(frozen=True)
class ImuTopic:
    """
    A topic of type sensor_msgs/msg/Imu.

    Attributes
    ----------
    name : str
        Topic name.
    count : int or None
        Messages in the recording; None where the file does not say.

    """

    name: str
    count: int | None


class Recording(ABC):
    """
    An open recording; a context manager.

    Attributes
    ----------
    path : Path
        What was opened.
    topics : list of ImuTopic
        The Imu topics.
    other_topics : dict of str to str
        Names and types of the other topics.
    carriers : set of str
        Those of the other topics whose type contains a sensor_msgs/Imu.
    size_bytes : int
        Bytes that `blocks` goes through, for progress.
    remarks : list of Remark
        What the user should know about the file; grows while it is read.

    Notes
    -----
    It holds paths and numbers, no open file: a large one is pickled for the process that reads it.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: list[ImuTopic] = []
        self.other_topics: dict[str, str] = {}
        self.carriers: set[str] = set()
        self.size_bytes = 0
        self.remarks: list[Remark] = []

    def blocks(
        self, topic: str, progress: Callable[[int], None] | None = None,
    ) -> Iterator[ImuBlock]:
        """
        Read the messages of `topic` in the order in which they were recorded.

        Reading, decompression and decoding run some blocks ahead, in a process of their own where
        the recording is large, else in a thread. They begin with this call.

        Parameters
        ----------
        topic : str
            One of `topics`.
        progress : callable, optional
            Called now and then with the bytes consumed so far.

        Raises
        ------
        ImuAllanError
            If `topic` is not one of `topics`, holds no message, or cannot be read at all.

        """
        choose_topic(self, topic)
        return self._taken(self._ahead(topic), topic, progress)

    def _ahead(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        if pays(self):
            # Where no further process is allowed, a thread does.
            with suppress(OSError):
                return ReadingProcess(self, topic).blocks()
        return read_ahead(larger_blocks(self.decoded(topic)))

    def _taken(
        self, ahead: Iterator[tuple[ImuBlock, int]], topic: str,
        progress: Callable[[int], None] | None,
    ) -> Iterator[ImuBlock]:
        empty = True
        try:
            for block, position in ahead:
                empty = False
                if progress is not None:
                    progress(position)
                yield block
        except OSError as error:
            raise ImuAllanError(
                f'{printable(self.path)}: reading failed '
                f'({printable(error.strerror or error)})') from error
        if empty:
            raise ImuAllanError(
                f'{printable(self.path)}: topic {printable(topic)} holds no readable message')
        if progress is not None:
            progress(self.size_bytes)

    @abstractmethod
    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks as the file has them, each with the bytes consumed so far."""

    @abstractmethod
    def close(self) -> None:
        """Release files."""

    def remark(self, code: str, message: str) -> None:
        """Add a remark, once."""
        remark = Remark(code, f'{printable(self.path)}: {message}')
        if remark not in self.remarks:
            self.remarks.append(remark)

    def __enter__(self) -> 'Recording':
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class MalformedMessages:
    """Counts what is not an Imu message on an Imu topic, and keeps the first reason."""

    def __init__(self) -> None:
        self.count = 0
        self.reason = ''

    def __call__(self, count: int, error: MalformedImu) -> None:
        self.count += count
        self.reason = self.reason or str(error)

    def report(self, recording: Recording, topic: str) -> None:
        """Add a remark to `recording` where there were any."""
        if self.count:
            recording.remark(
                'malformed_messages',
                f'{self.count} messages of {printable(topic)} are not valid sensor_msgs/Imu and '
                f'were left out; the first: {self.reason}')


def choose_topic(recording: Recording, topic: str | None = None) -> str:
    """
    Name the topic to read.

    Parameters
    ----------
    recording : Recording
        An open recording.
    topic : str, optional
        The user's choice, with or without a leading slash. It may be left out where the recording
        has exactly one Imu topic.

    Raises
    ------
    ImuAllanError
        If there is no such topic, it is of another type, it has no messages, or there are
        several to choose from.

    """
    path = printable(recording.path)
    names = {item.name: item for item in recording.topics}
    if topic is not None:
        spellings = [topic, f'/{topic}', topic.removeprefix('/')]
        chosen = next((name for name in spellings if name in names), None)
        if chosen is None:
            other = next((name for name in spellings if name in recording.other_topics), None)
            if other is None:
                raise ImuAllanError(
                    f'{path}: no topic {_shown(topic)}; {_what_there_is(recording)}')
            raise ImuAllanError(
                f'{path}: topic {_shown(other)} is of type '
                f'{_shown(recording.other_topics[other])}, not sensor_msgs/msg/Imu'
                f'{_carrier_hint(other in recording.carriers)}')
    elif not names:
        raise ImuAllanError(f'{path}: {_what_there_is(recording)}')
    elif len(names) > 1:
        raise ImuAllanError(
            f'{path}: {len(names)} Imu topics; choose one with --topic: {_list_topics(recording)}')
    else:
        [chosen] = names
    if names[chosen].count == 0:
        raise ImuAllanError(
            f'{path}: topic {_shown(chosen)} has no messages; record it while the IMU driver '
            'runs')
    return chosen


def _what_there_is(recording: Recording) -> str:
    if recording.topics:
        return f'its Imu topics are {_list_topics(recording)}'
    if not recording.other_topics:
        return 'it holds no topics at all: the recording is empty'
    shown = [f'{_shown(name)} ({_shown(kind)})'
             for name, kind in sorted(recording.other_topics.items())[:10]]
    more = len(recording.other_topics) - len(shown)
    return ('no topic of type sensor_msgs/msg/Imu; it holds ' + ', '.join(shown)
            + (f' and {more} more' if more else '') + _carrier_hint(bool(recording.carriers)))


def _carrier_hint(carries: bool) -> str:
    return ('; the Imu inside a message of another type is not read: republish it as '
            'sensor_msgs/msg/Imu' if carries else '')


def _list_topics(recording: Recording) -> str:
    shown = [
        _shown(topic.name) + ('' if topic.count is None else f' ({topic.count} messages)')
        for topic in sorted(recording.topics, key=lambda topic: topic.name)[:10]]
    more = len(recording.topics) - len(shown)
    return ', '.join(shown) + (f' and {more} more' if more else '')


def _shown(name: str) -> str:
    return printable(shorten(name))
