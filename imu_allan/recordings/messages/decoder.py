# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decoding of messages of any type to blocks, and choice of the clock among several stamps.

`imu_allan.recordings.messages.layouts` locates the fields of messages with the same layout, and
`imu_allan.recordings.messages.columns` extracts them as columns.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any, Literal

from imu_allan.arrays import Ints, runs
from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu_rows, MessageBatch, OnMalformed, Serialization
from imu_allan.recordings.messages.columns import Columns, extract, frames_of
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields
from imu_allan.recordings.messages.layouts import RecordLayouts
import numpy as np
from numpy.typing import NDArray

Decoder = Callable[[Iterable[MessageBatch], OnMalformed], list[ImuBlock]]
"""Decodes messages of a topic in order; use a new one for each reading."""


@dataclass(frozen=True)
class ImuMessages:
    """
    Description of how to read the messages of a topic; creates a decoder for each reading.

    Attributes
    ----------
    type_name : str
        Type of the messages.
    serialization : {'cdr', 'ros1'}
        How they are serialized.
    fields : ImuFields or None
        Which fields hold the samples; None for sensor_msgs/Imu itself.
    types : Types
        Fields of all types in the messages; None for sensor_msgs/Imu itself.
    factors : (float, float)
        Factors applied to gyroscope and accelerometer samples.

    """

    type_name: str
    serialization: Serialization = 'cdr'
    fields: ImuFields | None = None
    types: Types | None = None
    factors: tuple[float, float] = (1.0, 1.0)

    def decoder(self) -> Decoder:
        """Return a decoder for one reading."""
        plain = self._decoded if self.fields is None else FieldsDecoder(self)
        if self.factors == (1.0, 1.0):
            return plain
        factors = np.repeat(self.factors, 3)

        def scaled(batches: Iterable[MessageBatch], on_malformed: OnMalformed) -> list[ImuBlock]:
            return [replace(block, samples=block.samples * factors)
                    for block in plain(batches, on_malformed)]

        return scaled

    def _decoded(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
                 ) -> list[ImuBlock]:
        """Decode sensor_msgs/Imu itself."""
        return [block for batch in batches for block in decode_imu_rows(
            batch.rows, batch.receive_ns, self.serialization, on_malformed)]

    @property
    def half(self) -> Literal['gyro', 'accel'] | None:
        """Return the only sensor with samples in the messages; None if both have samples."""
        if self.fields is None or (self.fields.gyro and self.fields.accel):
            return None
        return 'gyro' if self.fields.gyro else 'accel'

    def reported(self) -> str:
        """Describe in words how the messages are read."""
        if self.fields is None:
            return self.type_name
        return f'{self.type_name}, {self.fields.what}'


class FieldsDecoder:
    """Decoder for message types whose samples are in arbitrary fields."""

    def __init__(self, messages: ImuMessages) -> None:
        assert messages.fields is not None
        assert messages.types is not None
        self._fields = messages.fields
        self._layouts = RecordLayouts(messages.types, messages.type_name, messages.serialization,
                                      messages.fields)
        self._clock: int | None = None
        self._frames: dict[str, int] = {}

    def __call__(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
                 ) -> list[ImuBlock]:
        """Decode messages in order; malformed ones are reported."""
        held = [batch for batch in batches if len(batch.rows)]
        self._frames = {}
        if not held:
            return []
        columns = self._columns(held, on_malformed)
        if columns is None or not len(columns['samples']):
            return []
        header_ns = self._header_ns(columns['stamps'])
        names, frames = list(self._frames), columns['frames']
        changes = np.diff(frames) != 0 if len(names) > 1 else np.zeros(0, np.bool_)
        return [ImuBlock(header_ns[a:b], columns['receive_ns'][a:b], columns['samples'][a:b],
                         columns['absent'][a:b], names[frames[a]])
                for a, b in runs(changes, len(header_ns))]

    # ----------------------------------------------------------------------------------- columns

    def _columns(self, batches: Sequence[MessageBatch], on_malformed: OnMalformed,
                 ) -> Columns | None:
        """Decode batches, grouped by message size."""
        bounds = [0, *accumulate(len(batch.rows) for batch in batches)]
        by_size: dict[int, list[int]] = {}
        for number, batch in enumerate(batches):
            by_size.setdefault(batch.rows.shape[1], []).append(number)
        stamps = self._fields.stamps
        if self._clock is not None:
            stamps = (stamps[self._clock],)
        decoded: list[Columns] = []
        for numbers in by_size.values():
            rows = _joined([batches[number].rows for number in numbers])
            receive_ns = _joined([batches[number].receive_ns for number in numbers])
            index = _joined([np.arange(bounds[n], bounds[n + 1]) for n in numbers])
            for which, layout in self._layouts.groups(rows, on_malformed):
                same = rows[which]
                part = extract(self._fields, stamps, same.view(layout.record)[:, 0],
                               receive_ns[which], on_malformed)
                frames = frames_of(same, layout.frame_id, self._frames)
                of = part.get('message', slice(None))
                part['frames'], part['message'] = frames[of], index[which][of]
                decoded.append(part)
        if len(decoded) < 2:
            return decoded[0] if decoded else None
        order = np.argsort(np.concatenate([part['message'] for part in decoded]), kind='stable')
        return {name: np.concatenate([part[name] for part in decoded])[order]
                for name in decoded[0]}

    # ------------------------------------------------------------------------------------- clock

    def _header_ns(self, stamps: Ints) -> Ints:
        """Return the first valid and mostly distinct stamps; keep the choice once made."""
        if not stamps.shape[1]:
            return np.zeros(len(stamps), np.int64)
        clock = 0
        if self._clock is None:
            clock = next((number for number, times in enumerate(stamps.T) if _advances(times)), 0)
            # Fix the choice of the clock once there are this many messages.
            if len(stamps) >= 16:
                self._clock = clock
        times: Ints = np.maximum(stamps[:, clock], 0)
        return times


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """Join arrays; most often there is one, which is not copied."""
    return np.concatenate(arrays) if len(arrays) > 1 else arrays[0]


def _advances(times: Ints) -> bool:
    """Return whether stamps are valid and at least half of them are distinct."""
    valid = bool((times > 0).all())
    if len(times) == 1:
        return valid and bool(times[0] % 1_000_000_000)
    return valid and 2 * len(np.unique(times)) >= len(times)
