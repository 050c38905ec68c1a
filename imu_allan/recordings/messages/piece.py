# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Serialized messages of one topic, as the containers hand them to the decoders."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Piece:
    """
    Messages of equal size, in the order of the file.

    Attributes
    ----------
    rows : ndarray of uint8, shape (n, size)
        Serialized messages; may be a view of a buffer.
    receive_ns : ndarray of int64, shape (n,)
        Receive stamps of the messages in nanoseconds.

    """

    rows: NDArray[np.uint8]
    receive_ns: NDArray[np.int64]


def pieces_of(messages: Sequence[bytes], receive_ns: NDArray[np.int64]) -> Iterator[Piece]:
    """Join messages of equal size that follow each other."""
    sizes = np.fromiter(map(len, messages), np.int64, len(messages))
    bounds = [0, *(np.flatnonzero(np.diff(sizes)) + 1).tolist(), len(messages)]
    for start, stop in pairwise(bounds) if messages else ():
        yield Piece(np.frombuffer(b''.join(messages[start:stop]), np.uint8).reshape(
            stop - start, int(sizes[start])), receive_ns[start:stop])
