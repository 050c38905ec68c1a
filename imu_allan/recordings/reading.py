# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading of the blocks of a topic, ahead of their use, to use a second core.

Decompression, sqlite and numpy release the interpreter lock most of the time, so one thread
suffices, except for large recordings. There, a thread would exchange the lock with the estimator
at every numpy call. For millions of messages that is slower (bench/bench_analyze.py) than a
separate process, which only costs a tenth of a second to start. It is a fresh interpreter, not a
fork, so threads and locks of this process do not matter.

The process receives the open recording on its standard input, and a block of shared memory. It
fills the slots of that memory in turn and reports each on its standard output. A slot is returned
on its standard input once its messages are copied. If either process ends, the other finds the
pipe closed and ends too. The memory is anonymous and disappears with them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
from mmap import mmap
import os
import pickle
from queue import SimpleQueue
import signal
import subprocess
import sys
from threading import Event, Semaphore, Thread
from typing import Any

from imu_allan.block import ImuBlock, joined
from imu_allan.errors import error_about, ImuAllanError, printable
from imu_allan.isolated_process import pipes_of, portable, start_python, to_parent, wait_for
from imu_allan.recordings.choose_streams import choose_topic
from imu_allan.recordings.recording import Recording, unreadable_error
from imu_allan.wording import NO_TOPIC
import numpy as np
from numpy.typing import NDArray

Progress = Callable[[int], None] | None
"""Called with the number of bytes consumed so far."""
Read = tuple[ImuBlock, int]
"""A block, and the number of bytes consumed so far."""

WORTHWHILE_BYTES = 1 << 26
"""Size in bytes from which a recording is read by a separate process."""
_SLOT_MESSAGES = 1 << 14
"""Messages that fit into a slot: each slot costs the estimator some 100 calls of Python."""
_SLOTS = 4
"""Slots in shared memory (4.3 MB): the reader may be so many blocks ahead."""

_SLOT = np.dtype([
    ('header_ns', np.int64, _SLOT_MESSAGES), ('receive_ns', np.int64, _SLOT_MESSAGES),
    ('samples', np.float64, (6, _SLOT_MESSAGES)), ('absent', np.bool_, (2, _SLOT_MESSAGES))])


def read_blocks(recording: Recording, topic: str, progress: Progress = None) -> Iterator[ImuBlock]:
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


def _blocks_ahead(recording: Recording, topic: str) -> Iterator[Read]:
    if _worth_a_process(recording):
        # If no further process can be started, fall back to a thread.
        with suppress(OSError):
            return read_in_process(recording, topic)
    return read_ahead(larger_blocks(recording.decoded(topic)))


