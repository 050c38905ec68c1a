# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
MCAP files, read chunk by chunk, whether complete or damaged.

Records are parsed by the `mcap` library, except messages and message indexes: a chunk is
decompressed as a whole, and the messages of the topic are gathered from it as arrays. The file is
read from its start, so that a missing end makes no difference. The summary at its end is used to
list topics, to count messages, and to find the next chunk after a damaged place.

References
----------
MCAP format specification, https://mcap.dev/spec

"""

from collections.abc import Callable, Iterator, Set as AbstractSet
from io import BytesIO, SEEK_CUR
from pathlib import Path
from struct import error as StructError, Struct
from typing import BinaryIO, TypeVar

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.chunked_file import (
    Channel,
    ChunkedRecording,
    Damage,
    Decode,
    LARGEST_CHUNK,
    LARGEST_DESCRIPTION,
    Part,
)
from imu_allan.recordings.formats.decompress import (
    crc32,
    DamagedData,
    decompress,
    ReadingLimits,
    unpacked,
)
from imu_allan.recordings.formats.gather import gather, OPCODE_LENGTH, RECORD_HEAD
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.options import RecordingOptions
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord, Footer, Schema, Statistics
import numpy as np

MAGIC = b'\x89MCAP0\r\n'

Record = TypeVar('Record')
Index = Callable[[], Ints]
Gathered = Callable[..., tuple[list[ImuBlock], int]]
"""Takes a buffer and optionally its message index; returns decoded blocks and bytes consumed."""

_LONGEST_NAME = 4096
"""DDS allows 255 characters; a much longer name is damage and is not kept in memory."""
WINDOW = 1 << 22
"""Bytes read at a time outside of chunks."""


class McapRecording(ChunkedRecording):
    """An MCAP file."""

    # They take a fifth of a second.
    _most_steps = 100_000

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        self._schemas: dict[int, tuple[str, Definition | None]] = {}
        super().__init__(path, stored, options)

    def _blocks(self, file: BinaryIO, part: Part, wanted: AbstractSet[int],
                enter: Callable[[int], None], decode: Decode, limits: ReadingLimits,
                ) -> Iterator[list[ImuBlock]]:
        def describe(opcode: int, body: bytes) -> None:
            number = self._describe(opcode, body)
            if number is not None:
                enter(number)

        def gathered(buffer: bytes, index: Index | None = None) -> tuple[list[ImuBlock], int]:
            batches, consumed = gather(buffer, wanted, describe, index, limits)
            return decode(unpacked(batches, limits)), consumed

        file.seek(part.start)
        limits.begin(part.length)
        if not part.is_chunk:
            yield from _stream(file, part.length, gathered)
            return
        # Hold no buffer while the caller works. Memory freed before the next buffer is allocated
        # is reused, which saves a quarter of the decompression time.
        blocks, rest = _chunk(file, part, gathered, limits)
        yield blocks
        if rest:
            raise DamagedData(f'{rest} bytes at its end are not whole records')

    def _read_index(self, file: BinaryIO) -> bool:
        """Read channels, counts and chunk offsets from the summary; return False without one."""
        if file.read(len(MAGIC)) != MAGIC:
            raise ImuAllanError(f'{printable(self.path)}: not an MCAP file')
        footer_size = RECORD_HEAD + 20   # two offsets and a checksum: 8 + 8 + 4 (MCAP, op 0x02)
        footer_at = self.size_bytes - footer_size - len(MAGIC)
        if footer_at < len(MAGIC):
            return False
        file.seek(footer_at)
        tail = file.read(footer_size + len(MAGIC))
        opcode, length = OPCODE_LENGTH.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != 20 or tail[-len(MAGIC):] != MAGIC:
            return False
        footer = _parsed(Footer.read, tail[RECORD_HEAD:footer_size])
        if footer is None or not len(MAGIC) <= footer.summary_start < footer_at:
            return False
        # Two million indexes of 100 bytes. A larger summary is not loaded; the file is scanned
        # instead.
        if footer_at - footer.summary_start > 1 << 28:
            return False
        file.seek(footer.summary_start)
        summary = file.read(footer_at - footer.summary_start)
        if footer.summary_crc and footer.summary_crc != crc32(
                tail[:footer_size - 4], crc32(summary)):
            return False
        at = 0
        index_head = Struct('<QQQ')
        while len(summary) - at >= RECORD_HEAD:
            opcode, length = OPCODE_LENGTH.unpack_from(summary, at)
            body = summary[at + RECORD_HEAD:at + RECORD_HEAD + length]
            at += RECORD_HEAD + length
            if opcode == Opcode.STATISTICS and len(body) <= LARGEST_DESCRIPTION:
                statistics = _parsed(Statistics.read, body)
                if statistics is not None:
                    self._counts = statistics.channel_message_counts
                    self._counted = bool(self._counts) or statistics.message_count == 0
                    self.ends_ns = [statistics.message_start_time, statistics.message_end_time]
            elif opcode == Opcode.CHUNK_INDEX and len(body) >= index_head.size:
                # Only the offset is needed; the library would parse the whole ChunkIndex entry by
                # entry.
                *_, chunk_start = index_head.unpack_from(body)
                if chunk_start < self.size_bytes:
                    self._chunk_starts.append(chunk_start)
            else:
                self._describe(opcode, body)
        self._chunk_starts.sort()
        return bool(self._channels)

    def _describe(self, opcode: int, body: bytes) -> int | None:
        """Store a schema or channel record; return the id of a new channel."""
        number = int.from_bytes(body[:2], 'little')
        known = self._schemas if opcode == Opcode.SCHEMA else self._channels
        if (opcode not in (Opcode.SCHEMA, Opcode.CHANNEL) or number in known
                or len(body) > LARGEST_DESCRIPTION):
            return None
        if not self.reserve_bytes(len(body)):
            return None
        if opcode == Opcode.SCHEMA:
            schema = _parsed(Schema.read, body)
            if schema is not None and len(schema.name) <= _LONGEST_NAME:
                form = FORMS.get(schema.encoding)
                self._schemas[number] = schema.name, (
                    None if form is None or not schema.data.strip()
                    else Definition(schema.data.decode('utf-8', 'replace'), form))
        elif opcode == Opcode.CHANNEL:
            channel = _parsed(ChannelRecord.read, body)
            if channel is not None and len(channel.topic) <= _LONGEST_NAME:
                name, definition = self._schemas.get(channel.schema_id, ('', None))
                self._channels[number] = Channel(
                    channel.topic, name, channel.message_encoding[:_LONGEST_NAME], definition)
                return number
        return None

    def _parts(self, file: BinaryIO, damage: Damage) -> Iterator[Part]:
        """Yield the parts of the data section: chunks, and runs of records outside of chunks."""
        at = len(MAGIC)
        part: Part | None = None
        loose = (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
        while True:
            file.seek(at)
            head = file.read(RECORD_HEAD)
            opcode, length = OPCODE_LENGTH.unpack(head) if len(head) == RECORD_HEAD else (0, 0)
            start = at + RECORD_HEAD
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            if opcode == 0 or start + length > (self._next_chunk(at) or self.size_bytes):
                known = self._skip_to_chunk(at, damage, opcode == Opcode.CHUNK)
                if known is None:
                    break
                at = known
                continue
            if opcode == Opcode.MESSAGE_INDEX and part is not None and part.is_chunk:
                number = int.from_bytes(file.read(2), 'little')
                part.indexes[number] = start + 6, max(0, length - 6) // 16
                at = start + length
                continue
            if part is not None and not (
                    opcode in loose and not part.is_chunk and part.start + part.length == at):
                yield part
                part = None
            if opcode == Opcode.CHUNK:
                part = Part(start, length, True)
                damage.chunks += 1
            elif opcode in loose:
                if part is None:
                    part = Part(at, 0, False)
                part.length = start + length - part.start
            at = start + length
        if part is not None:
            yield part


def _chunk(file: BinaryIO, part: Part, gathered: Gathered, limits: ReadingLimits,
           ) -> tuple[list[ImuBlock], int]:
    """Decode a chunk; also return the number of bytes at its end that are not records."""
    chunk_head = Struct('<QQQII')
    head = file.read(min(chunk_head.size, part.length))
    if len(head) < chunk_head.size:
        raise DamagedData('a chunk record without a header')
    _, _, size, crc, text = chunk_head.unpack(head)
    rest = part.length - chunk_head.size
    if text > min(rest - 8, _LONGEST_NAME):
        raise DamagedData(f'a compression name of {text} bytes')
    compression = file.read(text).decode('utf-8', 'replace')
    stored = int.from_bytes(file.read(8), 'little')
    if stored > rest - 8 - text:
        raise DamagedData(f'{stored} bytes declared in a record of {part.length}')
    if max(size, stored) > LARGEST_CHUNK:
        raise DamagedData(f'{max(size, stored)} bytes are more than a chunk may have')
    if compression not in ('', 'none'):
        limits.expand(size)
    data = decompress(compression, file.read(stored), size)
    if crc and crc32(data) != crc:
        raise DamagedData('its checksum does not match')
    blocks, consumed = gathered(data, lambda: _message_places(file, part))
    return blocks, len(data) - consumed


def _message_places(file: BinaryIO, part: Part) -> Ints:
    """Read the message offsets declared by the indexes after a chunk, unless absurdly many."""
    places = [np.zeros(0, np.int64)]
    if 16 * sum(count for _, count in part.indexes.values()) <= LARGEST_CHUNK:
        for start, count in part.indexes.values():
            file.seek(start)
            places.append(np.frombuffer(file.read(16 * count), '<i8').reshape(-1, 2)[:, 1])
    return np.concatenate(places)


def _stream(file: BinaryIO, left: int, gathered: Gathered) -> Iterator[list[ImuBlock]]:
    """Decode records outside of chunks, one window at a time."""
    kept = b''
    while left:
        window = file.read(min(WINDOW, left))
        if not window:
            raise DamagedData(f'it ends {left} bytes early')
        left -= len(window)
        window = kept + window
        blocks, consumed = gathered(window)
        kept = window[consumed:]
        del window
        yield blocks
        if len(kept) > RECORD_HEAD:
            _, length = OPCODE_LENGTH.unpack_from(kept)
            missing = RECORD_HEAD + length - len(kept)
            if missing <= 0 or missing > left:
                break
            if missing > WINDOW:
                # Too large for an Imu message; probably an image or a point cloud.
                kept = b''
                left -= missing
                file.seek(missing, SEEK_CUR)
    if kept:
        raise DamagedData(f'{len(kept) + left} bytes at its end are not whole records')


def _parsed(read: Callable[[ReadDataStream], Record], body: bytes) -> Record | None:
    """Parse one record; return None if its content is damaged."""
    try:
        return read(ReadDataStream(BytesIO(body)))
    except (McapError, StructError, UnicodeDecodeError):
        return None
