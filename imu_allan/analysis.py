# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A recording in, a result out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import choose_topic, open_recording
from imu_allan.result import Result
from imu_allan.timeline import TimelineOptions
import numpy as np


def analyze(path: str | Path, topic: str | None = None, *,
            options: TimelineOptions = TimelineOptions(),  # noqa: B008
            start_s: float = 0.0, duration_s: float | None = None,
            progress: Callable[[int], None] | None = None) -> Result:
    """
    Characterize the IMU of a recording.

    Parameters
    ----------
    path : str or Path
        A rosbag2 directory, a bare ``.mcap`` or ``.db3`` file, a ROS 1 ``.bag`` or a CSV file.
    topic : str, optional
        May be left out where the recording has one Imu topic.
    options : TimelineOptions, optional
        Clock, rate, gaps and motion.
    start_s : float, optional
        Seconds after the first message at which to begin.
    duration_s : float, optional
        Seconds to use from there; all when left out.
    progress : callable, optional
        Called with the bytes read so far.

    Returns
    -------
    Result

    Raises
    ------
    ImuAllanError
        If the recording cannot be read, the topic is not clear, or nothing usable is in it.

    """
    with open_recording(path, rate_hz=options.rate_hz) as recording:
        name = choose_topic(recording, topic)
        blocks: Iterable[ImuBlock] = recording.blocks(name, progress)
        # Reading has begun in a process of its own: numerics are imported meanwhile.
        from imu_allan.characterization import Characterization
        stream = Characterization(kind='recording', path=str(path), topic=name, options=options)
        if start_s > 0 or duration_s is not None:
            blocks = between(blocks, start_s, duration_s)
        stream.take(blocks)
        result = stream.result(recording.remarks)
    if not result.axes:
        raise ImuAllanError(f'{path}: topic {name} holds no usable sample'
                            + (' in the chosen part' if start_s or duration_s else ''))
    return result


def between(blocks: Iterable[ImuBlock], start_s: float, duration_s: float | None
            ) -> Iterator[ImuBlock]:
    """
    Cut a part out of a recording by receive time.

    Parameters
    ----------
    blocks : iterable of ImuBlock
        In the order of the recording.
    start_s : float
        Seconds after the first message.
    duration_s : float or None
        Seconds from there; None for all the rest.

    Yields
    ------
    ImuBlock

    """
    begin: int | None = None
    for block in blocks:
        if not len(block):
            continue
        if begin is None:
            begin = int(block.receive_ns[0]) + round(start_s * 1e9)
        keep = block.receive_ns >= begin
        if duration_s is not None:
            keep &= block.receive_ns < begin + round(duration_s * 1e9)
            if not keep.any() and np.all(block.receive_ns >= begin + round(duration_s * 1e9)):
                return
        if keep.all():
            yield block
        elif keep.any():
            yield ImuBlock(block.header_ns[keep], block.receive_ns[keep], block.samples[keep],
                           block.absent[keep], block.frame_id)