def _with_progress(recording: Recording, ahead: Iterator[Read], topic: str, progress: Progress,
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
        raise error_about(recording.path, what)
    if progress is not None:
        progress(recording.size_bytes)


def read_ahead(items: Generator[Read, None, None]) -> Iterator[Read]:
    """
    Produce `items` in a thread, at most 16 of them ahead of the consumer.

    An exception in the producer is raised in the consumer, after the items before it. The thread
    ends with the consumer, even if that stops early.
    """
    ready: SimpleQueue[Read | None] = SimpleQueue()
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


def larger_blocks(blocks: Iterator[Read]) -> Generator[Read, None, None]:
    """
    Join consecutive blocks of one frame_id until they hold at least 2048 messages.

    A chunk of a single-topic bag is that large, and is passed on without a copy. The bytes
    consumed are those of the last block joined. An exception is raised after the blocks before it.
    """
    held: list[ImuBlock] = []
    count = position = 0

    def taken() -> Read:
        nonlocal count
        block = joined(held) if len(held) > 1 else held[0]
        held.clear()
        count = 0
        return block, position

    try:
        for block, at in blocks:
            if held and held[0].frame_id != block.frame_id:
                yield taken()
            held.append(block)
            count, position = count + len(block), at
            if count >= 2048:
                yield taken()
    except Exception:
        if held:
            yield taken()
        raise
    if held:
        yield taken()


# ------------------------------------------------------------------------------------ in a process

def read_in_process(recording: Recording, topic: str) -> Iterator[Read]:
    """Start a process that reads a topic; yield blocks and the bytes consumed so far."""
    _keep_memory()
    memory = os.memfd_create('imu_allan')
    try:
        # Allocate now: if there is no room, the caller can still fall back to a thread.
        os.posix_fallocate(memory, 0, _SLOTS * _SLOT.itemsize)
        slots = _slots(memory)
        process = start_python(__name__, 'serve', (memory, recording, topic),
                               stderr=subprocess.DEVNULL, pass_fds=[memory])
    finally:
        os.close(memory)
    return _received(recording, process, slots)


def _received(recording: Recording, process: subprocess.Popen[bytes], slots: NDArray[np.void]
              ) -> Iterator[Read]:
    free, reports = pipes_of(process)
    try:
        with open(reports.fileno(), 'rb', closefd=False) as reported:
            while (item := pickle.load(reported)) is not None:
                slot, messages, frame_id, position = item
                block = ImuBlock(frame_id=frame_id, **{
                    name: values.copy('K')
                    for name, values in _arrays(slots[slot], 0, messages).items()})
                with suppress(BrokenPipeError):
                    free.write(bytes([slot]))
                yield block, position
            failure, remarks = pickle.load(reported)
    except (EOFError, pickle.UnpicklingError):
        code = process.wait()
        how = f'signal {-code}' if code < 0 else f'exit status {code}'
        raise error_about(recording.path, 'the process that reads it was ended from outside '
                          f'({how}), perhaps for want of memory') from None
    finally:
        # Keep the pipes open during cleanup: closing them would interrupt it a second time.
        process.terminate()
        # Removing unpacked files can take seconds on a slow disk.
        wait_for(process, 10.0)
        free.close()
        reports.close()
    recording.remarks[:] = remarks
    if failure is not None:
        error, where = failure
        raise error from (None if isinstance(error, (ImuAllanError, OSError))
                          else RuntimeError(f'in the reading process:\n{where}'))


def _worth_a_process(recording: Recording) -> bool:
    """Return whether a separate process reads this recording faster than a thread."""
    interpreter = bool(sys.executable) and not getattr(sys, 'frozen', False)
    return (recording.size_bytes >= WORTHWHILE_BYTES and interpreter
            and hasattr(os, 'memfd_create') and len(os.sched_getaffinity(0)) > 1)


def serve() -> None:
    """Run the reading process."""
    reports = to_parent()
    memory, recording, topic = pickle.load(sys.stdin.buffer)
    _keep_memory()
    slots = _slots(memory)

    def report(item: object) -> None:
        pickle.dump(item, reports)
        reports.flush()

    failure = None
    with suppress(BrokenPipeError):
        try:
            # Always close the generator, since a recording may have unpacked files to remove.
            with closing(recording.decoded(topic)) as decoded:
                _fill(decoded, slots, report)
        except BrokenPipeError:
            raise
        except Exception as error:
            failure = portable(error)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        report(None)
        report((failure, recording.remarks))
    # Exit at once: nothing is left to clean up, and the other process is waiting.
    os._exit(0)


def _fill(decoded: Iterator[Read], slots: NDArray[np.void],
          report: Callable[[object], None]) -> None:
    """Copy messages into a slot until it is full or the frame_id changes, and report it."""
    free, filled, frame_id, position = list(range(_SLOTS)), 0, '', 0

    def pass_on() -> None:
        nonlocal filled
        if filled:
            report((free.pop(0), filled, frame_id, position))
            filled = 0

    try:
        for block, at in decoded:
            if block.frame_id != frame_id:
                pass_on()
            start = 0
            while start < len(block):
                if not free:
                    # Wait for slots whose messages have been copied.
                    free += os.read(0, _SLOTS)
                if not free:
                    raise BrokenPipeError
                part = block.part(slice(start, start + _SLOT_MESSAGES - filled))
                for name, values in _arrays(slots[free[0]], filled, len(part)).items():
                    values[:] = getattr(part, name)
                start, filled = start + len(part), filled + len(part)
                frame_id, position = block.frame_id, at
                if filled == _SLOT_MESSAGES:
                    pass_on()
    finally:
        pass_on()


def _keep_memory() -> None:
    """
    Keep memory of blocks in the process, for reuse, instead of returning it to the system.

    The GNU C library requests fresh pages for arrays of this size and returns them when freed,
    until it has seen a larger array freed. Allocate such an array here; none of its pages is
    touched.
    """
    # Larger than any block, and below glibc's largest threshold of 32 MiB (M_MMAP_THRESHOLD,
    # mallopt(3)).
    np.empty(1 << 24, np.uint8)


def _slots(memory: int) -> NDArray[np.void]:
    """Map the shared memory as an array of `_SLOTS` slots."""
    return np.frombuffer(mmap(memory, _SLOTS * _SLOT.itemsize), _SLOT)


def _arrays(slot: np.void, first: int, messages: int) -> dict[str, NDArray[Any]]:
    """View messages of a slot; the samples are stored axis by axis."""
    return {name: slot[name].T[first:first + messages] for name in _SLOT.names or ()}
