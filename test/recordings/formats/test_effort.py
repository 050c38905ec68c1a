# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a whole file may expand to, whatever its chunks are."""

import bz2
from pathlib import Path
import struct

from bags import (
    block,
    figures,
    IMU,
    mcap_chunk,
    mcap_record,
    read,
    ros1_record,
    said,
    write_bag,
    write_mcap,
)
from imu_allan.cdr import encode_imu_rows
from imu_allan.finding import Finding
from imu_allan.recordings.formats import decompress
from imu_allan.recordings.formats.gather import gather, in_lists
from imu_allan.recordings.open_recording import open_recording
from measured_command import run
import numpy as np
import pytest
from repeated import slow
from whole_lines import refused, Varying
import zstandard

MESSAGES = block(1000)


def text(content: bytes) -> bytes:
    return struct.pack('<I', len(content)) + content


def message(data: bytes, channel: int = 1) -> bytes:
    return mcap_record(5, struct.pack('<HIQQ', channel, 0, 1, 1) + data)


def chunk(plain: bytes) -> bytes:
    return mcap_chunk(zstandard.compress(plain), len(plain))


def with_chunks(path: Path, added: bytes) -> Path:
    """Write a recording in which others follow its chunks."""
    write_mcap(path, MESSAGES)
    content = path.read_bytes()
    # The end of the data section, behind which nothing is read.
    end = content.rindex(mcap_record(15, b'')[:9].replace(bytes(8), struct.pack('<Q', 4)))
    path.write_bytes(content[:end] + added)
    return path


def assert_too_much(path: Path, remarks: list[Finding], chunks: int, times: int) -> int:
    """Return how many chunks were left out as the file expands to too much."""
    end, broken = remarks
    assert end == said(path, 'truncated_recording', fault='ends', whole_chunks=chunks,
                       end=end.values['end'])
    assert broken == said(path, 'damaged_recording', fault='chunks', chunks=chunks,
                          broken=broken.values['broken'], first=broken.values['first'])
    assert figures(broken.values['first'])[1:] == [times]
    return broken.values['broken']


def with_records(path: Path, added: bytes) -> Path:
    """Write a ROS 1 bag in which others stand in place of its index, which is left out."""
    content = write_bag(path, MESSAGES).read_bytes()
    index = struct.unpack('<Q', content[content.index(b'index_pos=') + 10:][:8])[0]
    path.write_bytes(content[:index] + added)
    return path


def bz2_chunk(plain: bytes) -> bytes:
    return ros1_record(bz2.compress(plain, 1), op=b'\5', compression=b'bz2',
                       size=struct.pack('<I', len(plain)))


def test_all_chunks_of_a_file_have_one_bound_together(tmp_path):
    zeros = chunk(message(bytes((1 << 26) - 31), 2))
    path = with_chunks(tmp_path / 'a.mcap', 40 * zeros)
    after, remarks = read(path)
    assert len(after) == len(MESSAGES)
    assert 25 < assert_too_much(path, remarks, 48, 1000) < 40


def test_all_chunks_of_a_ros1_bag_have_one_bound_together(tmp_path, monkeypatch):
    monkeypatch.setattr(decompress, 'PLAIN_BYTES', 1 << 22)
    monkeypatch.setattr(decompress, 'MOST_RATIO', 2)
    zeros = ros1_record(bytes(1 << 20), op=b'\2', conn=b'\x63\0\0\0', time=bytes(8))
    path = with_records(tmp_path / 'a.bag', 24 * bz2_chunk(zeros))
    after, remarks = read(path)
    assert len(after) == len(MESSAGES)
    assert 15 < assert_too_much(path, remarks, 32, 2) < 24


def test_messages_that_expand_within_a_chunk_that_expands_are_not_held(tmp_path):
    bomb = message(zstandard.compress(bytes(1 << 16)))
    path = tmp_path / 'a.mcap'
    head = b'\x89MCAP0\r\n' + mcap_record(1, struct.pack('<I', 4) + b'ros2' + bytes(4))
    schema = struct.pack('<H', 1) + text(IMU.encode()) + text(b'ros2msg') + text(b'bool x')
    topic = struct.pack('<HH', 1, 1) + text(b'/imu') + text(b'cdr') + bytes(4)
    path.write_bytes(head + chunk(mcap_record(3, schema) + mcap_record(4, topic) + 15_000 * bomb))
    assert path.stat().st_size < 1000
    status, _, complaint, _, kilobytes = run('analyze', path, '--no-progress')
    assert (status, complaint) == (
        1, f'imu_allan: {path}: topic /imu holds no readable message; --topic names another\n')
    assert kilobytes < 500_000


