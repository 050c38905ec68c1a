# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Going on with a run after a crash or a reboot, if it is still the same IMU.

What was learnt before is only worth going on with if the samples that come now are from the same
sensor at the same rate. The first of them are held back until they have shown it.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.checkpoint import State, UnusableState
from imu_allan.timeline import TimelineOptions
from imu_allan.timeline.grid import measure_pace
import numpy as np
from numpy.typing import NDArray

_KEY = 'node'
_SAME_RATE = 0.05
"""Relative difference of two rates that jitter over the trial can make."""
_OTHER_RATE = 0.3
"""Relative difference that jitter cannot make: one between the two wants a longer look."""
TRIAL_S = 2.0
LONGEST_TRIAL_S = 10.0
_FEWEST_MESSAGES = 16
_MOST_MESSAGES = 20_000


@dataclass(frozen=True)
class Setup:
    """What a run depends on besides its samples."""

    topic: str
    options: TimelineOptions


def pack(characterization: Characterization, setup: Setup) -> dict[str, NDArray[Any]]:
    """Give the arrays to save of a run."""
    about = json.dumps({'topic': setup.topic, 'options': asdict(setup.options)})
    return {**characterization.to_state(), _KEY: np.array(about)}


def unpack(state: State, setup: Setup) -> Characterization:
    """
    Give the run that was saved, ready to go on: the next sample is not related to the last.

    Raises
    ------
    UnusableState
        If it was made with another setup, or its arrays do not belong together.

    """
    try:
        about = json.loads(str(state[_KEY]))
        topic, options = about['topic'], TimelineOptions(**about['options'])
        if topic != setup.topic:
            raise UnusableState('topic', f'it is of the topic {topic}')
        if options != setup.options:
            raise UnusableState('settings', 'it was made with other parameters '
                                f'({_difference(options, setup.options)})')
        run = Characterization.from_state({key: array for key, array in state.items()
                                           if key != _KEY})
        run.break_run()
    except (ImuAllanError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise UnusableState('damaged', f'its arrays do not belong together ({error})') from error
    return run


class Trial:
    """
    The first messages after a resume, held back.

    Parameters
    ----------
    run : Characterization
        The run to go on with.
    seconds : float, optional
        How long to look.

    """

    def __init__(self, run: Characterization, seconds: float = TRIAL_S) -> None:
        self._seconds = seconds
        summary = run.summary()
        self._frame_id = summary.frame_id
        self._rate_hz = summary.timeline.sample_rate_hz
        self._clock = summary.clock
        self.blocks: list[ImuBlock] = []

    def hold(self, blocks: Sequence[ImuBlock]) -> None:
        """Add messages to those held back."""
        self.blocks += blocks

    @property
    def complete(self) -> bool:
        """Whether enough has come to tell."""
        if self._messages >= _MOST_MESSAGES:
            return True
        if self.hopeless or self._lasted_s < self._seconds:
            return False
        return self._lasted_s >= LONGEST_TRIAL_S or not (
            _SAME_RATE < self._rate_difference() < _OTHER_RATE)

    @property
    def hopeless(self) -> bool:
        """Whether there is too little to tell anything."""
        return self._messages < _FEWEST_MESSAGES

    def verdict(self) -> UnusableState | None:
        """Tell why the run cannot be gone on with; None if it can."""
        frame_id = self.blocks[-1].frame_id if self.blocks else self._frame_id
        if self._frame_id is not None and frame_id != self._frame_id:
            return UnusableState('frame_id', f'it is of frame_id {self._frame_id}, '
                                 f'the messages now have {frame_id}')
        if self._rate_difference() > _SAME_RATE:
            return UnusableState('rate', f'it is of {self._rate_hz:.4g} Hz, '
                                 f'the messages now come at {self._measured_hz():.4g} Hz')
        return None

    def _rate_difference(self) -> float:
        measured = self._measured_hz()
        return abs(measured / self._rate_hz - 1) if measured and self._rate_hz else 0.0

    def _measured_hz(self) -> float:
        stamps = [block.receive_ns if self._clock == 'receive' else block.header_ns
                  for block in self.blocks]
        pace = measure_pace(np.sort(np.concatenate(stamps))) if stamps else None
        return 1e9 / pace.interval_ns if pace is not None and pace.interval_ns > 0 else 0.0

    @property
    def _lasted_s(self) -> float:
        return float(self.blocks[-1].receive_ns[-1] - self.blocks[0].receive_ns[0]) * 1e-9

    @property
    def _messages(self) -> int:
        return sum(len(block) for block in self.blocks)


def _difference(saved: TimelineOptions, now: TimelineOptions) -> str:
    before, after = asdict(saved), asdict(now)
    return ', '.join(f'{key} {before[key]}, now {after[key]}'
                     for key in before if before[key] != after[key])
