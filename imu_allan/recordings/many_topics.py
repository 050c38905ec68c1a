# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Many topics of one recording, which is gone through once for all of them, or as memory allows.

Each topic by itself would take as many readings as there are topics.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

from imu_allan.block import ImuBlock
from imu_allan.finding import Finding
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.recording import Recording
from imu_allan.recordings.topic_readings import is_large, TopicReadings

HELD_BYTES = 1 << 27
"""Of messages that are held at a time: two million."""
_MESSAGE_BYTES = 66
"""Of a decoded message: two stamps, six readings, and which of them are absent."""
_MOST_BELIEVED = 16
"""Large topics of which a reading is spared; so many that are none cost little."""


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
        Of messages that may be held. What does not fit is read when its turn comes, and where not
        all fit, a topic that would take a quarter of the memory by itself.

    Notes
    -----
    One copy at a time is unpacked of a recording that is compressed as a whole.

    """

    def __init__(self, reopen: Callable[[], Recording], topics: Sequence[str],
                 held_bytes: int = HELD_BYTES) -> None:
        self._reopen = reopen
        self._place = {topic: place for place, topic in enumerate(topics)}
        self._topics = topics
        self._held_bytes = held_bytes
        self._recording: Recording | None = None
        self._open = False
        self._remarks: list[Finding] = []
        self._imus: Mapping[str, ImuTopic] = {}
        self._readings = TopicReadings((), held_bytes)
        self._until = 0
        self._holds_heat = True

    def __len__(self) -> int:
        return len(self._topics)

    @property
    def holds_bytes(self) -> int:
        """Bytes of messages that are in memory."""
        return sum(reading.held_bytes for reading in self._readings.by_name.values())

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
            recording = self._read_from(place)
            if recording is not None:
                return recording
        if self._recording is not None and self._readings.holds(topic):
            return _HeldTopics(self._recording, self._opened, self._imus, self._readings,
                               [*self._remarks])
        self._close_recording()
        return self._reopen()

    def close(self) -> None:
        """Release memory and files."""
        self._readings = TopicReadings((), self._held_bytes)
        self._close_recording()

    def _opened(self) -> Recording:
        """Return the recording that serves all topics, open."""
        if self._recording is None or not self._open:
            self._recording, self._open = self._reopen(), True
            self._remarks = [*self._recording.remarks]
            self._imus = self._recording.by_name
        return self._recording

    def _close_recording(self) -> None:
        """Release files; what was learned from them stays."""
        if self._recording is not None and self._open:
            self._open = False
            self._recording.close()

    def _read_from(self, place: int) -> Recording | None:
        """
        Read the topics from there on, as many as memory allows.

        Where there are no two to be read at once, none is, and a recording that was opened for
        it alone serves the first.
        """
        self._readings = TopicReadings((), self._held_bytes)
        is_new = not self._open
        recording = self._opened()
        # A temperature belongs to many.
        heats, asked = self._without_large(
            recording.thermometers if self._holds_heat else [],
            [self._imus[topic] for topic in self._topics[place:] if topic in self._imus])
        if len(asked) < 2:
            self._until = len(self._topics)
            if not is_new:
                return None
            self._open = False
            return recording
        readings = TopicReadings((*heats, *asked), self._held_bytes)
        with recording.remarks_apart() as common:
            try:
                recording.read_each(readings)
            except Exception:
                # Each topic by itself meets what it would have met, or has memory enough.
                readings.drop()
        readings.tell(common)
        self._readings = readings
        # No thermometer is so important that the topics had to come one by one.
        self._holds_heat = self._topics[place] not in readings.crowded
        self._until = place + 1
        with suppress(IndexError):
            while self._topics[self._until] not in readings.crowded:
                self._until += 1
        return None

    def _without_large(self, heats: Sequence[ImuTopic], imus: Sequence[ImuTopic]
                       ) -> tuple[Sequence[ImuTopic], Sequence[ImuTopic]]:
        """Leave out what is known to be too large to be held with the others."""
        sizes = {imu.name: _MESSAGE_BYTES * (imu.count or 0) for imu in (*heats, *imus)}
        large = {name for name, size in sizes.items() if is_large(size, self._held_bytes)}
        if sum(sizes.values()) <= self._held_bytes or len(large) > _MOST_BELIEVED:
            return heats, imus
        return ([heat for heat in heats if heat.name not in large],
                [imu for imu in imus if imu.name not in large])


class _HeldTopics(Recording):
    """A recording of which some topics are in memory."""

    def __init__(self, recording: Recording, opened: Callable[[], Recording],
                 imus: Mapping[str, ImuTopic], readings: TopicReadings,
                 remarks: list[Finding]) -> None:
        super().__init__(recording.path, recording.options)
        self.in_memory = True
        self.topics, self.thermometers = recording.topics, recording.thermometers
        self.other_topics, self.reasons = recording.other_topics, recording.reasons
        self.preferred, self.preferred_for = recording.preferred, recording.preferred_for
        self.apart, self.size_bytes = recording.apart, recording.size_bytes
        self.remarks = remarks
        self._opened = opened
        self._imus, self._readings = imus, readings

    @property
    def by_name(self) -> Mapping[str, ImuTopic]:
        """Return `topics` by their names."""
        return self._imus

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Give the blocks of a topic that are held, else read it."""
        if not self._readings.holds(topic):
            yield from self._opened().decoded(topic)
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
