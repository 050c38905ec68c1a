# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files of chunks, MCAP and ROS 1 bags: damage costs the chunk that has it."""

from bags import (
    block,
    chunk_starts,
    COMPRESSIONS,
    figures,
    read,
    ROS1_COMPRESSIONS,
    said,
    write_bag,
    write_mcap,
)
import numpy as np
import pytest

MESSAGES = block(3000)


@pytest.fixture(params=[
    *((write_mcap, name) for name in COMPRESSIONS),
    *((write_bag, name) for name in ROS1_COMPRESSIONS)], ids=lambda kind: kind[1])
def written(request, tmp_path):
    """Give a recording, where its chunks begin, and what it names as the begin of the third."""
    write, compression = request.param
    path = write(tmp_path / 'a', MESSAGES, compression=compression)
    starts = chunk_starts(path)
    return path, starts, starts[2] + (9 if write is write_mcap else 0)


def overwritten(path, start, with_bytes):
    """Read with other bytes there; returns the remark, and how many messages were lost."""
    data = bytearray(path.read_bytes())
    data[start:start + len(with_bytes)] = with_bytes
    path.write_bytes(data)
    after, [remark] = read(path)
    assert np.isin(after.receive_ns, MESSAGES.receive_ns).all()
    lost = 3000 - len(after)
    assert 20 < lost < 200
    return remark, lost


def test_a_damaged_chunk_is_left_out_and_counted(written):
    path, starts, named = written
    remark, lost = overwritten(path, starts[2] + 200, b'\xa5' * ((starts[3] - starts[2]) // 4))
    assert remark == said(path, 'damaged_recording', fault='chunks', broken=1,
                          chunks=len(starts), first=remark.values['first'], lost=lost, of=3000,
                          topic='/imu')
    assert figures(remark.values['first'])[0] == named


def test_reading_goes_on_at_the_next_chunk_that_the_index_names(written):
    path, starts, _ = written
    size = starts[3] - starts[2]
    remark, lost = overwritten(path, starts[2], b'\xff' * size)
    assert remark == said(path, 'damaged_recording', fault='holes', holes=1, lost=lost, of=3000,
                          topic='/imu', first=remark.values['first'])
    assert figures(remark.values['first']) == [size, starts[2]]
