# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading ahead of the estimator in a separate process.

A thread would share the interpreter lock with the estimator and exchange it at every numpy call.
For millions of messages that is slower (bench/bench_analyze.py); a process only costs a tenth of a
second to start. It is a fresh interpreter, not a fork, so threads and locks of this process do not
matter.

The process receives the open recording on its standard input, and a block of shared memory. It
fills the slots of that memory in turn and reports each on its standard output. A slot is returned
on its standard input once its messages are copied. If either process ends, the other finds the
pipe closed and ends too. The memory is anonymous and disappears with them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from mmap import mmap
import os
import pickle
import signal
import subprocess
import sys
from typing import Any, TYPE_CHECKING

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.isolated_process import exit_on_sigterm, portable, start_python
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from imu_allan.recordings.recording import Recording

WORTHWHILE_BYTES = 1 << 26
"""Size in bytes from which a recording is read by a separate process."""
SLOT_MESSAGES = 1 << 13
"""Messages per slot."""
SLOTS = 4
"""Slots in shared memory: the reader may be 32,768 messages (2.2 MB) ahead."""

_SLOT = np.dtype([
    ('header_ns', np.int64, SLOT_MESSAGES), ('receive_ns', np.int64, SLOT_MESSAGES),
    ('samples', np.float64, (6, SLOT_MESSAGES)), ('absent', np.bool_, (2, SLOT_MESSAGES))])


def read_in_process(recording: Recording, topic: str) -> Iterator[tuple[ImuBlock, int]]:
    """Start a process that reads a topic; yield blocks and the bytes consumed so far."""
    _keep_memory()
    memory = os.memfd_create('imu_allan')
    try:
        # Allocate now: if there is no room, the caller can still fall back to a thread.
        os.posix_fallocate(memory, 0, SLOTS * _SLOT.itemsize)
        slots = _slots(memory)
        # A separate session keeps Ctrl-C from the process; it ends with the pipe instead.
        process = start_python(
            __name__, 'serve', stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            pass_fds=[memory], start_new_session=True)
    finally:
        os.close(memory)
    assert process.stdin is not None
    with suppress(BrokenPipeError), open(process.stdin.fileno(), 'wb', closefd=False) as stdin:
        pickle.dump((memory, recording, topic), stdin)
    return _received(recording, process, slots)


def _received(recording: Recording, process: subprocess.Popen[bytes], slots: NDArray[np.void],
              ) -> Iterator[tuple[ImuBlock, int]]:
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        with open(process.stdout.fileno(), 'rb', closefd=False) as reported:
            while (item := pickle.load(reported)) is not None:
                slot, messages, frame_id, position = item
                block = ImuBlock(frame_id=frame_id, **{
                    name: values.copy('K')
                    for name, values in _arrays(slots[slot], 0, messages).items()})
                with suppress(BrokenPipeError):
                    process.stdin.write(bytes([slot]))
                yield block, position
            failure, remarks = pickle.load(reported)
    except (EOFError, pickle.UnpicklingError):
        code = process.wait()
        how = f'signal {-code}' if code < 0 else f'exit status {code}'
        raise ImuAllanError(
            f'{printable(recording.path)}: the process that reads it was ended from outside '
            f'({how}), perhaps for want of memory') from None
    finally:
        # Keep the pipes open during cleanup: closing them would interrupt it a second time.
        process.terminate()
        try:
            # Removing unpacked files can take seconds on a slow disk.
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdin.close()
        process.stdout.close()
    recording.remarks[:] = remarks
    if failure is not None:
        error, where = failure
        raise error from (None if isinstance(error, (ImuAllanError, OSError))
                          else RuntimeError(f'in the reading process:\n{where}'))


def worth_a_process(recording: Recording) -> bool:
    """Return whether a separate process reads this recording faster than a thread."""
    interpreter = bool(sys.executable) and not getattr(sys, 'frozen', False)
    return (recording.size_bytes >= WORTHWHILE_BYTES and interpreter
            and hasattr(os, 'memfd_create') and len(os.sched_getaffinity(0)) > 1)


def serve() -> None:
    """Run the reading process."""
    # Let termination from outside still remove temporary files.
    exit_on_sigterm()
    memory, recording, topic = pickle.load(sys.stdin.buffer)
    _keep_memory()
    slots = _slots(memory)
    reports = os.fdopen(os.dup(1), 'wb')

    def report(item: object) -> None:
        pickle.dump(item, reports)
        reports.flush()

    # Redirect standard output so that prints of libraries do not mix with the reports.
    os.dup2(2, 1)
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


def _fill(decoded: Iterator[tuple[ImuBlock, int]], slots: NDArray[np.void],
          report: Callable[[object], None]) -> None:
    """Copy messages into slots, and report those that are full or end with a frame_id."""
    free = list(range(SLOTS))
    slot = filled = position = 0
    frame_id = ''
    try:
        for block, position in decoded:
            start = 0
            while start < len(block):
                if filled == SLOT_MESSAGES or (filled and block.frame_id != frame_id):
                    report((slot, filled, frame_id, position))
                    filled = 0
                if not filled:
                    free += b'' if free else _returned_slots()
                    slot, frame_id = free.pop(0), block.frame_id
                part = block.part(slice(start, start + SLOT_MESSAGES - filled))
                for name, values in _arrays(slots[slot], filled, len(part)).items():
                    values[:] = getattr(part, name)
                start, filled = start + len(part), filled + len(part)
    finally:
        # An error is reported after the messages before it.
        if filled:
            report((slot, filled, frame_id, position))


def _returned_slots() -> bytes:
    """Wait for slots whose messages have been copied."""
    slots = os.read(0, SLOTS)
    if not slots:
        raise BrokenPipeError
    return slots


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
    """Map the shared memory as an array of `SLOTS` slots."""
    return np.frombuffer(mmap(memory, SLOTS * _SLOT.itemsize), _SLOT)


def _arrays(slot: np.void, first: int, messages: int) -> dict[str, NDArray[Any]]:
    """View some messages of a slot; the samples are stored axis by axis."""
    return {name: slot[name].T[first:first + messages] for name in _SLOT.names or ()}
