# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Selection of the part of a recording between two times."""

from collections.abc import Iterable, Iterator

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.timeline.clock import repeated
from imu_allan.timeline.stamps import flaw_of, Stamps
from imu_allan.wording import duration


def between(blocks: Iterable[ImuBlock], start_s: float, duration_s: float | None, path: object,
            shortfall: list[Finding]) -> Iterator[ImuBlock]:
    """Yield what was received in a window; if less was recorded, add a finding to `shortfall`."""
    begin: int | None = None
    end: int | None = None
    first = last = 0
    by_header = False
    for block in blocks:
        if not len(block):
            continue
        if begin is None:
            by_header = _by_header(block)
        stamps = block.header_ns if by_header else block.receive_ns
        if begin is None:
            first = int(stamps[0])
            begin = first + round(start_s * 1e9)
            end = None if duration_s is None else begin + round(duration_s * 1e9)
        last = int(stamps[-1])
        keep = stamps >= begin
        if end is not None:
            keep &= stamps < end
            if (stamps >= end).all():
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


def _by_header(block: ImuBlock) -> bool:
    """Return whether only header stamps advance, as converters may copy one receive stamp."""
    def unusable(stamps: Stamps) -> bool:
        return flaw_of(stamps, repeated(block.samples), bursts=True) is not None

    return unusable(block.receive_ns) and not unusable(block.header_ns)
