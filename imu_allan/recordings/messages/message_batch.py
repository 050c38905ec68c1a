# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Serialized messages of one topic, as the containers hand them to the decoders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class MessageBatch:
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
