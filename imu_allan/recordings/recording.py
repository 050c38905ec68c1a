# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every kind of recording offers."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from copy import copy
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import Serialization
from imu_allan.errors import ImuAllanError, printable
from imu_allan.finding import Finding, finding
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.definitions import Definition, normal_name
from imu_allan.recordings.messages.imus_in import (
    imus_in,
    is_parsed,
    TEMPERATURE_TYPES,
    thermometer_in,
)
from imu_allan.recordings.options import RecordingOptions

BAG_SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
"""How the names of the files in a rosbag2 directory end."""
_MOST_REMARKS = 10
"""Remarks of one kind that are kept; a folder may hold thousands of damaged files."""
_KEPT_BYTES = 1 << 26
"""Names and definitions that are kept; the largest definition of ROS itself has 40,000 bytes. A
few kilobytes of zstd hold hundreds of megabytes of them."""


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
    reasons : dict of str to str
        Why others of them are not read although they might hold an IMU.
    options : RecordingOptions
        What the user says about it.
    thermometers : list of ImuTopic
        Temperatures, decoded like Imu topics, with degrees Celsius in the first column. Those
        called ``TOPIC:FIELD`` are part of the messages of an Imu topic.
    preferred : tuple of str
        The topic, or gyroscope and accelerometer, that is read where none is named; empty where
        the user is asked.
    preferred_for : str
        Why, for the user who might prefer another.
    apart : str
        Why what looks like the two halves of an IMU is not read as one; empty where nothing does.
    size_bytes : int
        Bytes that `decoded` goes through, for progress.
    untimed : bool
        Whether its samples have no times, and are counted at the stated rate.
    remarks : list of Finding
        What the user should know about the file; grows while it is read.

    Notes
    -----
    It holds paths and numbers, no open file: a large one is pickled for the process that reads it.

    """

    def __init__(
        self, path: Path, options: RecordingOptions = RecordingOptions(),  # noqa: B008
    ) -> None:
        self.path = path
        self.options = options
        self.topics: list[ImuTopic] = []
        self.thermometers: list[ImuTopic] = []
        self.other_topics: dict[str, str] = {}
        self.reasons: dict[str, str] = {}
        self.preferred: tuple[str, ...] = ()
        self.preferred_for = 'with the highest rate'
        self.apart = ''
        self.size_bytes = 0
        self.untimed = False
        self.remarks: list[Finding] = []
        self._withheld: dict[str, set[str]] = {}
        self._kept_bytes = self._searched = self._searched_characters = 0

    @abstractmethod
    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks as the file has them, each with the bytes consumed so far."""

    def close(self) -> None:  # noqa: B027
        """Release files; those that each reading opens and closes itself need nothing."""

    def again(self) -> 'AbstractContextManager[Recording]':
        """Lend it, open, for one topic of several, with remarks of its own; nothing is closed."""
        lent = copy(self)
        lent.remarks = [*self.remarks]
        lent._withheld = {code: set(reported) for code, reported in self._withheld.items()}
        return nullcontext(lent)

    @property
    def by_name(self) -> Mapping[str, ImuTopic]:
        """Return `topics` by their names."""
        return {imu.name: imu for imu in self.topics}

    def imu(self, name: str) -> ImuTopic:
        """Return one of `topics`, or of `thermometers`, by its name."""
        known = self.by_name
        return known[name] if name in known else next(
            heat for heat in self.thermometers if heat.name == name)

    def list_topic(
        self, topic: str, type_name: str, serialization: Serialization, count: int | None,
        definition: Definition | None,
    ) -> bool:
        """Enter a topic among `topics` and return True where it holds an IMU, else the others."""
        found: dict[str, ImuMessages] = {}
        if definition is not None and is_parsed(topic, type_name, definition, self.options):
            self._searched_characters += len(definition.text)
            # They take seconds: fifty times the largest of ROS itself. A robot has a dozen.
            if self._searched >= 1000 or self._searched_characters > 1 << 21:
                self.reasons[topic] = f'not looked into, after {self._searched} others'
                self.other_topics[topic] = type_name
                return False
            self._searched += 1
        try:
            found = imus_in(topic, type_name, serialization, definition, self.options)
        except ImuAllanError as error:
            self.reasons[topic] = str(error)
        if not found:
            self.other_topics[topic] = type_name
        for name, messages in found.items():
            self.topics.append(ImuTopic(name, count, messages, topic))
            self.list_own_thermometer(self.topics[-1])
        # A robot has a few topics that may hold the temperature.
        if normal_name(type_name) in TEMPERATURE_TYPES and len(self.thermometers) < 64:
            with suppress(ImuAllanError):
                self.thermometers.append(ImuTopic(topic, count, thermometer_in(
                    type_name, serialization, definition)))
        return bool(found)

    def keeps(self, size: int) -> bool:
        """Whether a description of so many bytes is kept; where not, that is reported."""
        self._kept_bytes += size
        if self._kept_bytes > _KEPT_BYTES:
            self.remark('many_definitions')
        return self._kept_bytes <= _KEPT_BYTES

    def list_own_thermometer(self, imu: ImuTopic) -> None:
        """Enter the temperature that the messages of an Imu topic hold, if they do."""
        fields = imu.messages.fields
        if fields is not None and (heat := fields.thermometer()) is not None:
            self.thermometers.append(ImuTopic(
                f'{imu.name}:{fields.temperature}', imu.count,
                replace(imu.messages, fields=heat, factors=(1.0, 1.0)), imu.topic))

    def remark(self, code: str, **values: Any) -> None:
        """Add a finding about this recording, once."""
        self._keep_remark(finding(code, recording=printable(self.path), **values))

    def keep_remarks_of(self, part: 'Recording') -> None:
        """Add the remarks on a recording of which this one is made."""
        for remark in part.remarks:
            self._keep_remark(remark)

    def _keep_remark(self, remark: Finding) -> None:
        """Add a remark, once; of the same kind ten are kept, and the others counted."""
        same = [kept.code for kept in self.remarks].count(remark.code)
        if remark in self.remarks:
            return
        if same < _MOST_REMARKS:
            self.remarks.append(remark)
            return
        withheld = self._withheld.setdefault(remark.code, set())
        withheld.add(repr(remark))
        rest = replace(remark, axes=(), values={'recording': printable(self.path),
                                                'more': len(withheld)})
        if same == _MOST_REMARKS:
            self.remarks.append(rest)
        else:
            last = max(i for i, kept in enumerate(self.remarks) if kept.code == remark.code)
            self.remarks[last] = rest

    def __enter__(self) -> 'Recording':
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class FileRecording(Recording):
    """A recording in one file, `stored`, which each reading opens and closes itself."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._stored = stored
        self.size_bytes = stored.stat().st_size
