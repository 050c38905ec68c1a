# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a whole file may expand to, whatever its chunks are."""

from pathlib import Path
import struct

from bags import (
    block,
    figures,
    mcap_chunk,
    mcap_record,
    read,
    said,
    write_mcap,
)
from imu_allan.recordings import open_recording
from imu_allan.recordings.formats.gather import gather, in_lists
from measured_command import run
import pytest
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


def test_all_chunks_of_a_file_have_one_bound_together(tmp_path):
    path = with_chunks(tmp_path / 'a.mcap', 40 * chunk(message(bytes((1 << 26) - 31), 2)))
    after, [end, broken] = read(path)
    assert len(after) == len(MESSAGES)
    assert end == said(path, 'truncated_recording', fault='ends', whole_chunks=48,
                       end=end.values['end'])
    assert broken == said(path, 'damaged_recording', fault='chunks', chunks=48,
                          broken=broken.values['broken'], first=broken.values['first'])
    assert 25 < broken.values['broken'] < 40
    assert figures(broken.values['first'])[1:] == [1000]


def channels(first: int, definitions: list[bytes]) -> bytes:
    """Describe topics of an MCAP, of a type each."""
    return b''.join(
        mcap_record(3, struct.pack('<H', number) + text(b'a/msg/T%d' % number) + text(b'ros2msg')
                    + text(definition))
        + mcap_record(4, struct.pack('<HH', number, number) + text(b'/t%d' % number) + text(b'cdr')
                      + bytes(4)) for number, definition in enumerate(definitions, first))


def test_definitions_that_a_few_kilobytes_expand_to_are_not_kept(tmp_path):
    # 63 MB in each chunk
    path = with_chunks(tmp_path / 'a', b''.join(
        chunk(channels(first, 15 * [b'#' + b'a' * 4_190_000])) for first in range(100, 145, 15)))
    assert path.stat().st_size < 500_000
    status, out, complaint, _, kilobytes = run('info', path, '--no-progress')
    assert (status, complaint) == (0, '')
    assert (f'warning: {path}: what it says about its topics is longer than any recorder writes; '
            'the topics from there on are not read') in out.splitlines()
    assert kilobytes < 220_000


@pytest.mark.parametrize('declared', [True, False])
def test_a_file_that_fills_the_disk_is_refused_and_leaves_nothing(
        tmp_path, monkeypatch, declared):
    path = tmp_path / 'a.db3.zstd'
    plain = 1 << 30
    compressor = zstandard.ZstdCompressor().compressobj(size=plain if declared else -1)
    path.write_bytes(b''.join(compressor.compress(bytes(1 << 22)) for _ in range(plain >> 22))
                     + compressor.flush())
    assert path.stat().st_size < 200_000
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(temporary))
    with refused(f'{path}: expands to more than 1000 times its size, as no recording of an IMU '
                 'does; if it is one, unpack it with: zstd -d'):
        open_recording(path)
    assert list(temporary.iterdir()) == []


def test_messages_whose_size_always_changes_are_decoded_a_few_at_a_time():
    count = 100_000
    data = b''.join(message(bytes(number % 2)) for number in range(count))
    batches, consumed = gather(data, {1})
    assert consumed == len(data)
    sizes = [len(held) for held in in_lists(batches)]
    assert sum(sizes) == count
    assert max(sizes) < 20_000


def test_definitions_that_cannot_be_parsed_are_named_and_not_all_searched(tmp_path):
    # Whatever is wrong with them costs little; what is right with them took 3 s a megabyte.
    path = with_chunks(tmp_path / 'a', chunk(channels(100, 60 * [
        b'sensor_msgs/Imu ] ' + b'a' * 100_000])))
    with open_recording(path) as recording:
        assert [imu.name for imu in recording.topics] == ['/imu']
        assert list(recording.reasons.values()) == [
            *(Varying(f'the definition of a/msg/T{number} cannot be parsed (<words>)')
              for number in range(100, 120)), *40 * ['not looked into, after 20 others']]
