# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every kind of recording is: topics, remarks, and temporary folders of unpacked files."""

from abc import ABC, abstractmethod
import atexit
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
import errno
from pathlib import Path
import secrets
import shutil
import tempfile
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu, MessageBatch, Serialization
from imu_allan.errors import error_about, ImuAllanError, printable
from imu_allan.finding import CODES, Finding, finding
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.definitions import Definition, normal_name, Types
from imu_allan.recordings.messages.imus_in import IMU_MESSAGES, imus_in, thermometer_in
from imu_allan.recordings.messages.type_names import IMU_TYPES, may_hold_imu, TEMPERATURE_TYPES
from imu_allan.recordings.options import RecordingOptions


@dataclass(frozen=True)
class ImuTopic:
    """
    An IMU in the messages of a topic.

    Attributes
    ----------
    name : str
        Topic name, followed by the field if the messages hold several IMUs.
    count : int or None
        Number of messages in the recording; None if the file does not state it.
    messages : ImuMessages
        How the messages are read; by default as sensor_msgs/msg/Imu.
    source : str
        Recorded topic; empty if it equals `name`.

    """

    name: str
    count: int | None
    messages: ImuMessages = IMU_MESSAGES
    source: str = ''

    @property
    def topic(self) -> str:
        """Return the name of the recorded topic."""
        return self.source or self.name


class TopicDecoder:
    """Decoder of one reading of an Imu topic that counts samples and malformed messages."""

    def __init__(self, imu: ImuTopic) -> None:
        self.imu, self._decode = imu, imu.messages.decoder()
        self.samples = self.malformed = 0
        self.reason = ''

    def __call__(self, batches: Iterable[MessageBatch]) -> list[ImuBlock]:
        blocks = self._decode(batches, self.reject)
        self.samples += sum(map(len, blocks))
        return blocks

    def reject(self, count: int, error: MalformedImu) -> None:
        """Count malformed messages and keep the first reason."""
        self.malformed += count
        self.reason = self.reason or str(error)

    def report(self, remark: Callable[..., None]) -> None:
        """Pass a finding to `remark` if any message of the topic was malformed."""
        if self.malformed:
            kind = self.imu.messages.type_name
            remark('malformed_messages', what='message', count=self.malformed,
                   lost_share=self.malformed / (self.imu.count or float('inf')),
                   topic=printable(self.imu.name), first=self.reason,
                   type='sensor_msgs/Imu' if kind in IMU_TYPES else printable(kind))


BAG_SUFFIXES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
"""Suffixes of the files in a rosbag2 directory."""


