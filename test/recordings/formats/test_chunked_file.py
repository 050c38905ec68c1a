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
BODY = {write_mcap: 9, write_bag: 0}
"""Bytes of a chunk before the place that is named."""

every_kind = pytest.mark.parametrize(('write', 'compression'), [
    *((write_mcap, name) for name in COMPRESSIONS),
    *((write_bag, name) for name in ROS1_COMPRESSIONS)])


@every_kind
def test_a_damaged_chunk_is_left_out_and_counted(tmp_path, write, compression):
    path = write(tmp_path / 'a.bag', MESSAGES, compression=compression)
    starts = chunk_starts(path)
    size = (starts[3] - starts[2]) // 4
    data = bytearray(path.read_bytes())
    data[starts[2] + 200:starts[2] + 200 + size] = b'\xa5' * size
    path.write_bytes(data)
    after, [remark] = read(path)
    lost = 3000 - len(after)
    assert 20 < lost < 200
    assert np.isin(after.receive_ns, MESSAGES.receive_ns).all()
    assert remark == said(path, 'damaged_recording', fault='chunks', broken=1,
                          chunks=len(starts), first=remark.values['first'], lost=lost, of=3000,
                          topic='/imu')
    assert figures(remark.values['first'])[0] == starts[2] + BODY[write]


@every_kind
def test_reading_goes_on_at_the_next_chunk_that_the_index_names(tmp_path, write, compression):
    path = write(tmp_path / 'a.bag', MESSAGES, compression=compression)
    starts = chunk_starts(path)
    size = starts[3] - starts[2]
    data = bytearray(path.read_bytes())
    data[starts[2]:starts[3]] = b'\xff' * size
    path.write_bytes(data)
    after, [remark] = read(path)
    lost = 3000 - len(after)
    assert 20 < lost < 200
    assert remark == said(path, 'damaged_recording', fault='holes', holes=1, lost=lost, of=3000,
                          topic='/imu', first=remark.values['first'])
    assert figures(remark.values['first']) == [size, starts[2]]
