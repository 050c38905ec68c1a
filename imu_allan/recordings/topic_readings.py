# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Several topics in one reading of a file: their messages, and the memory that they share."""

from collections.abc import Iterable, Mapping, Sequence
from heapq import merge
from itertools import groupby, islice
from operator import itemgetter

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.piece import Piece
import numpy as np

_UNDECODED_BYTES = 1 << 26
"""Of serialized messages that wait: some 30 of each of six thousand topics."""
_OBJECT_BYTES = 1 << 10
"""Of the arrays of a piece or a block beside their contents, about."""
NO_CHUNK = (1 << 63, '')
"""Behind the first damaged chunk, wherever that is."""
_MOST_COMMON = 1000
"""Remarks on all topics that are kept: of a thousand files, each of which may be damaged."""
_LARGE = 4
"""A topic with this part of the memory for all is read by itself; of smaller ones more fit."""


def is_large(size: int, most_bytes: int) -> bool:
    """Whether a topic of a size is read by itself where not all fit into the memory."""
    return _LARGE * size >= most_bytes


class TopicReading:
    """
    One Imu topic among several that are read at once.

    Attributes
    ----------
    imu : ImuTopic
        As the file has it that is being read.
    blocks : list of ImuBlock
        Its messages, of all files.
    messages : int
        How many of the file are decoded.
    malformed : MalformedMessages
        What of the file is none.
    broken_chunks, first_broken : int, (int, str)
        Damaged chunks of the file that hold messages of it; place and reason of the first.
    remarks : list of (int, Finding)
        What the user should know of this topic alone, with the number of the file.
    failure : ImuAllanError or None
        Why nothing can be read behind the last of `blocks`.
    dropped : bool
        Whether it is to be read by itself: there was no memory for it, or it failed otherwise.
    held_bytes : int
        Of `blocks`.

    """

    def __init__(self, imu: ImuTopic, memory: 'TopicReadings') -> None:
        self.blocks: list[ImuBlock] = []
        self.remarks: list[tuple[int, Finding]] = []
        self.failure: ImuAllanError | None = None
        self.dropped = False
        self.held_bytes = 0
        self._memory = memory
        self._undecoded: list[Piece] = []
        self.begin(imu)

    def begin(self, imu: ImuTopic) -> None:
        """Begin another file."""
        self.imu = imu
        self.messages = 0
        self.malformed = MalformedMessages()
        self.broken_chunks, self.first_broken = 0, NO_CHUNK
        self._decoder = imu.messages.decoder()

    @property
    def wanted(self) -> bool:
        """Whether it still takes messages."""
        return not self.dropped and self.failure is None

    def take(self, batches: Iterable[Sequence[Piece]]) -> None:
        """Take in messages, which are no views, in batches as they are decoded by themselves."""
        for pieces in batches:
            if not self.wanted:
                return
            if self.imu.messages.fields is not None:
                # Such a decoder finds from its first messages which of several stamps count.
                self._decode(pieces)
            else:
                self._undecoded += pieces
                self._memory.wait(self, sum(piece.rows.size + _OBJECT_BYTES for piece in pieces))

    def decode(self) -> None:
        """Decode what waits, as few pieces as possible."""
        waiting, self._undecoded = self._undecoded, []
        if waiting and self.wanted:
            self._decode([_joined(list(run)) for _, run in groupby(
                waiting, lambda piece: piece.rows.shape[1])])

    def drop(self) -> None:
        """Give its memory back."""
        self.dropped = True
        self._memory.release(self.held_bytes)
        self.held_bytes = 0
        self.blocks, self._undecoded = [], []

    def _decode(self, pieces: Sequence[Piece]) -> None:
        try:
            blocks = self._decoder(pieces, self.malformed)
        except ImuAllanError as error:
            # It is raised to whoever asks for the messages of this topic; the others go on.
            self.failure = error
            return
        except Exception:
            # By itself it meets it again, or has memory enough.
            self.drop()
            return
        self.blocks += blocks
        self.messages += sum(map(len, blocks))
        self._memory.hold(self, sum(_size(block) for block in blocks))


