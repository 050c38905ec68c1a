# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reading of the blocks of a topic, ahead of their use."""

from collections.abc import Callable, Iterator
from contextlib import suppress

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.choose_topic import choose_topic
from imu_allan.recordings.formats.temporary_folder import unreadable_error
from imu_allan.recordings.reading.read_ahead import larger_blocks, read_ahead
from imu_allan.recordings.reading.reading_process import read_in_process, worth_a_process
from imu_allan.recordings.recording import Recording
from imu_allan.wording import NO_TOPIC


def read_blocks(
    recording: Recording, topic: str, progress: Callable[[int], None] | None = None,
) -> Iterator[ImuBlock]:
    """
    Read the messages of `topic` in the order in which they were recorded.

    Reading, decompression and decoding begin with this call and run some blocks ahead. They run in
    a separate process if the recording is large, else in a thread.

    Parameters
    ----------
    recording : Recording
        An open recording; it must stay open while blocks are read.
    topic : str
        One of its topics.
    progress : callable, optional
        Called after each block with the number of bytes consumed so far.

    Raises
    ------
    ImuAllanError
        If `topic` is not one of its topics, has no messages, or cannot be read at all.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from imu_allan.recordings import open_recording
    >>> lines = ['time_s,gyro_x', '0.00,0.001', '0.01,-0.002', '0.02,0.003']
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, 'imu.csv')
    ...     _ = path.write_text(chr(10).join(lines))
    ...     with open_recording(path) as recording:
    ...         for block in read_blocks(recording, choose_topic(recording)):
    ...             print(len(block), block.samples[0, 0])
    3 0.001

    """
    choose_topic(recording, topic)
    return _with_progress(recording, _blocks_ahead(recording, topic), topic, progress)


def _blocks_ahead(recording: Recording, topic: str) -> Iterator[tuple[ImuBlock, int]]:
    if worth_a_process(recording):
        # If no further process can be started, fall back to a thread.
        with suppress(OSError):
            return read_in_process(recording, topic)
    return read_ahead(larger_blocks(recording.decoded(topic)))


def _with_progress(
    recording: Recording, ahead: Iterator[tuple[ImuBlock, int]], topic: str,
    progress: Callable[[int], None] | None,
) -> Iterator[ImuBlock]:
    empty = True
    try:
        for block, position in ahead:
            empty = False
            if progress is not None:
                progress(position)
            yield block
    except OSError as error:
        raise unreadable_error(recording.path, error, 'reading failed') from error
    if empty:
        why = next((f' ({remark.values["first"]})' for remark in recording.remarks
                    if remark.code == 'malformed_messages'
                    and remark.values.get('topic') == printable(topic)), '')
        what = ('no line of samples: see what it holds with imu_allan info' if topic == NO_TOPIC
                else f'topic {printable(topic)} holds no readable message{why}; --topic names '
                'another')
        raise ImuAllanError(f'{printable(recording.path)}: {what}')
    if progress is not None:
        progress(recording.size_bytes)
