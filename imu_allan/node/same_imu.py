# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the messages that come are still those of the IMU that the run is about.

Asked after a resume, when the first messages are held back until they have shown it, and all the
time, when the rate or the frame_id may change for good.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import UnusableState
from imu_allan.timeline import TimelineSummary
from imu_allan.timeline.pace import measure_pace
import numpy as np

_SAME_RATE = 0.05
"""Relative difference of two rates that jitter over the probation can make."""
_OTHER_RATE = 0.3
"""Relative difference that jitter cannot make: one between the two wants a longer look."""
PROBATION_S = 2.0
"""At 100 Hz 200 messages, which tell a rate to far less than `_SAME_RATE`; all wait so long."""
LONGEST_PROBATION_S = 10.0
"""Jitter has averaged out by then: the rate counts as it is."""
LASTING_S = 10.0
"""A driver that is reconfigured settles in less; so long a change is no hiccup."""
_FEWEST_MESSAGES = 16
"""A jitter of half an interval moves the rate of 16 messages by 5 %, which is `_SAME_RATE`."""
_MOST_MESSAGES = 20_000
"""10 s at 2 kHz, 1.3 MB; a faster sensor is told by as many messages sooner."""


@dataclass(frozen=True)
class Signature:
    """
    What tells one IMU from another.

    Attributes
    ----------
    frame_id : str or None
    rate_hz : float or None
    clock : str or None
        Stamps that the rate was measured by.

    """

    frame_id: str | None = None
    rate_hz: float | None = None
    clock: str | None = None

    @classmethod
    def of(cls, summary: TimelineSummary) -> 'Signature':
        """Take it from what was seen of a run."""
        return cls(summary.frame_id, summary.timeline.sample_rate_hz, summary.clock)

    def departure(self, blocks: Sequence[ImuBlock]) -> UnusableState | None:
        """Tell why messages are not of this IMU; None if they may be."""
        frame_id = blocks[-1].frame_id if blocks else self.frame_id
        if self.frame_id is not None and frame_id != self.frame_id:
            return UnusableState('frame_id', f'it is of frame_id {self.frame_id!r}, '
                                 f'the messages now have {frame_id!r}')
        if self.rate_difference(blocks) > _SAME_RATE:
            return UnusableState('rate', f'it is of {self.rate_hz:.4g} Hz, the messages now '
                                 f'come at {self.measured_hz(blocks):.4g} Hz')
        return None

    def rate_difference(self, blocks: Sequence[ImuBlock]) -> float:
        """Relative difference of the rates; 0 where one is unknown."""
        measured = self.measured_hz(blocks)
        return abs(measured / self.rate_hz - 1) if measured and self.rate_hz else 0.0

    def measured_hz(self, blocks: Sequence[ImuBlock]) -> float:
        """Rate of messages by the clock of the run; 0 where there are too few."""
        stamps = self.stamps(blocks)
        pace = measure_pace(np.sort(np.concatenate(stamps))) if stamps else None
        return 1e9 / pace.interval_ns if pace is not None and pace.interval_ns > 0 else 0.0

    def stamps(self, blocks: Sequence[ImuBlock]) -> list['np.typing.NDArray[np.int64]']:
        """Stamps of messages by the clock of the run."""
        return [block.receive_ns if self.clock == 'receive' else block.header_ns
                for block in blocks]


class Probation:
    """
    The first messages after a resume, held back.

    Parameters
    ----------
    signature : Signature
        Of the run to go on with.
    seconds : float, optional
        How long to look.

    """

    def __init__(self, signature: Signature, seconds: float = PROBATION_S) -> None:
        self._seconds = seconds
        self._signature = signature
        self.blocks: list[ImuBlock] = []

    def hold(self, blocks: Sequence[ImuBlock]) -> None:
        """Add messages to those held back."""
        self.blocks += blocks

    @property
    def complete(self) -> bool:
        """Whether enough has come to tell."""
        if _messages(self.blocks) >= _MOST_MESSAGES:
            return True
        if self.hopeless or self._lasted_s < self._seconds:
            return False
        return self._lasted_s >= LONGEST_PROBATION_S or not (
            _SAME_RATE < self._signature.rate_difference(self.blocks) < _OTHER_RATE)

    @property
    def hopeless(self) -> bool:
        """Whether there is too little to tell anything."""
        return _messages(self.blocks) < _FEWEST_MESSAGES

    def verdict(self) -> UnusableState | None:
        """Tell why the run cannot be gone on with; None if it can."""
        return self._signature.departure(self.blocks)

    @property
    def _lasted_s(self) -> float:
        return float(self.blocks[-1].receive_ns[-1] - self.blocks[0].receive_ns[0]) * 1e-9


class ChangeWatch:
    """
    Looks for a rate or frame_id that changes for good while the node runs.

    Parameters
    ----------
    signature : Signature
        Of the run.

    """

    def __init__(self, signature: Signature) -> None:
        self.signature = signature
        self.changed: list[ImuBlock] = []

    def look(self, blocks: Sequence[ImuBlock]) -> UnusableState | None:
        """Look at the next messages; tell of a change once it has lasted, with its messages."""
        if _messages(blocks) < _FEWEST_MESSAGES and not self.changed:
            return None
        if not self._departs(blocks):
            self.changed = []
            return None
        self.changed += blocks
        while _messages(self.changed) > _MOST_MESSAGES and len(self.changed) > 1:
            self.changed.pop(0)
        if not self._lasted():
            return None
        return self.signature.departure(self.changed)

    def _departs(self, blocks: Sequence[ImuBlock]) -> bool:
        known = self.signature.frame_id
        if known is not None and blocks and all(block.frame_id != known for block in blocks):
            return True
        if any(block.frame_id != known for block in blocks):
            # Two publishers: what is of the other frame_id says nothing about the rate.
            return False
        if _messages(blocks) < _FEWEST_MESSAGES:
            return bool(self.changed)
        return not self._as_many_as_expected(blocks) and (
            self.signature.rate_difference(blocks) > _SAME_RATE)

    def _as_many_as_expected(self, blocks: Sequence[ImuBlock]) -> bool:
        """Tell whether number and time span give the rate, as they nearly always do: cheaply."""
        if not self.signature.rate_hz:
            return True
        stamps = self.signature.stamps(blocks)
        span_s = float(stamps[-1][-1] - stamps[0][0]) * 1e-9
        counted = (_messages(blocks) - 1) / span_s if span_s > 0 else 0.0
        return abs(counted / self.signature.rate_hz - 1) < _SAME_RATE

    def _lasted(self) -> bool:
        """Whether the changed messages go on for `LASTING_S`, by their stamps and their number."""
        stamps = np.concatenate(self.signature.stamps(self.changed))
        lasted = float(stamps.max() - stamps.min()) * 1e-9
        wanted = 0.5 * LASTING_S * self.signature.measured_hz(self.changed)
        count = len(stamps)
        return count >= _MOST_MESSAGES or (
            lasted >= LASTING_S and count >= max(wanted, _FEWEST_MESSAGES))


def _messages(blocks: Sequence[ImuBlock]) -> int:
    return sum(len(block) for block in blocks)
