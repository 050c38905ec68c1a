# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How much a file may say about its topics.

A few kilobytes of zstd hold hundreds of megabytes of definitions, and a megabyte of definitions
takes seconds to parse.
"""

from imu_allan.recordings.messages.definitions import Definition

_KEPT_BYTES = 1 << 26
"""Names and definitions that are kept; the largest definition of ROS itself has 40,000 bytes."""
_MOST_SEARCHED = 1000
"""Definitions that are searched for an IMU or a thermometer; a robot has a dozen."""
_SEARCHED_CHARACTERS = 1 << 21
"""In all of these together, which take seconds: fifty times the largest of ROS itself."""


class Descriptions:
    """
    What has been kept of the descriptions in a file, and searched.

    Attributes
    ----------
    searched : int
        Definitions that have been searched.

    """

    def __init__(self) -> None:
        self.searched = 0
        self._characters = self._bytes = 0

    def keep(self, size: int) -> bool:
        """Count the bytes of a description; False where it is one too many to be kept."""
        self._bytes += size
        return self._bytes <= _KEPT_BYTES

    def search(self, definition: Definition) -> bool:
        """Count a definition; False where it is one too many to be searched."""
        self._characters += len(definition.text)
        if self.searched >= _MOST_SEARCHED or self._characters > _SEARCHED_CHARACTERS:
            return False
        self.searched += 1
        return True