def channels(first: int, definitions: list[bytes]) -> bytes:
    """Describe topics of an MCAP, of a type each."""
    return b''.join(
        mcap_record(3, struct.pack('<H', number) + text(b'a/msg/T%d' % number) + text(b'ros2msg')
                    + text(definition))
        + mcap_record(4, struct.pack('<HH', number, number) + text(b'/t%d' % number) + text(b'cdr')
                      + bytes(4)) for number, definition in enumerate(definitions, first))


def connections(first: int, definitions: list[bytes]) -> bytes:
    """Describe topics of a ROS 1 bag of a type each."""
    return b''.join(
        ros1_record(b''.join(map(text, (b'topic=/t%d' % number, b'type=a/T%d' % number,
                                        b'md5sum=*', b'message_definition=' + definition))),
                    op=b'\7', conn=struct.pack('<I', number), topic=b'/t%d' % number)
        for number, definition in enumerate(definitions, first))


LONG = 15 * [b'#' + b'a' * 4_190_000]
"""A chunk of them has 63 MB."""


def mcap_of_definitions(path: Path) -> Path:
    return with_chunks(path, b''.join(
        chunk(channels(first, LONG)) for first in range(100, 145, 15)))


def bag_of_definitions(path: Path) -> Path:
    return with_records(path, b''.join(
        bz2_chunk(connections(first, LONG)) for first in range(100, 145, 15)))


@pytest.mark.parametrize(('write', 'most_kb'), [
    (mcap_of_definitions, 220_000),
    slow(bag_of_definitions, 350_000)])
def test_definitions_that_a_few_kilobytes_expand_to_are_not_kept(tmp_path, write, most_kb):
    path = write(tmp_path / 'a')
    assert path.stat().st_size < 500_000
    status, out, complaint, _, kilobytes = run('info', path, '--no-progress')
    assert (status, complaint) == (0, '')
    assert (f'warning: {path}: what it says about its topics is longer than any recorder writes; '
            'the topics from there on are not read') in out.splitlines()
    assert kilobytes < most_kb


def test_definitions_that_take_long_to_parse_are_not_all_searched(tmp_path):
    # Whatever is wrong with them costs little; what is right with them took 3 s a megabyte.
    path = with_chunks(tmp_path / 'a', chunk(channels(100, 60 * [
        b'sensor_msgs/Imu ] ' + b'a' * 100_000])))
    with open_recording(path) as recording:
        assert [imu.name for imu in recording.topics] == ['/imu']
        said = list(recording.reasons.values())
    assert len(said) == 60
    assert said[:20] == [Varying(f'the definition of a/msg/T{number} cannot be parsed (<words>)')
                         for number in range(100, 120)]
    assert set(said[20:]) == {'not looked into, after 20 others'}


@pytest.mark.slow
def test_connections_beyond_those_of_any_robot_are_not_listed_but_reported(tmp_path):
    path = write_bag(tmp_path / 'a.bag', MESSAGES)
    with path.open('ab') as file:
        file.write(connections(100, 70_000 * [b'']))
    after, [remark] = read(path)
    assert len(after) == len(MESSAGES)
    assert remark == said(path, 'many_topics', what='connections', listed=65_536)


def test_messages_whose_size_always_changes_are_decoded_a_few_at_a_time():
    count = 100_000
    data = b''.join(message(bytes(number % 2)) for number in range(count))
    batches, consumed = gather(data, {1})
    assert consumed == len(data)
    sizes = [len(held) for held in in_lists(batches)]
    assert sum(sizes) == count
    assert max(sizes) < 20_000


def test_the_messages_before_a_damaged_place_are_handed_on():
    rows = encode_imu_rows(MESSAGES)
    data = b''.join(message(row.tobytes()) for row in rows)

    def batches():
        yield from gather(data, {1})[0]
        decompress.ReadingLimits(Path(__file__), 0).expand(1 << 40)

    held = []
    with refused('the file expands to more than 1000 times its size', ValueError):
        held.extend(in_lists(batches()))
    assert np.concatenate([batch.rows for some in held for batch in some]).shape == rows.shape
