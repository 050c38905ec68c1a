# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files, whole and damaged, and what a whole file may expand to."""

from functools import partial
import struct
import time

import bags
from bags import assert_same, block, chunk_starts, figures, read, said, serialized, write_mcap
from hypothesis import given, HealthCheck, settings, strategies as st
from imu_allan.recordings import open_recording
from imu_allan.recordings.formats.chunked_file import in_lists
from imu_allan.recordings.formats.mcap_file import gather
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import CompressionType
import numpy as np
import pytest
from whole_lines import refused, Varying
import zstandard

MESSAGES = block(1000)


def test_an_image_outside_of_chunks_larger_than_a_window_is_passed_over(tmp_path, monkeypatch):
    path = tmp_path / 'a.mcap'
    with bags.mcap_written(path, use_chunking=False) as message:
        for number, (stamp, row) in enumerate(serialized(MESSAGES)):
            if number % 100 == 50:
                message('/image', stamp, bytes(5000 + number), kind='')
            message('/imu', stamp, row)
    monkeypatch.setattr('imu_allan.recordings.formats.chunked_file.WINDOW', 1000)
    after, remarks = read(path)
    assert_same(MESSAGES, after)
    assert remarks == []


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 60)), max_size=120),
       st.booleans(), st.integers(0, 2))
def test_gathering_equals_stepping_through_with_the_mcap_library(tmp_path, records, index, seed):
    path = tmp_path / 'a.mcap'
    with bags.mcap_written(path, compression=CompressionType.NONE) as message:
        for stamp, (channel, size) in enumerate(records):
            for repeat in range(1 + 13 * (stamp % 3 == seed)):
                message(f'/{channel}', stamp, bytes([stamp % 256, repeat]) * size, kind='')
    with path.open('rb') as file:
        written = list(StreamReader(file, emit_chunks=True).records)
    places = np.array([at for record in written if isinstance(record, MessageIndex)
                       for _, at in record.records][::-1])
    for chunk in (record for record in written if isinstance(record, Chunk)):
        expected = [record for record in breakup_chunk(chunk) if hasattr(record, 'log_time')]
        # A program may add private records, but they move the messages from where the index says.
        private = b'\x90' + (3).to_bytes(8, 'little') + b'abc'
        data = private * (not index) + chunk.data + private
        for wanted in ({1}, {2, 4}, {1, 2, 3, 4}):
            batches, consumed = gather(
                data, wanted, lambda *_: None, partial(np.copy, places) if index else None)
            assert consumed == len(data)
            assert [(stamp, row.tobytes()) for batch in batches
                    for row, stamp in zip(batch.rows, batch.receive_ns.tolist(), strict=True)] == [
                (record.log_time, record.data) for record in expected
                if record.channel_id in wanted]


def test_several_channels_of_one_topic_are_read_together(tmp_path):
    path = tmp_path / 'a.mcap'
    with bags.mcap_written(path) as message:
        for number, (stamp, row) in enumerate(serialized(MESSAGES)):
            message('/imu', stamp, row, number=number * 3 // 1000)
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', 1000)]
    assert_same(MESSAGES, read(path)[0])


def test_ros1_messages_inside_mcap_are_read(tmp_path):
    path = tmp_path / 'a.mcap'
    with bags.mcap_written(path, 'ros1') as message:
        for stamp, row in serialized(MESSAGES, 'ros1'):
            message('/imu', stamp, row, 'sensor_msgs/Imu', encodings=('ros1', 'ros1msg'))
    assert_same(MESSAGES, read(path)[0])


@pytest.mark.parametrize('compression', bags.COMPRESSIONS)
def test_a_truncated_file_gives_every_message_of_every_whole_chunk(tmp_path, compression):
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES, compression=compression)
    whole = path.read_bytes()
    counts = []
    for number, start in enumerate(chunk_starts(path)[2:5], 2):
        end = start + 9 + struct.unpack_from('<Q', whole, start + 1)[0]
        path.write_bytes(whole[:end])
        after, [remark] = read(path)
        counts.append(len(after))
        assert_same(after, block(len(after)))
        assert remark == said(path, 'truncated_recording', fault='ends',
                              end=remark.values['end'], whole_chunks=number + 1)
        assert figures(remark.values['end']) == []
        path.write_bytes(whole[:end - 1])
        before, [remark] = read(path)
        assert_same(before, block(len(before)))
        assert len(before) < len(after)
        assert remark.values['whole_chunks'] == number
        assert figures(remark.values['end']) == [start, end - 1 - start]
    assert counts == sorted(set(counts))


def what_damages(path, start):
    """Read a file of which the chunk at `start` alone is damaged; gives the reported reason."""
    after, [remark] = read(path)
    assert 800 < len(after) < 1000
    first = remark.values['first']
    assert figures(first)[0] == start + 9
    assert remark == said(path, 'damaged_recording', fault='places', places=1, first=first,
                          lost=1000 - len(after), of=1000, topic='/imu')
    return first


