# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading of the blocks of a topic, ahead of their use, to use a second core.

Decompression, sqlite and numpy release the interpreter lock most of the time, so one thread
suffices, except for large recordings.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from queue import SimpleQueue
from threading import Event, Semaphore, Thread
from typing import TypeVar

from imu_allan.block import ImuBlock, joined
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.choose_topic import choose_topic
from imu_allan.recordings.formats.temporary_folder import unreadable_error
from imu_allan.recordings.reading.reading_process import read_in_process, worth_a_process
from imu_allan.recordings.recording import Recording
from imu_allan.wording import NO_TOPIC

Item = TypeVar('Item')


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
        what = ('no line of samples below the names of the columns' if topic == NO_TOPIC
                else f'topic {printable(topic)} holds no readable message{why}; --topic names '
                'another')
        raise ImuAllanError(f'{printable(recording.path)}: {what}')
    if progress is not None:
        progress(recording.size_bytes)


def read_ahead(items: Generator[Item, None, None]) -> Iterator[Item]:
    """
    Produce `items` in a thread, at most 16 of them ahead of the consumer.

    An exception in the producer is raised in the consumer, after the items before it. The thread
    ends with the consumer, even if that stops early.
    """
    ready: SimpleQueue[Item | None] = SimpleQueue()
    room, stopped = Semaphore(15), Event()
    failure: list[BaseException] = []

    def produce() -> None:
        try:
            for item in items:
                ready.put(item)
                room.acquire()
                if stopped.is_set():
                    break
        except BaseException as error:
            failure.append(error)
        finally:
            # Close resources in the thread that opened them, as SQLite requires.
            items.close()
            ready.put(None)

    # A daemon thread does not keep the program from exiting during a blocking read.
    thread = Thread(target=produce, name='imu_allan read-ahead', daemon=True)
    thread.start()
    try:
        while (item := ready.get()) is not None:
            room.release()
            yield item
    finally:
        stopped.set()
        room.release()
        thread.join()
    if failure:
        raise failure[0]


def larger_blocks(
    blocks: Iterator[tuple[ImuBlock, int]],
) -> Generator[tuple[ImuBlock, int], None, None]:
    """
    Join consecutive blocks of one frame_id until they hold at least 2048 messages.

    A chunk of a single-topic bag is that large, and is passed on without a copy. The second item
    of each pair, the position in the file, is that of the last block joined. An exception is
    raised after the blocks before it.
    """
    held: list[ImuBlock] = []
    count = position = 0
    try:
        for block, at in blocks:
            if held and held[0].frame_id != block.frame_id:
                yield _joined(held), position
                held, count = [], 0
            held.append(block)
            count += len(block)
            position = at
            if count >= 2048:
                yield _joined(held), position
                held, count = [], 0
    except Exception:
        if held:
            yield _joined(held), position
        raise
    if held:
        yield _joined(held), position


def _joined(blocks: list[ImuBlock]) -> ImuBlock:
    return joined(blocks) if len(blocks) > 1 else blocks[0]
