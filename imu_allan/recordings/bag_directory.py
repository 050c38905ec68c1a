# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
rosbag2 directories: metadata.yaml and the files it lists.

References
----------
rosbag2_storage, yaml.hpp: version 2 changed field sizes, 3 added compression, 4 the QoS profiles
and file paths without the directory, 5 the list of files, 6 custom data, 7 type hashes, 8 the ROS
distribution, 9 QoS profiles as YAML instead of text.
"""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.recording import IMU_TYPES, ImuTopic, Recording
import yaml


class BagDirectory(Recording):
    """
    A rosbag2 directory.

    Raises
    ------
    ImuAllanError
        If there is nothing to read in it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        information: Any = yaml.safe_load((path / 'metadata.yaml').read_text())[
            'rosbag2_bagfile_information']
        self._files = [path / PurePosixPath(name).name
                       for name in information['relative_file_paths']]
        self.size_bytes = sum(file.stat().st_size for file in self._files)
        for item in information['topics_with_message_count']:
            topic = item['topic_metadata']
            if topic['type'] in IMU_TYPES:
                self.topics.append(ImuTopic(topic['name'], item['message_count']))
            else:
                self.other_topics[topic['name']] = topic['type']

    def close(self) -> None:
        """Release nothing: each reading opens and closes the files itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read the files one after the other."""
        from imu_allan.recordings.open_recording import open_recording
        before = 0
        for file in self._files:
            with open_recording(file) as part:
                if topic in {item.name for item in part.topics}:
                    for block, position in part.decoded(topic):
                        yield block, before + position
                self.remarks += part.remarks
                before += part.size_bytes
        if not before:
            raise ImuAllanError(f'{printable(self.path)}: no data')
