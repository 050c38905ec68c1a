# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading ahead of the estimator in a process of its own.

A thread shares the interpreter lock with the estimator, and both hand it to and fro with every
call of numpy: over millions of messages that takes longer (bench/bench_analyze.py). A
process costs a tenth of a second at its start and then nothing. It is a fresh interpreter, not a
fork of this one, whose threads and locks are therefore of no concern.

The process gets the open recording on its standard input, and memory that both share. It fills one
slot of that memory after the other and says on its standard output which; a slot comes back on
its standard input once its messages are copied. Whoever ends first, the other one finds the pipe
closed and ends too; the memory has no name and is gone with them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, suppress
from mmap import mmap
import os
import pickle
import signal
import subprocess
import sys
from typing import Any, IO, TYPE_CHECKING

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.isolated_process import end_in_peace, portable, start_python
from imu_allan.recordings.reading.read_ahead import larger_blocks, read_ahead
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from imu_allan.recordings.recording import Recording

WORTHWHILE_BYTES = 1 << 26
"""Bytes of the smallest recording that is read by a process of its own."""
SLOT_MESSAGES = 1 << 13
"""Messages that fit into a slot."""
SLOTS = 4
"""So far may the reader be ahead, 32,768 messages in 2.2 MB of shared memory."""

_SLOT = np.dtype([
    ('header_ns', np.int64, SLOT_MESSAGES), ('receive_ns', np.int64, SLOT_MESSAGES),
    ('samples', np.float64, (6, SLOT_MESSAGES)), ('absent', np.bool_, (2, SLOT_MESSAGES))])


class ReadingProcess:
    """
    A process that reads the messages of one topic, from now on.

    Parameters
    ----------
    recording : Recording
        Open; must stay open for as long as blocks are taken.
    topic : str
        One of its topics.

    Raises
    ------
    OSError
        If no process can be started, or no memory be shared.

    """

    def __init__(self, recording: Recording, topic: str) -> None:
        self._recording, self._topic = recording, topic
        _keep_memory()
        memory = _shared_memory()
        try:
            self._slots = _Slots(memory)
            # In a session of its own, Ctrl-C does not reach it: it ends with the pipe.
            self._process = start_python(
                __name__, 'serve', stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                pass_fds=[memory], start_new_session=True)
        finally:
            os.close(memory)
        with suppress(BrokenPipeError), open(self._stdin.fileno(), 'wb', closefd=False) as stdin:
            pickle.dump((memory, recording, topic), stdin)

    @property
    def _stdin(self) -> IO[bytes]:
        assert self._process.stdin is not None
        return self._process.stdin

    def blocks(self) -> Iterator[tuple[ImuBlock, int]]:
        """
        Take blocks, each with the bytes of the recording consumed so far.

        Raises
        ------
        ImuAllanError
            If the process was ended from outside.
        Exception
            What reading raised, after the blocks before it.

        """
        assert self._process.stdout is not None
        ready = False
        try:
            with open(self._process.stdout.fileno(), 'rb', closefd=False) as reported:
                ready = pickle.load(reported)
                while (item := pickle.load(reported)) is not None:
                    slot, messages, frame_id, position = item
                    block = self._slots.take(slot, messages, frame_id)
                    with suppress(BrokenPipeError):
                        self._stdin.write(bytes([slot]))
                    yield block, position
                failure, remarks = pickle.load(reported)
        except (EOFError, pickle.UnpicklingError):
            if ready:
                code = self._process.wait()
                how = f'signal {-code}' if code < 0 else f'exit status {code}'
                raise ImuAllanError(
                    f'{printable(self._recording.path)}: the process that reads it was ended '
                    f'from outside ({how}), perhaps for want of memory'
                ) from None
        finally:
            self._end()
        if not ready:
            # sys.executable is no Python, as in a program that embeds one.
            yield from read_ahead(larger_blocks(self._recording.decoded(self._topic)))
            return
        self._recording.remarks[:] = remarks
        if failure is not None:
            error, where = failure
            raise error from (None if isinstance(error, (ImuAllanError, OSError))
                              else RuntimeError(f'in the reading process:\n{where}'))

    def _end(self) -> None:
        # The pipes stay open until it has tidied up: asked twice to end, it would not finish that.
        self._process.terminate()
        try:
            # It removes what it unpacked first, which takes a slow disk seconds.
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()


