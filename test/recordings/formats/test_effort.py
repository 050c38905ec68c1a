# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a whole file may expand to, whatever its chunks are."""

import bz2
from pathlib import Path
import struct

from bags import block, IMU, read, ros1_record, write_bag, write_mcap
from imu_allan.cdr import encode_imu_rows
from imu_allan.recordings.formats import effort
from imu_allan.recordings.formats.gather import gather, in_batches
from measured_command import run
import numpy as np
import pytest
import zstandard

MESSAGES = block(1000)
TOO_MUCH = 'the file expands to more than 1000 times its size'


def record(opcode: int, body: bytes) -> bytes:
    return bytes([opcode]) + struct.pack('<Q', len(body)) + body


def message(data: bytes, channel: int = 1) -> bytes:
    return record(5, struct.pack('<HIQQ', channel, 0, 1, 1) + data)


def chunk(plain: bytes) -> bytes:
    packed = zstandard.compress(plain)
    return record(6, struct.pack('<QQQI', 0, 1, len(plain), 0) + b'\4\0\0\0zstd'
                  + struct.pack('<Q', len(packed)) + packed)


def with_chunks(path: Path, added: bytes) -> Path:
    """Write a recording in which others follow its chunks."""
    write_mcap(path, MESSAGES)
    content = path.read_bytes()
    # The end of the data section, behind which nothing is read.
    end = content.rindex(record(15, b'')[:9].replace(bytes(8), struct.pack('<Q', 4)))
    path.write_bytes(content[:end] + added)
    return path


def test_all_chunks_of_a_file_have_one_bound_together(tmp_path):
    zeros = chunk(message(bytes((1 << 26) - 31), 2))
    path = with_chunks(tmp_path / 'a.mcap', 40 * zeros)
    after, remarks = read(path)
    assert len(after) == len(MESSAGES)
    [told] = [remark.message for remark in remarks if TOO_MUCH in remark.message]
    left_out = int(told.split(' of ')[0].split()[-1])
    assert 25 < left_out < 40


def test_all_chunks_of_a_ros1_bag_have_one_bound_together(tmp_path, monkeypatch):
    monkeypatch.setattr(effort, 'PLAIN_BYTES', 1 << 22)
    monkeypatch.setattr(effort, 'MOST_RATIO', 2)
    path = write_bag(tmp_path / 'a.bag', MESSAGES)
    plain = ros1_record(bytes(1 << 20), op=b'\2', conn=b'\x63\0\0\0', time=bytes(8))
    packed = bz2.compress(plain)
    zeros = ros1_record(
        packed, op=b'\5', compression=b'bz2', size=struct.pack('<I', len(plain)))
    content = path.read_bytes()
    # In front of the index, which is left out.
    index = struct.unpack('<Q', content[content.index(b'index_pos=') + 10:][:8])[0]
    path.write_bytes(content[:index] + 24 * zeros)
    after, remarks = read(path)
    assert len(after) == len(MESSAGES)
    [told] = [remark.message for remark in remarks if 'expands to more than 2' in remark.message]
    assert 15 < int(told.split(' of ')[0].split()[-1]) < 24


def test_messages_that_expand_within_a_chunk_that_expands_are_not_held(tmp_path):
    bomb = message(zstandard.compress(bytes(1 << 16)))
    path = tmp_path / 'a.mcap'
    head = b'\x89MCAP0\r\n' + record(1, struct.pack('<I', 4) + b'ros2' + bytes(4))
    schema = struct.pack('<H', 1) + b''.join(
        struct.pack('<I', len(text)) + text for text in (IMU.encode(), b'ros2msg', b'bool x'))
    topic = struct.pack('<HH', 1, 1) + b''.join(
        struct.pack('<I', len(text)) + text for text in (b'/imu', b'cdr')) + bytes(4)
    path.write_bytes(head + chunk(record(3, schema) + record(4, topic) + 15_000 * bomb))
    assert path.stat().st_size < 1000
    status, _, complaint, _, kilobytes = run('analyze', path, '--no-progress')
    assert (status, complaint.count('\n')) == (1, 1)
    assert kilobytes < 500_000


def test_messages_whose_size_always_changes_are_decoded_a_few_at_a_time():
    count = 100_000
    data = b''.join(message(bytes(number % 2)) for number in range(count))
    pieces, consumed = gather(data, {1})
    assert consumed == len(data)
    sizes = [len(held) for held in in_batches(pieces)]
    assert sum(sizes) == count
    assert max(sizes) < 20_000


def test_the_messages_before_a_damaged_place_are_handed_on():
    rows = encode_imu_rows(MESSAGES)
    data = b''.join(message(row.tobytes()) for row in rows)

    def pieces():
        yield from gather(data, {1})[0]
        effort.Effort(Path(__file__), 0).expand(1 << 40)

    held = []
    with pytest.raises(ValueError, match=TOO_MUCH):
        held.extend(in_batches(pieces()))
    assert np.concatenate([piece.rows for some in held for piece in some]).shape == rows.shape