def test_a_flipped_bit_that_decompresses_all_the_same_is_found_by_the_checksum(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES, compression='none')
    data = bytearray(path.read_bytes())
    start, end = chunk_starts(path)[1:3]
    data[(start + end) // 2] ^= 1
    path.write_bytes(data)
    assert 'checksum' in what_damages(path, start)


def test_a_file_cut_within_its_first_chunk_is_distinguished_from_an_empty_one(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES)
    start = chunk_starts(path)[0]
    path.write_bytes(path.read_bytes()[:start + 200])
    with refused(
            f'{path}: damaged, no topic can be found in it: the chunk at byte {start}, of which '
            '200 bytes are there, is lost'):
        open_recording(path)


@pytest.mark.parametrize(('compression', 'size', 'figures_said'), [
    ('lz4', 2**62, [2**62]), ('zstd', 2**28, []), ('none', 2**28, [])])
def test_sizes_that_a_chunk_declares_are_not_allocated(tmp_path, compression, size, figures_said):
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES, compression=compression)
    start = chunk_starts(path)[1]
    data = bytearray(path.read_bytes())
    struct.pack_into('<Q', data, start + 9 + 16, size)
    path.write_bytes(data)
    assert figures(what_damages(path, start))[1:][:len(figures_said)] == figures_said
    struct.pack_into('<Q', data, start + 1, 2**63 - 1)
    path.write_bytes(data)
    after, remarks = read(path)
    assert 800 < len(after) < 1000
    assert remarks[0].code == 'damaged_recording'


def record(opcode, body):
    return bytes([opcode]) + struct.pack('<Q', len(body)) + body


def text(content):
    return struct.pack('<I', len(content)) + content


def message(data, channel=1):
    return record(5, struct.pack('<HIQQ', channel, 0, 1, 1) + data)


def chunk(plain):
    """Return a chunk that zstd expands to these bytes."""
    packed = zstandard.compress(plain)
    return record(6, struct.pack('<QQQI', 0, 1, len(plain), 0) + text(b'zstd')
                  + struct.pack('<Q', len(packed)) + packed)


def with_chunks(path, added):
    """Write a recording in which others follow its chunks."""
    write_mcap(path, MESSAGES)
    content = path.read_bytes()
    # The end of the data section, behind which nothing is read.
    end = content.rindex(record(15, b'')[:9].replace(bytes(8), struct.pack('<Q', 4)))
    path.write_bytes(content[:end] + added)
    return path


def test_all_chunks_of_a_file_have_one_bound_together(tmp_path):
    path = with_chunks(tmp_path / 'a.mcap', 40 * chunk(message(bytes((1 << 26) - 31), 2)))
    after, [end, broken] = read(path)
    assert len(after) == len(MESSAGES)
    assert end == said(path, 'truncated_recording', fault='ends', whole_chunks=48,
                       end=end.values['end'])
    assert broken == said(path, 'damaged_recording', fault='places',
                          places=broken.values['places'], first=broken.values['first'],
                          severity='act')
    assert 25 < broken.values['places'] < 40
    assert figures(broken.values['first'])[1:] == [1000]


def channel(number, schema, topic):
    return record(4, struct.pack('<HH', number, schema) + text(topic) + text(b'cdr') + bytes(4))


def test_a_million_channels_take_neither_time_nor_memory(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', block(10), compression='none', use_chunking=False)
    content = path.read_bytes()
    place = content.index(channel(2, 2, b'/other'))
    many = b''.join(channel(3 + number % 65533, 2, b'/other') for number in range(200_000))
    path.write_bytes(content[:place] + many + content[place:-60])
    start = time.process_time()
    with open_recording(path) as recording:
        assert len(recording.topics) == 1
    assert time.process_time() - start < 20


def channels(first, definitions):
    """Describe topics of an MCAP, of a type each."""
    return b''.join(
        record(3, struct.pack('<H', number) + text(b'a/msg/T%d' % number) + text(b'ros2msg')
               + text(definition)) + channel(number, number, b'/t%d' % number)
        for number, definition in enumerate(definitions, first))


def test_messages_whose_size_always_changes_are_decoded_a_few_at_a_time():
    count = 100_000
    data = b''.join(message(bytes(number % 2)) for number in range(count))
    batches, consumed = gather(data, {1}, lambda *_: None, None)
    assert consumed == len(data)
    sizes = [len(held) for held in in_lists(batches)]
    assert sum(sizes) == count
    assert max(sizes) < 20_000


def test_definitions_that_cannot_be_parsed_are_named_and_not_all_searched(tmp_path):
    path = with_chunks(tmp_path / 'a', chunk(channels(100, 1010 * [b'sensor_msgs/Imu ]'])))
    with open_recording(path) as recording:
        assert [imu.name for imu in recording.topics] == ['/imu']
        assert list(recording.reasons.values()) == [
            *(Varying(f'the definition of a/msg/T{number} cannot be parsed (<words>)')
              for number in range(100, 1098)), *12 * ['not looked into, after 1000 other topics']]