class TopicReadings:
    """
    The topics of one reading.

    Attributes
    ----------
    by_name : dict of str to TopicReading
    by_source : dict of str to list of TopicReading
        Those of the present file, by the topic that is recorded.
    crowded : set of str
        The last ones, which were given up for want of memory although they are small.
    given_up : bool
        Whether there was memory for none of them.

    Parameters
    ----------
    imus : iterable of ImuTopic
        Where the memory does not do for all, the last ones are given up.
    most_bytes : int
        Of decoded messages that are held.

    """

    def __init__(self, imus: Iterable[ImuTopic], most_bytes: int) -> None:
        self.by_name = {imu.name: TopicReading(imu, self) for imu in imus}
        self.by_source: dict[str, list[TopicReading]] = {}
        self.crowded: set[str] = set()
        self.given_up = not self.by_name
        self._most = most_bytes
        self._common: list[tuple[int, Finding]] = []
        self._file = 0
        self._held = self._undecoded = 0
        self._waiting: dict[str, TopicReading] = {}
        self.begin({name: reading.imu for name, reading in self.by_name.items()})

    def begin(self, imus: Mapping[str, ImuTopic]) -> None:
        """Begin a file, which has these topics."""
        self._file += 1
        self.by_source = {}
        for name, imu in imus.items():
            reading = self.by_name.get(name)
            if reading is not None and reading.wanted:
                reading.begin(imu)
                self.by_source.setdefault(imu.topic, []).append(reading)

    def tell(self, remarks: Iterable[Finding], reading: TopicReading | None = None) -> None:
        """Keep what is to be said of the present file, or of one topic in it."""
        if reading is not None:
            reading.remarks += [(self._file, remark) for remark in remarks]
        else:
            self._common += [(self._file, remark) for remark in islice(
                remarks, _MOST_COMMON - len(self._common))]

    def remarks_on(self, name: str) -> list[Finding]:
        """Give all remarks on a topic in the order of the files."""
        return [remark for _, remark in merge(
            self._common, self.by_name[name].remarks, key=itemgetter(0))]

    @property
    def present(self) -> list[TopicReading]:
        """Return those of the present file that are still wanted."""
        return [reading for same in self.by_source.values() for reading in same if reading.wanted]

    def holds(self, name: str) -> bool:
        """Whether the messages of a topic are there."""
        return name in self.by_name and not self.by_name[name].dropped

    def drop(self) -> None:
        """Give all up: each is to be read by itself."""
        for reading in self.by_name.values():
            reading.drop()
        self.given_up = True

    def wait(self, reading: TopicReading, size: int) -> None:
        """Let messages wait until it is worth while to decode them."""
        self._waiting[reading.imu.name] = reading
        self._undecoded += size
        if self._undecoded > _UNDECODED_BYTES:
            self.decode()

    def decode(self) -> None:
        """Decode what waits."""
        waiting, self._waiting, self._undecoded = self._waiting, {}, 0
        for reading in waiting.values():
            reading.decode()

    def hold(self, reading: TopicReading, size: int) -> None:
        """Count decoded messages; where they are too many, topics are given up."""
        reading.held_bytes += size
        self._held += size
        if self._held > self._most:
            self._make_room()

    def release(self, size: int) -> None:
        """Count decoded messages that are held no longer."""
        self._held -= size

    def _make_room(self) -> None:
        """Give up a topic that takes a large part of the memory, or a quarter of it at the end."""
        largest = max(self.by_name.values(), key=lambda reading: reading.held_bytes)
        if is_large(largest.held_bytes, self._most):
            largest.drop()
        else:
            left = self._held - self._most // _LARGE
            for name, reading in reversed(self.by_name.items()):
                if self._held <= left:
                    break
                self.crowded.add(name)
                reading.drop()
        self.given_up = all(reading.dropped for reading in self.by_name.values())


def _joined(pieces: list[Piece]) -> Piece:
    if len(pieces) == 1:
        return pieces[0]
    return Piece(np.concatenate([piece.rows for piece in pieces]),
                 np.concatenate([piece.receive_ns for piece in pieces]))


def _size(block: ImuBlock) -> int:
    return (block.samples.nbytes + block.header_ns.nbytes + block.receive_ns.nbytes
            + block.absent.nbytes + _OBJECT_BYTES)