class Recording(ABC):
    """
    An open recording, used as a context manager.

    Attributes
    ----------
    path : Path
        Path that was opened.
    topics : list of ImuTopic
        The Imu topics.
    other_topics : dict of str to str
        Names and types of the other topics.
    reasons : dict of str to str
        Why some other topics are not read although they might hold an IMU.
    options : RecordingOptions
        The user's description of the recording.
    thermometers : list of ImuTopic
        Temperatures, decoded like Imu topics, with degrees Celsius in the first column. Those
        called ``TOPIC:FIELD`` are part of the messages of an Imu topic.
    preferred : tuple of str
        The topic, or the gyroscope and accelerometer topics, to read if the user names none. Empty
        if the user has to choose.
    preferred_for : str
        Why they are preferred, in words for the user.
    size_bytes : int
        Bytes that `decoded` processes, to report progress.
    untimed : bool
        Whether the samples have no times and are timed by the sample rate that the user gives.
    folders : list of Path
        Temporary folders of unpacked or copied files, which `close` removes.
    ends_ns : list of int
        First and last receive stamp of a bag file; empty if it does not say so.
    remarks : list of Finding
        Remarks on the file for the user; the list grows while the file is read.

    Notes
    -----
    A recording holds no open file, so that it can be pickled for the process that reads it.

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
        self.size_bytes = 0
        self.untimed = False
        self.folders: list[Path] = []
        self.ends_ns: list[int] = []
        self.remarks: list[Finding] = []

    @abstractmethod
    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Yield blocks in file order, each with the number of bytes consumed so far."""

    def close(self) -> None:
        """Remove what was unpacked or copied."""
        for folder in self.folders:
            shutil.rmtree(folder, ignore_errors=True)

    def for_another_topic(self) -> 'Recording':
        """Return this open recording for reading another topic, with its own remarks."""
        lent = copy(self)
        lent.remarks = [*self.remarks]
        return lent

    @property
    def by_name(self) -> Mapping[str, ImuTopic]:
        """Return `topics` by name."""
        return {imu.name: imu for imu in self.topics}

    def imu(self, name: str) -> ImuTopic:
        """Return the Imu topic or thermometer of this name."""
        return next(topic for topic in (*self.topics, *self.thermometers) if topic.name == name)

    def list_topic(
        self, topic: str, type_name: str, serialization: Serialization, count: int | None,
        definition: Definition | Types | None,
    ) -> bool:
        """Add a topic to `topics` and return True if it holds an IMU, else to `other_topics`."""
        found: dict[str, ImuMessages] = {}
        try:
            # A robot has a few hundred topics, and definitions take time.
            if len(self.topics) + len(self.other_topics) >= 1000 and may_hold_imu(type_name):
                raise ImuAllanError('not looked into, after 1000 other topics')
            found = imus_in(topic, type_name, serialization, definition, self.options)
        except ImuAllanError as error:
            self.reasons[topic] = str(error)
        if not found:
            self.other_topics[topic] = type_name
        for name, messages in found.items():
            self.topics.append(ImuTopic(name, count, messages, topic))
            if (thermometer := messages.fields.thermometer()) is not None:
                self.thermometers.append(ImuTopic(
                    f'{name}:{messages.fields.temperature}', count,
                    replace(messages, fields=thermometer), topic))
        # A robot has only a few topics that may hold the temperature.
        if normal_name(type_name) in TEMPERATURE_TYPES and len(self.thermometers) < 64:
            with suppress(ImuAllanError):
                self.thermometers.append(ImuTopic(topic, count, thermometer_in(
                    type_name, serialization, definition)))
        return bool(found)

    def remark(self, code: str, *, lost_share: float = 0.0, **values: Any) -> None:
        """Add a finding unless it is already there, one to act upon if most is lost by it."""
        self._keep_remark(finding(code, recording=printable(self.path), **values,
                                  severity='act' if lost_share > 0.5 else None))

    def keep_remarks_of(self, part: 'Recording', *, small: bool = False) -> None:
        """Add the remarks on a part of this recording; most of a `small` one is not most of it."""
        for remark in part.remarks:
            self._keep_remark(remark if not small else replace(
                remark, severity=CODES[remark.code].severity))

    def _keep_remark(self, remark: Finding) -> None:
        """Add a remark unless known; a folder may hold thousands of damaged files."""
        same = [kept for kept in self.remarks if kept.code == remark.code]
        if remark not in same and len(same) < 10:
            self.remarks.append(remark)

    def __enter__(self) -> 'Recording':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FileRecording(Recording):
    """A recording in one file, `stored`, which is opened and closed for each reading."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._stored = stored
        self.size_bytes = stored.stat().st_size


RESERVED_DISK_BYTES = 1 << 28
"""Bytes on the disk of the temporary folder that are always left free."""


def make_folder() -> tuple[Path, int]:
    """
    Create a temporary folder that only this user can access, removed at exit at the latest.

    Also return the bytes that may be written to it; negative if its disk is nearly full.
    """
    folder = Path(tempfile.gettempdir(), f'imu_allan_{secrets.token_hex(8)}')
    # Ctrl-C may come before the caller knows of the folder, or interrupt its removal.
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    folder.mkdir(mode=0o700)
    return folder, shutil.disk_usage(folder).free - RESERVED_DISK_BYTES


def unreadable_error(recording: Path, error: OSError, what: str = '') -> ImuAllanError:
    """Return the error to report; lack of disk space concerns the temporary copy."""
    reason = error.strerror or printable(error)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return error_about(recording, 'cannot be unpacked or copied to '
                           f'{printable(tempfile.gettempdir())} ({reason}); name a larger folder '
                           'with TMPDIR, or raise the limit (ulimit -f)')
    return error_about(recording, f'{what} ({printable(reason)})' if what else reason)