def pays(recording: Recording) -> bool:
    """Whether a process of its own reads a recording sooner than a thread would."""
    interpreter = bool(sys.executable) and not getattr(sys, 'frozen', False)
    return (recording.size_bytes >= WORTHWHILE_BYTES and interpreter
            and hasattr(os, 'memfd_create') and len(os.sched_getaffinity(0)) > 1)


def serve() -> None:
    """Be the reading process."""
    # An end from outside still removes what was unpacked into a temporary folder.
    end_in_peace()
    memory, recording, topic = pickle.load(sys.stdin.buffer)
    _keep_memory()
    slots, free = _Slots(memory), list(range(SLOTS))
    reports = os.fdopen(os.dup(1), 'wb')

    def report(item: object) -> None:
        pickle.dump(item, reports)
        reports.flush()

    report(True)
    # What a library might print must not get among the reports.
    os.dup2(2, 1)
    failure = None
    with suppress(BrokenPipeError):
        try:
            # Closed whatever comes, since a recording may have unpacked files to remove.
            with closing(recording.decoded(topic)) as decoded:
                for block, position in larger_blocks(decoded, SLOT_MESSAGES):
                    for start in range(0, len(block), SLOT_MESSAGES):
                        part = block.part(slice(start, start + SLOT_MESSAGES))
                        free += b'' if free else _given_back()
                        slot = free.pop(0)
                        slots.put(slot, part)
                        report((slot, len(part), part.frame_id, position))
        except BrokenPipeError:
            raise
        except Exception as error:
            failure = portable(error)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        report(None)
        report((failure, recording.remarks))
    # Nothing is left to tidy up, and the other process waits.
    os._exit(0)


def _given_back() -> bytes:
    """Wait for slots whose messages were copied."""
    slots = os.read(0, SLOTS)
    if not slots:
        raise BrokenPipeError
    return slots


def _keep_memory() -> None:
    """
    Let the memory of blocks be used again instead of going back to the system each time.

    The GNU C library takes arrays of this size as fresh pages from the system and returns them
    when they are freed, until it has seen a larger one come and go. Here is one, of which no page
    is ever used.
    """
    # Above any block, below glibc's largest threshold of 32 MiB (M_MMAP_THRESHOLD, mallopt(3)).
    np.empty(1 << 24, np.uint8)


class _Slots:
    """Messages in shared memory: `SLOTS` times room for `SLOT_MESSAGES`."""

    def __init__(self, memory: int) -> None:
        self._slots = np.frombuffer(mmap(memory, SLOTS * _SLOT.itemsize), _SLOT)

    def put(self, slot: int, block: ImuBlock) -> None:
        """Copy a block into a slot."""
        for name, values in self._slot(slot, len(block)).items():
            values[:] = getattr(block, name)

    def take(self, slot: int, messages: int, frame_id: str) -> ImuBlock:
        """Copy the first messages out of a slot."""
        return ImuBlock(frame_id=frame_id, **{
            name: values.copy('K') for name, values in self._slot(slot, messages).items()})

    def _slot(self, slot: int, messages: int) -> dict[str, NDArray[Any]]:
        """View the first messages of a slot, the samples axis by axis in memory."""
        return {name: self._slots[slot][name].T[:messages] for name in _SLOT.names or ()}


def _shared_memory() -> int:
    """Return the descriptor of memory for all slots."""
    memory = os.memfd_create('imu_allan')
    try:
        # Allocated now: where there is no room, a thread can still do without.
        os.posix_fallocate(memory, 0, SLOTS * _SLOT.itemsize)
    except OSError:
        os.close(memory)
        raise
    return memory
