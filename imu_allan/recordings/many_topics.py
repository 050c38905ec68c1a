# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Many topics of one recording, which is gone through once for all of them, or as memory allows.

Each topic by itself would take as many readings as there are topics.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

from imu_allan.block import ImuBlock
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.recording import Recording
from imu_allan.recordings.topic_readings import TopicReadings
from imu_allan.result import Remark

HELD_BYTES = 1 << 27
"""Of messages that are held at a time: two million, each some 66 bytes."""


class ManyTopics:
    """
    Topics of a recording, to be analyzed one after the other.

    Parameters
    ----------
    reopen : callable
        Opens the recording.
    topics : sequence of str
        In the order in which they are asked for.
    held_bytes : int, optional
        Of messages that may be held. What does not fit is read when its turn comes, and a topic
        that would take a quarter of the memory by itself.

    """

    def __init__(self, reopen: Callable[[], Recording], topics: Sequence[str],
                 held_bytes: int = HELD_BYTES) -> None:
        self._reopen = reopen
        self._place = {topic: place for place, topic in enumerate(topics)}
        self._topics = topics
        self._held_bytes = held_bytes
        self._recording: Recording | None = None
        self._remarks: list[Remark] = []
        self._imus: Mapping[str, ImuTopic] = {}
        self._readings = TopicReadings((), held_bytes)
        self._until = 0
        self._holds_heat = True

    def __len__(self) -> int:
        return len(self._topics)

    def opening(self, topic: str) -> Recording:
        """
        Open the recording for one of the topics.

        Its messages come from memory where they were read with those of others; else this is the
        recording itself.

        Raises
        ------
        ImuAllanError
            As `open_recording`.

        """
        place = self._place[topic]
        if place >= self._until:
            self._read_from(place)
        if self._recording is not None and self._readings.holds(topic):
            return _HeldTopics(self._recording, self._imus, self._readings, [*self._remarks])
        return self._reopen()

    def close(self) -> None:
        """Release memory and files."""
        self._readings = TopicReadings((), self._held_bytes)
        if self._recording is not None:
            self._recording.close()
            self._recording = None

    def _read_from(self, place: int) -> None:
        """Read the topics from there on, as many as memory allows."""
        self._readings = TopicReadings((), self._held_bytes)
        if self._recording is None:
            self._recording = self._reopen()
            self._remarks = [*self._recording.remarks]
            self._imus = self._recording.by_name
        # A temperature belongs to many.
        heats = self._recording.thermometers if self._holds_heat else []
        readings = TopicReadings((*heats, *(
            self._imus[topic] for topic in self._topics[place:] if topic in self._imus)),
            self._held_bytes)
        with self._recording.remarks_apart() as common:
            try:
                self._recording.read_each(readings)
            except Exception as error:
                # Each topic would have met it, behind the same messages.
                readings.fail(error)
        readings.tell(common)
        self._readings = readings
        # No thermometer is so important that the topics had to come one by one.
        self._holds_heat = self._topics[place] not in readings.crowded
        self._until = place + 1
        with suppress(IndexError):
            while self._topics[self._until] not in readings.crowded:
                self._until += 1


class _HeldTopics(Recording):
    """A recording of which some topics are in memory."""

    def __init__(self, recording: Recording, imus: Mapping[str, ImuTopic],
                 readings: TopicReadings, remarks: list[Remark]) -> None:
        super().__init__(recording.path, recording.options)
        self.in_memory = True
        self.topics, self.thermometers = recording.topics, recording.thermometers
        self.other_topics, self.reasons = recording.other_topics, recording.reasons
        self.preferred, self.preferred_for = recording.preferred, recording.preferred_for
        self.apart, self.size_bytes = recording.apart, recording.size_bytes
        self.remarks = remarks
        self._recording = recording
        self._imus, self._readings = imus, readings

    @property
    def by_name(self) -> Mapping[str, ImuTopic]:
        """Return `topics` by their names."""
        return self._imus

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Give the blocks of a topic that are held, else read it."""
        if not self._readings.holds(topic):
            yield from self._recording.decoded(topic)
            return
        reading = self._readings.by_name[topic]
        for block in reading.blocks:
            yield block, self.size_bytes
        if reading.failure is not None:
            raise reading.failure.with_traceback(None)
        for remark in self._readings.remarks_on(topic):
            self.keep_remark(remark)

    def close(self) -> None:
        """Release nothing: the memory is that of all."""
