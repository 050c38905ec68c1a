# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Selection of the part of a recording between two times."""

from collections.abc import Iterable, Iterator

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.wording import duration
import numpy as np


def between(blocks: Iterable[ImuBlock], start_s: float, duration_s: float | None, path: object,
            shortfall: list[Finding]) -> Iterator[ImuBlock]:
    """Yield what was received in a window; if less was recorded, add a finding to `shortfall`."""
    begin: int | None = None
    first = last = 0
    for block in blocks:
        if not len(block):
            continue
        if begin is None:
            first = int(block.receive_ns[0])
            begin = _later(first, start_s)
        last = int(block.receive_ns[-1])
        keep = block.receive_ns >= begin
        if duration_s is not None:
            keep &= block.receive_ns < _later(begin, duration_s)
            if not keep.any() and np.all(block.receive_ns >= _later(begin, duration_s)):
                return
        if keep.all():
            yield block
        elif keep.any():
            yield block.part(keep)
    if begin is None:
        return
    if last < begin:
        raise ImuAllanError(f'{path}: lasts {duration((last - first) / 1e9)}: --start '
                            f'{duration(start_s)} leaves nothing of it')
    recorded_s = (last - begin) / 1e9
    # A request for 20 min of 19 min 59 s means all of it.
    if duration_s is not None and recorded_s < 0.99 * duration_s:
        shortfall.append(finding('short_part', recorded_s=recorded_s, asked_s=duration_s))


def _later(stamp_ns: int, seconds: float) -> int:
    """Add seconds to a stamp; limit the sum to the latest stamp that can be represented."""
    latest_ns = 2**63 - 1   # the latest that fits into 64 bits
    return min(stamp_ns + round(min(seconds, latest_ns * 1e-9) * 1e9), latest_ns)
