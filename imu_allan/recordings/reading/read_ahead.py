# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading ahead of the estimator in a thread, to use a second core.

Decompression, sqlite and numpy release the interpreter lock most of the time, so one thread
suffices.
"""

from collections.abc import Iterator
from queue import SimpleQueue
from threading import Event, Semaphore, Thread
from typing import TypeVar

from imu_allan.block import ImuBlock, joined

Item = TypeVar('Item')


def read_ahead(items: Iterator[Item], depth: int = 16) -> Iterator[Item]:
    """
    Produce `items` in a thread, at most `depth` of them ahead of the consumer.

    An exception in the producer is raised in the consumer, after the items before it. The thread
    ends with the consumer, even if that stops early.
    """
    ready: SimpleQueue[Item | None] = SimpleQueue()
    room, stopped = Semaphore(depth - 1), Event()
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
            getattr(items, 'close', lambda: None)()
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
    blocks: Iterator[tuple[ImuBlock, int]], messages: int = 2048,
) -> Iterator[tuple[ImuBlock, int]]:
    """
    Join consecutive blocks of one frame_id until they hold at least `messages`.

    By default a chunk of a single-topic bag is large enough, and is passed on without a copy. The
    second item of each pair, the position in the file, is that of the last block joined. An
    exception is raised after the blocks before it.
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
            if count >= messages:
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
