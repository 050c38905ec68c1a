# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of an IMU at rest, to which tests add the faults of real drivers."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

from imu_allan.block import EvenBlock, ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.finding import Finding
from imu_allan.finding_messages import for_display
from imu_allan.result import Result
from imu_allan.timeline import TimelineOptions, TimelineStage, TimelineSummary
import numpy as np
from numpy.typing import NDArray

START_NS = 1_700_000_000_000_000_000
SIGMA = 0.01


def still(count: int, rate_hz: float = 100.0, *, seed: int = 0, frame_id: str = 'imu_link',
          late: NDArray[np.float64] | None = None) -> ImuBlock:
    """Give even messages at rest, received 0.3 ms later; `late` delays headers, in intervals."""
    places = np.arange(count, dtype=np.float64)
    if late is not None:
        places = np.maximum.accumulate(places + late - 0.01 * places) + 0.01 * places
    header = START_NS + np.rint(places * 1e9 / rate_hz).astype(np.int64)
    samples = np.random.default_rng(seed).normal(size=(count, 6)) * SIGMA
    samples[:, 5] += 9.81
    return ImuBlock(header, header + 300_000, samples, np.zeros((count, 2), dtype=bool), frame_id)


def encode_imu(stamp_ns: int, sample: NDArray[np.float64], frame_id: str,
               absent: tuple[bool, bool] = (False, False)) -> bytes:
    """Encode one message as little-endian CDR, without orientation."""
    block = ImuBlock(np.array([stamp_ns], np.int64), np.zeros(1, np.int64),
                     np.reshape(sample, (1, 6)), np.array([absent]), frame_id)
    return encode_imu_rows(block).tobytes()


def cut(block: ImuBlock, edges: Iterable[int]) -> list[ImuBlock]:
    """Give the messages in blocks that end at `edges`."""
    inner = sorted({edge for edge in edges if 0 < edge < len(block)})
    return [block.part(slice(first, last)) for first, last in pairwise([0, *inner, len(block)])]


def run(blocks: ImuBlock | Iterable[ImuBlock], **options: object
        ) -> tuple[TimelineSummary, list[EvenBlock]]:
    stage = TimelineStage(TimelineOptions(**options))  # type: ignore[arg-type]
    even: list[EvenBlock] = []
    for block in [blocks] if isinstance(blocks, ImuBlock) else blocks:
        even += stage.push(block)
    even += stage.flush()
    return stage.summary(), even


def findings_of(seen: Result | TimelineSummary) -> Sequence[Finding]:
    return seen.warnings if isinstance(seen, Result) else seen.remarks


def codes(seen: Result | TimelineSummary) -> set[str]:
    return {found.code for found in findings_of(seen)}


def said(seen: Result | TimelineSummary, code: str) -> Finding:
    """Give a finding as it is shown: of all its axes in one."""
    return next(one for one in for_display(findings_of(seen)) if one.code == code)


def rows_by_place(blocks: Iterable[EvenBlock]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    places, rows = [np.empty(0, np.int64)], [np.empty((0, 6))]
    for block in blocks:
        places.append(block.first_index + np.arange(len(block)))
        rows.append(block.samples)
    return np.concatenate(places), np.concatenate(rows)
