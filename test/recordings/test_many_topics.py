# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Many topics of one recording: it is opened once, and each is read as if by itself."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path
from random import Random
import tempfile

from bags import assert_same, block, database, IMU, insert, joined, START_NS
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu
from imu_allan.cli.main import main
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.recordings import open_recording, read_blocks
from imu_allan.recordings.recording import Recording
import pytest
import zstandard

Message = tuple[str, int, bytes]
"""Topic, stamp, and what is in it."""


def messages(topics: int, each: int) -> list[Message]:
    """Interleave topics at random; some change their frame_id, some messages are none."""
    choice = Random(topics)
    order = [number for number in range(topics) for _ in range(each)]
    choice.shuffle(order)
    found = []
    for place, number in enumerate(order):
        stamp = START_NS + place * 1_000_000
        frame = 'other_link' if number % 5 == 0 and place % 3 == 0 else 'imu_link'
        data = encode_imu(stamp, block(1, first=place).samples[0], frame)
        if number % 7 == 0 and place % 11 == 0:
            data = data[:50]
        found.append((f'/imu_{number}', stamp, data))
    return found


def write_packed_db3(path: Path, recorded: Sequence[Message]) -> Path:
    plain = path.with_suffix('.plain')
    topics = list(dict.fromkeys(topic for topic, *_ in recorded))
    with closing(database(plain, [(topic, IMU) for topic in topics])) as opened:
        for topic, *message in recorded:
            insert(opened, [message], topics.index(topic) + 1)
        opened.commit()
    path.write_bytes(zstandard.compress(plain.read_bytes()))
    return path


def read(opening: Callable[[], AbstractContextManager[Recording]], topic: str
         ) -> tuple[ImuBlock | str, list[tuple[str, int]], list[Finding]]:
    """Return all messages, or the complaint, where the frame_id changes, and the remarks."""
    with opening() as recording:
        try:
            blocks = list(read_blocks(recording, topic))
        except ImuAllanError as error:
            return str(error), [], recording.remarks
        frames: list[tuple[str, int]] = []
        for each in blocks:
            if frames and frames[-1][0] == each.frame_id:
                frames[-1] = each.frame_id, frames[-1][1] + len(each)
            else:
                frames.append((each.frame_id, len(each)))
        return joined(blocks), frames, recording.remarks


def test_each_of_many_topics_is_read_as_if_by_itself(tmp_path: Path) -> None:
    path = write_packed_db3(tmp_path / 'a', messages(8, 40))
    readable = 0
    with open_recording(path) as recording:
        for topic in [f'/imu_{number}' for number in range(8)]:
            one, frames, remarks = read(recording.for_another_topic, topic)
            other, other_frames, other_remarks = read(partial(open_recording, path), topic)
            assert frames == other_frames
            assert remarks == other_remarks
            if isinstance(one, str) or isinstance(other, str):
                assert one == other
            else:
                assert_same(one, other)
                readable += len(one) > 5
    assert readable == 8


def test_all_topics_of_a_compressed_file_have_one_copy_that_is_unpacked_once(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unpacked = tmp_path / 'unpacked'
    unpacked.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(unpacked))
    made: list[int] = []
    once = tempfile.mkdtemp

    def counted(*args: str | None, **kwargs: str | None) -> str:
        made.append(len(list(unpacked.iterdir())))
        return once(*args, **kwargs)

    monkeypatch.setattr(tempfile, 'mkdtemp', counted)
    path = write_packed_db3(tmp_path / 'h.db3.zstd', [
        message for message in messages(3, 200) if message[0] != '/imu_0'])
    assert main(['analyze', str(path), '--all-topics', '--no-progress', '--output',
                 str(tmp_path / 'out')]) == 0
    assert len(list((tmp_path / 'out').glob('*/result.json'))) == 2
    # One lists the topics, one serves them all.
    assert made == [0, 0]
    assert list(unpacked.iterdir()) == []
