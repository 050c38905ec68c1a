# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Selection of the part of a recording between two times."""

from collections.abc import Iterable, Iterator
from itertools import chain

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.timeline.stamps import flaw_of
from imu_allan.timeline.values import repeated
from imu_allan.wording import duration
import numpy as np


def between(blocks: Iterable[ImuBlock], start_s: float, duration_s: float | None, path: object,
            shortfall: list[Finding]) -> Iterator[ImuBlock]:
    """Yield what was received in a window; if less was recorded, add a finding to `shortfall`."""
    filled = filter(len, blocks)
    opening = next(filled, None)
    if opening is None:
        return
    clock = 'header_ns' if _by_header(opening) else 'receive_ns'
    first = last = int(getattr(opening, clock)[0])
    begin = first + round(start_s * 1e9)
    end = np.inf if duration_s is None else begin + round(duration_s * 1e9)
    for block in chain([opening], filled):
        stamps = getattr(block, clock)
        last = int(stamps[-1])
        if (stamps >= end).all():
            return
        keep = (stamps >= begin) & (stamps < end)
        if keep.all():
            yield block
        elif keep.any():
            yield block.part(keep)
    if last < begin:
        raise ImuAllanError(f'{path}: lasts {duration((last - first) / 1e9)}: --start '
                            f'{duration(start_s)} leaves nothing of it')
    recorded_s = (last - begin) / 1e9
    # A request for 20 min of 19 min 59 s means all of it.
    if duration_s is not None and recorded_s < 0.99 * duration_s:
        shortfall.append(finding('short_part', recorded_s=recorded_s, asked_s=duration_s))


def _by_header(block: ImuBlock) -> bool:
    """Return whether only header stamps advance, as converters may copy one receive stamp."""
    same = repeated(block.samples)
    receive, header = (flaw_of(stamps, same, bursts=True)
                       for stamps in (block.receive_ns, block.header_ns))
    return receive is not None and header is None
