# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
rosbag2 directories: metadata.yaml and the files it lists.

The fields used here are the same in versions 1 to 9 of metadata.yaml. Compression of messages and
files is recognized by their first bytes, not from the metadata. A directory without metadata,
whose recorder was killed, is read as well.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import brief, error_about, ImuAllanError, printable
from imu_allan.recordings.messages.type_names import IMU_TYPES, may_hold_imu, TEMPERATURE_TYPES
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import BAG_SUFFIXES, ImuTopic, Recording
from imu_allan.wording import natural
import yaml

# It loads only texts, lists and mappings: other features let a few lines expand to gigabytes. The
# one in C needs a fraction of a second for a megabyte.
_LOADER = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)


class BagDirectory(Recording):
    """A rosbag2 directory, read with `open_file`; raises ImuAllanError if it has no files."""

    def __init__(
        self, path: Path, open_file: Callable[..., Recording], options: RecordingOptions,
    ) -> None:
        super().__init__(path, options)
        self._open_file = open_file
        listed = self._read_metadata()
        self._files = self._existing(listed) if listed else recorded_files(path)
        if not self._files:
            raise error_about(
                path, 'holds no recording: no metadata.yaml and no .mcap or .db3 file'
                if any(path.iterdir()) else 'an empty folder; name a recording')
        if (not self.topics or any(topic.count == 0 for topic in self.topics)
                or any(map(may_hold_imu, self.other_topics.values()))
                or TEMPERATURE_TYPES & set(self.other_topics.values())
                or options.gyro is not None or options.accel is not None):
            # The files are more reliable, and may contain definitions of the other types.
            self._list_from_files()
        self.size_bytes = sum(file.stat().st_size for file in self._files)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read the files in turn."""
        messages = 0
        with closing(self._parts()) as parts:
            for part, before, size in parts:
                if topic in {item.name for item in (*part.topics, *part.thermometers)}:
                    for block, position in part.decoded(topic):
                        messages += len(block)
                        # Of a compressed file, the position is that in the unpacked one.
                        yield block, before + position * size // part.size_bytes
        counted = self.imu(topic).count or 0
        # Other remarks may already explain why messages are missing, unless most are.
        if 2 * messages < counted or (messages < counted and {
                'damaged_recording', 'malformed_messages', 'missing_file', 'truncated_recording',
                'unfinished_recording'}.isdisjoint(remark.code for remark in self.remarks)):
            self.remark('lost_messages', found=messages, counted=counted, topic=printable(topic),
                        lost_share=1 - messages / counted)

    def _parts(self) -> Generator[tuple[Recording, int, int], None, None]:
        """
        Open the files in turn; yield each, the bytes before it and its own, and keep its remarks.

        If a file is not the only one, an error is reported as a remark.
        """
        sizes = [file.stat().st_size for file in self._files]
        for number, file in enumerate(self._files):
            try:
                part = self._open_file(file, options=self.options)
            except ImuAllanError as error:
                if len(sizes) == 1:
                    raise
                self.remark('damaged_recording', fault='file', reason=str(error))
                continue
            with part:
                yield part, sum(sizes[:number]), sizes[number]
                self.keep_remarks_of(part, small=2 * sizes[number] < self.size_bytes)

    def _list_from_files(self) -> None:
        counted = {topic.name: topic.count or None for topic in self.topics}
        listed = {topic.name: replace(topic, count=None) for topic in self.topics}
        found = dict(listed)
        for part, _, _ in self._parts():
            for topic in part.topics:
                if topic.count is not None and topic.name in found:
                    topic = replace(topic, count=topic.count + (found[topic.name].count or 0))
                found[topic.name] = topic
            known = {thermometer.name for thermometer in self.thermometers}
            self.thermometers += [replace(thermometer, count=None)
                                  for thermometer in part.thermometers
                                  if thermometer.name not in known]
            self.other_topics.update(part.other_topics)
            self.reasons.update(part.reasons)
        self.topics = [replace(topic, count=counted.get(name)) if topic.count is None else topic
                       for name, topic in found.items()
                       if topic is not listed.get(name) or name not in self.reasons]
        recorded = {topic.topic for topic in self.topics}
        self.other_topics = {name: kind for name, kind in self.other_topics.items()
                             if name not in recorded}

    def _read_metadata(self) -> list[str]:
        """Read topics and file names from metadata.yaml; without it, add a remark, return none."""
        path = self.path / 'metadata.yaml'
        if not path.is_file():
            if recorded_files(self.path):
                self.remark('no_metadata', reason=None)
            return []
        # 500 topics of two publishers each take 700,000 bytes, with their quality of service.
        largest = 1 << 20
        try:
            with path.open('rb') as file:
                text = file.read(largest + 1)
            if len(text) > largest:
                raise ValueError(f'it is larger than {largest} bytes')
            files, self.topics, self.other_topics = _parse(yaml.load(text, _LOADER))
            return files
        except (yaml.YAMLError, ValueError, RecursionError, OverflowError) as error:
            reason = printable(' '.join(str(error).split())[:200])
            if not recorded_files(self.path):
                raise error_about(path, f'damaged ({reason})') from error
            self.remark('no_metadata', reason=reason)
            return []

    def _existing(self, names: list[str]) -> list[Path]:
        """Find the files by their listed names, with or without the suffix .zstd."""
        def stored(name: str) -> Path | None:
            spellings = name, f'{name}.zstd', name.removesuffix('.zstd')
            return next(filter(Path.is_file, map(self.path.joinpath, spellings)), None)

        files = [*map(stored, names)]
        found = [file for file in files if file is not None]
        missing = [name for name, file in zip(names, files, strict=True) if file is None]
        if missing:
            listed = ', '.join(brief(name) for name in missing[:10])
            if not found:
                here = recorded_files(self.path)
                itself = f', or name {printable(here[0].name)} itself' if here else ''
                raise error_about(self.path, f'missing {listed}: no file that metadata.yaml lists '
                                  f'is there; copy them beside it{itself}')
            self.remark(
                'missing_file', missing=len(missing), listed=len(names), files=listed,
                lost_share=len(missing) / len(names))
        return found


def _parse(document: object) -> tuple[list[str], list[ImuTopic], dict[str, str]]:
    """Parse files, Imu topics and other topics; raise ValueError if a field is missing."""
    information = _item(document, 'rosbag2_bagfile_information', dict)
    # Before version 4 the paths included the directory. Files outside of it are never read.
    files = [PurePosixPath(name).name if isinstance(name, str) else ''
             for name in _item(information, 'relative_file_paths', list)]
    if not all(files):
        raise ValueError('relative_file_paths holds something else than file names')
    if not files:
        raise ValueError('relative_file_paths is empty')
    if len(set(files)) < len(files):
        raise ValueError('relative_file_paths names a file twice')
    counts: dict[str, int] = {}
    others: dict[str, str] = {}
    for entry in _item(information, 'topics_with_message_count', list):
        topic = _item(entry, 'topic_metadata', dict)
        name, kind = _item(topic, 'name', str), _item(topic, 'type', str)
        form = _item(topic, 'serialization_format', str)
        if kind in IMU_TYPES and form == 'cdr':
            count = _item(entry, 'message_count', str)[:21]
            # Any 64-bit number has at most twenty digits.
            if not (count.isascii() and count.isdecimal()) or int(count) >= 1 << 63:
                raise ValueError(f'message_count is {count}')
            counts[name] = counts.get(name, 0) + int(count)
        else:
            others[name] = kind if form == 'cdr' else f'{kind} encoded as {form}'
    return files, [ImuTopic(name, count) for name, count in counts.items()], others


def _item(mapping: object, key: str, kind: type) -> Any:
    value = mapping.get(key) if isinstance(mapping, dict) else None
    if not isinstance(value, kind):
        raise ValueError(f'no {key}')
    return value


def recorded_files(path: Path) -> list[Path]:
    """List the recorded files in the order of their numbers."""
    return sorted(
        (file for file in path.iterdir() if file.name.endswith(BAG_SUFFIXES) and file.is_file()),
        key=lambda file: natural(file.name))
